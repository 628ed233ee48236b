"""The README says nothing that the repository does not hold."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest

from piec_envs.env.registry import ENVS

ROOT = Path(__file__).resolve().parents[1]
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def cells(line: str) -> list[str]:
    return [cell.strip() for cell in line.strip().strip("|").split("|")]


def test_links_lead_somewhere():
    links = re.findall(r"\]\(([^)#]+)\)", TEXT)
    assert links
    missing = [link for link in links if "://" not in link and not (ROOT / link).exists()]
    assert not missing


def test_every_env_stands_in_the_table():
    for env_id in ENVS:
        assert f"| `{env_id}` |" in TEXT


def test_the_quick_start_is_short_and_parses():
    code = re.search(r"```python\n(.*?)```", TEXT, re.DOTALL)
    assert code is not None
    ast.parse(code[1])
    assert len([line for line in code[1].splitlines() if line.strip()]) <= 12


FIDELITY = (ROOT / "docs" / "fidelity.md").read_text(encoding="utf-8")
QUOTE = re.compile(r"<!-- from (\S+) -->\n\n(.*?)\n\n", re.DOTALL)
SOURCES = re.findall(r"<!-- from (\S+) -->", TEXT)
QUOTES = [
    (page, *quote)
    for page, text in (("README", TEXT), ("fidelity", FIDELITY))
    for quote in QUOTE.findall(text)
]


def test_tables_are_quoted():
    assert len(SOURCES) >= 6 and len(set(SOURCES)) == len(SOURCES)


@pytest.mark.parametrize(
    "page, source, quoted", QUOTES, ids=[f"{page}-{source}" for page, source, _ in QUOTES]
)
def test_numbers_stand_in_the_recorded_tables(page, source, quoted):
    """Each row that a page quotes is a part of a row of the recorded table."""
    recorded = [
        set(cells(line))
        for line in (ROOT / source).read_text(encoding="utf-8").splitlines()
        if "|" in line
    ]
    rows = quoted.splitlines()
    assert len(rows) > 3
    for line in (line for line in rows if "---" not in line):
        assert any(set(cells(line)) <= row for row in recorded), line


def test_every_quote_is_checked():
    assert [source for page, source, _ in QUOTES if page == "README"] == SOURCES
    assert sum(page == "fidelity" for page, *_ in QUOTES) == FIDELITY.count("<!-- from") >= 5


def test_links_of_the_comparison_with_the_paper_lead_somewhere():
    links = re.findall(r"\]\(([^)#]+)\)", FIDELITY)
    assert [link for link in links if not (ROOT / "docs" / link).exists()] == []
    assert "(docs/fidelity.md)" in TEXT

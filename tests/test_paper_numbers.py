"""Numbers of the paper's sections, equations and tables are the same wherever they are named."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from evaluation.studies import STUDIES

ROOT = Path(__file__).resolve().parents[1]
FIDELITY = (ROOT / "docs" / "fidelity.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")
PAGES = sorted([*(ROOT / "docs").glob("*.md"), ROOT / "README.md"])
SOURCES = sorted(
    path
    for package in ("piec_envs", "planners", "evaluation")
    for path in (ROOT / package).rglob("*.py")
)
SECTION = re.compile(r"(?:section|appendix) ([0-9AB](?:\.\d)*)")
OTHERS = {"piec_envs/escape/marching.py": {"3"}}  # sections of another paper


def rows(heading: str) -> list[list[str]]:
    """Body of the table below a heading of docs/fidelity.md."""
    text = FIDELITY.split(f"\n## {heading}\n")[1].split("\n## ")[0]
    lines = [line for line in text.splitlines() if line.startswith("|")]
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines[2:]]


SECTIONS = {row[0]: row[2] for row in rows("Sections")}
EQUATIONS = {
    number: row[1] for row in rows("Equations") for number in re.findall(r"\((\d+)\)", row[0])
}


def named(text: str) -> list[str]:
    return SECTION.findall(re.sub(r"\s+", " ", text))


def test_every_equation_figure_and_table_has_a_row():
    assert sorted(map(int, EQUATIONS)) == list(range(1, 15))
    assert sorted({int(re.match(r"\d+", row[0])[0]) for row in rows("Figures")}) == list(
        range(1, 29)
    )
    assert [row[0] for row in rows("Tables")] == ["1", "2", "3"]


@pytest.mark.parametrize("study", [name for name in STUDIES if name != "rl-comparison"])
def test_a_study_names_one_section_everywhere(study):
    (section,) = named(STUDIES[study].description)
    (line,) = [line for line in README.splitlines() if line.startswith(f"| [{study}]")]
    assert named(line.split("|")[3].replace("task of ", "section ")) == [section]
    module = STUDIES[study].load()
    assert section in named(module.__doc__ or "")
    assert study in SECTIONS[section]


@pytest.mark.parametrize("path", [*PAGES, *SOURCES], ids=lambda path: str(path.relative_to(ROOT)))
def test_sections_and_equations_exist(path):
    text = re.sub(r"\s+", " ", path.read_text(encoding="utf-8"))
    for section in set(named(text)) - OTHERS.get(str(path.relative_to(ROOT)), set()):
        assert any(known == section or known.startswith(f"{section}.") for known in SECTIONS), (
            section
        )
    for number in re.findall(r"\beqs?\. \(?(\d+)", text):
        assert number in EQUATIONS, number
    for section, number in re.findall(r"section (\d\.\d), eqs?\. (\d+)", text):
        assert EQUATIONS[number] == section


@pytest.mark.parametrize(
    "path", sorted((ROOT / "piec_envs" / "dynamics").glob("*.py")), ids=lambda path: path.name
)
def test_the_contact_model_is_the_papers_only_equation_of_dynamics(path):
    (number,) = [number for number, section in EQUATIONS.items() if section == "5.3"]
    assert set(re.findall(r"\beq\. (\d+)", path.read_text(encoding="utf-8"))) <= {number}

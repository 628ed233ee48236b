"""The page of each environment says what the environment is."""

from __future__ import annotations

from pathlib import Path

import pytest

from piec_envs.env.registry import ENVS
from piec_envs.env.sheets import sheet

PAGES = Path(__file__).resolve().parents[1] / "docs" / "envs"


@pytest.mark.parametrize("env_id", ENVS)
def test_the_page_is_what_the_environment_says(env_id):
    entry = ENVS[env_id]
    written = (PAGES / f"{entry.name}.md").read_text(encoding="utf-8")
    assert written == sheet(entry), "run `make sheets`"
    assert (PAGES / f"{entry.name}.png").read_bytes().startswith(b"\x89PNG")


def test_there_is_a_page_for_every_environment_and_no_other():
    assert {path.stem for path in PAGES.glob("*.md")} == {entry.name for entry in ENVS.values()}

"""The sources that records name: commit, whether it was edited since, and a digest of the files."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

from piec_envs.sources import SOURCES, git_state, source, source_digest

ROOT = Path(__file__).resolve().parents[1]
AUTHOR = (
    "-c",
    "user.name=Tester",
    "-c",
    "user.email=tester@example.org",
    "-c",
    "commit.gpgsign=false",
)


def git(folder: Path, *arguments: str) -> str:
    clean = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    command = ["git", "-C", str(folder), *AUTHOR, *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=clean
    ).stdout.strip()


@pytest.fixture
def tree(tmp_path) -> Path:
    """The three packages, committed."""
    for name in SOURCES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text('"""One line."""\n')
    (tmp_path / "README").write_text("no source\n")
    git(tmp_path, "init", "--quiet")
    git(tmp_path, "add", ".")
    git(tmp_path, "commit", "--quiet", "-m", "first")
    return tmp_path


def test_a_clean_tree_names_its_commit(tree):
    assert git_state(tree) == {"commit": git(tree, "rev-parse", "HEAD"), "modified": False}
    (tree / "README").write_text("results and texts are no sources\n")
    assert git_state(tree)["modified"] is False


@pytest.mark.parametrize(
    "name", ["piec_envs/__init__.py", "planners/__init__.py", "evaluation/new.py"]
)
@pytest.mark.parametrize("staged", [False, True])
def test_an_edited_tree_says_so(tree, name, staged):
    before = source_digest(tree)
    (tree / name).write_text("edited = True\n")
    if staged:
        git(tree, "add", name)
    assert git_state(tree) == {"commit": git(tree, "rev-parse", "HEAD"), "modified": True}
    assert source_digest(tree) != before


def test_an_installation_inside_another_project_names_no_commit(tree):
    inside = tree / "venv" / "site-packages"
    for name in SOURCES:
        (inside / name).mkdir(parents=True)
        (inside / name / "__init__.py").write_text('"""One line."""\n')
    assert git_state(inside) == {"commit": None, "modified": None}
    assert source_digest(inside) == source_digest(tree)


def test_without_git_there_is_a_digest_alone(tree, monkeypatch):
    monkeypatch.setenv("PATH", "")
    assert git_state(tree) == {"commit": None, "modified": None}
    assert len(source_digest(tree)) == 16


def test_the_digest_is_that_of_names_and_contents(tree):
    before = source_digest(tree)
    # as git checks out on Windows
    (tree / "planners" / "__init__.py").write_bytes(b'"""One line."""\r\n')
    (tree / "planners" / "__init__.cache.nbi").write_text("compiled")
    assert source_digest(tree) == before
    (tree / "planners" / "__init__.py").rename(tree / "planners" / "moved.py")
    assert source_digest(tree) != before


def test_this_process_names_its_own_sources():
    here = source()
    assert set(here) == {"commit", "modified", "digest"}
    assert here["digest"] == source_digest(ROOT)
    assert {name: here[name] for name in ("commit", "modified")} == git_state(ROOT)

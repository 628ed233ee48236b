"""What is said to a user whose names, files or installation stand in the way."""

from __future__ import annotations

import json
import subprocess
import sys
from importlib import metadata
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

import piec_envs.shadows
import piec_envs.versions
from evaluation.protocols import PROTOCOLS
from piec_envs.env.registry import ENVS
from piec_envs.errors import MissingDependencyError, UnknownNameError, check_name, closest
from piec_envs.files import why_unreadable
from piec_envs.shadows import shadow_of
from piec_envs.versions import install_command
from piec_envs.world.objects import OBJECTS

ROOT = Path(__file__).resolve().parents[1]
TABLES = {"object": tuple(OBJECTS), "protocol": tuple(PROTOCOLS), "environment": tuple(ENVS)}


@pytest.mark.parametrize("kind", TABLES)
@given(data=st.data())
def test_a_name_in_the_wrong_case_is_recognised(kind, data):
    name = data.draw(st.sampled_from(TABLES[kind]))
    flips = data.draw(st.lists(st.booleans(), min_size=len(name), max_size=len(name)))
    typed = "".join(c.swapcase() if flip else c for c, flip in zip(name, flips, strict=True))
    assert closest(typed, TABLES[kind]) == name
    if typed != name:
        with pytest.raises(UnknownNameError) as caught:
            check_name(kind, typed, TABLES[kind])
        assert f"Did you mean {name!r}?" in str(caught.value)


@pytest.mark.parametrize("env_id", ENVS)
def test_an_id_is_recognised_without_its_namespace(env_id):
    assert closest(env_id.rpartition("/")[2].lower(), ENVS) == env_id


@pytest.mark.parametrize(
    ("typed", "meant"), [("Circel", "circle"), ("SQUARES", "square"), ("zzz", None), (3, None)]
)
def test_a_slip_in_the_wrong_case_is_recognised(typed, meant):
    assert closest(typed, OBJECTS) == meant


def test_a_clone_is_installed_from_itself(monkeypatch, tmp_path):
    monkeypatch.chdir(ROOT)
    assert install_command("rl") == "pip install -e '.[rl]'"
    assert "pip install -e '.[rl]'" in str(MissingDependencyError("torch", "rl"))
    monkeypatch.chdir(tmp_path)
    assert install_command("rl") == f"pip install -e '{ROOT}[rl]'"


@pytest.mark.parametrize(
    ("origin", "expected"),
    [
        (None, 'pip install "piec-envs[rl]"'),
        (
            {"url": "file:///home/ann/my%20clone", "dir_info": {}},
            'pip install "/home/ann/my clone[rl]"',
        ),
        (
            {"url": "file:///wheels/piec_envs-0.1.0-py3-none-any.whl", "archive_info": {}},
            'pip install "piec-envs[rl] @ file:///wheels/piec_envs-0.1.0-py3-none-any.whl"',
        ),
        (
            {"url": "https://example.org/piec.git", "vcs_info": {"vcs": "git", "commit_id": "abc"}},
            'pip install "piec-envs[rl] @ git+https://example.org/piec.git@abc"',
        ),
    ],
)
def test_an_installation_comes_again_from_where_it_came(origin, expected, monkeypatch, tmp_path):
    class Distribution:
        def read_text(self, name):
            assert name == "direct_url.json"
            return None if origin is None else json.dumps(origin)

    monkeypatch.setattr(
        piec_envs.versions,
        "__file__",
        str(tmp_path / "site-packages" / "piec_envs" / "versions.py"),
    )
    monkeypatch.setattr(metadata, "distribution", lambda name: Distribution())
    assert install_command("rl") == expected


def test_every_extra_that_is_hinted_at_exists():
    """All hints come from one place, so that none names the index to who works in a clone."""
    said = []
    for folder in ("piec_envs", "planners", "evaluation"):
        for file in (ROOT / folder).rglob("*.py"):
            text = file.read_text(encoding="utf-8")
            said += [file.name for line in text.splitlines() if "pip install" in line]
    assert set(said) == {"versions.py"}


SCRIPT = "import warnings\nwarnings.simplefilter('error')\nimport piec_envs\n"


def python(folder: Path, *arguments: str) -> subprocess.CompletedProcess:
    return subprocess.run(
        [sys.executable, *arguments],
        capture_output=True,
        text=True,
        cwd=folder,
        env={"PYTHONPATH": str(ROOT)},
    )


@pytest.mark.parametrize("name", ["planners", "evaluation"])
def test_a_script_with_the_name_of_a_package_is_told_so(name, tmp_path):
    script = tmp_path / f"{name}.py"
    script.write_text(SCRIPT)
    done = python(tmp_path, script.name)
    assert (
        done.returncode != 0 and f"{script} hides the package {name!r} of piec-envs" in done.stderr
    )
    # who does not need the package goes on
    script.write_text("import piec_envs\nprint('went on')\n")
    assert python(tmp_path, script.name).stdout == "went on\n"


def test_a_folder_beside_the_script_is_told_of(tmp_path):
    (tmp_path / "planners").mkdir()
    (tmp_path / "planners" / "__init__.py").write_text("")
    (tmp_path / "mine.py").write_text("from evaluation import evaluate\n")
    done = python(tmp_path, "mine.py")
    assert done.returncode != 0
    last = done.stderr.strip().splitlines()[-1]
    assert (
        last.startswith("piec_envs.errors.ShadowedPackageError")
        and str(tmp_path / "planners") in last
    )
    done = python(tmp_path, "-m", "evaluation.cli", "list")
    assert done.returncode != 0 and "rename it" in done.stderr


def test_nothing_is_hidden_here(tmp_path, monkeypatch):
    assert shadow_of("planners") is None and shadow_of("evaluation") is None
    monkeypatch.setattr(piec_envs.shadows, "__file__", str(tmp_path / "piec_envs" / "shadows.py"))
    assert shadow_of("planners") is None  # where ours is not installed, nothing hides it


def test_a_file_is_missing_or_a_folder_or_broken(tmp_path):
    file = tmp_path / "a.npz"
    file.write_text("?")
    cases = {tmp_path / "A.npz": "there is no file", tmp_path: "is a folder", file: "or is broken"}
    for path, message in cases.items():
        try:
            path.read_bytes()
            raise ValueError("no archive")
        except (OSError, ValueError) as error:
            assert message in why_unreadable(path, "plan file", error)

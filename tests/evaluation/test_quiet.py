"""What commands leave unsaid: bars in logs, notes under --quiet, and what they need not load."""

from __future__ import annotations

import io
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tqdm import tqdm

from evaluation.cli import main
from piec_envs import __version__
from piec_envs.console import no_bar, note, quiet

ROOT = Path(__file__).resolve().parents[2]


def test_a_log_that_is_no_terminal_gets_no_bar(monkeypatch):
    log = io.StringIO()
    for _ in tqdm(range(3), file=log, disable=no_bar()):
        pass
    assert log.getvalue() == ""
    monkeypatch.setattr(log, "isatty", lambda: True, raising=False)
    for _ in tqdm(range(3), file=log, disable=no_bar()):
        pass
    assert log.getvalue()
    assert no_bar(False) is True


def test_every_bar_asks_whether_it_is_wanted():
    for package in ("piec_envs", "planners", "evaluation"):
        for path in (ROOT / package).rglob("*.py"):
            text = path.read_text(encoding="utf-8")
            bars = sum(text.count(f"{call}(") for call in (" tqdm", " trange", "[tqdm"))
            assert bars <= text.count("disable="), path
            assert "disable=not" not in text, path


def test_quiet_leaves_out_notes_and_bars_alone(monkeypatch, capsys):
    assert not quiet()
    note("to be read")
    monkeypatch.setenv("PIEC_QUIET", "1")
    note("not to be read")
    assert quiet() and no_bar() is True
    assert capsys.readouterr().err == "piec_envs: to be read\n"


@pytest.mark.parametrize("arguments", [["--quiet", "list"], ["list", "--quiet"]])
def test_quiet_stands_before_or_behind_the_command_and_ends_with_it(arguments, monkeypatch, capsys):
    monkeypatch.delenv("PIEC_QUIET", raising=False)
    seen = []
    monkeypatch.setattr(
        "evaluation.commands.listing._tables", lambda: seen.append(quiet()) or {"a": {"b": "c"}}
    )
    assert main(arguments) == 0 and seen == [True]
    assert "PIEC_QUIET" not in os.environ and "b  c" in capsys.readouterr().out


def test_version(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["--version"])
    assert leaving.value.code == 0 and capsys.readouterr().out.startswith(
        f"piec-envs {__version__} ("
    )


LIST = """
import sys
from evaluation.cli import main
main(["list"])
print([name for name in ("torch", "mujoco", "matplotlib", "cma") if name in sys.modules],
file=sys.stderr) """


def test_list_loads_nothing_that_is_slow():
    done = subprocess.run(
        [sys.executable, "-c", LIST], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stderr.rstrip().endswith("[]")

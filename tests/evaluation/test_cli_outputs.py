"""What commands write over, what they say is kept when interrupted, and what they leave unsaid."""

from __future__ import annotations

from pathlib import Path

import pytest

from evaluation.cli import main, make_parser
from evaluation.commands import COMMANDS, kept, outputs
from piec_envs.errors import InvalidParameterError

ROOT = Path(__file__).resolve().parents[2]
TINY = [
    "--planner",
    "iterations=2",
    "population=4",
    "restarts=1",
    "start=rest",
    "robust_iterations=0",
]
# What each command needs to run, were its output all right, and what it writes there, "" for a
# folder.
WRITERS = {
    "plan": (["--objective", "contact", *TINY], "plan.npz"),
    "evaluate": (["missing.npz"], ""),
    "demo": (["--smoke"], ""),
    "reproduce": (["eikonal-toy", "--smoke"], ""),
    "train": ([], ""),
    "train-field": ([], ""),
    "bench": (["--quick"], "bench.json"),
    "render": ([], "state.png"),
}


def forbid_work(monkeypatch) -> None:
    """Any command that gets as far as its work fails."""

    def refuse(self):
        raise AssertionError("it works before it has looked at its output")

    monkeypatch.setattr(type(COMMANDS["list"]), "load", refuse)


def parsed(*arguments: object):
    return make_parser().parse_args([str(argument) for argument in arguments])


def test_every_command_with_an_out_is_checked_before_its_work():
    with_out = {name for name in COMMANDS if _has_out(name)}
    assert with_out == set(WRITERS) == set(outputs.CHECKS)


def _has_out(name: str) -> bool:
    known = {"evaluate": ["x.npz"], "reproduce": ["x"]}.get(name, [])
    return hasattr(parsed(name, *known), "out")


@pytest.mark.parametrize("name", WRITERS)
def test_a_folder_that_cannot_be_written_is_noticed_before_the_work(
    name, tmp_path, monkeypatch, capsys
):
    arguments, file = WRITERS[name]
    (tmp_path / "file").write_text("in the way")
    args = parsed(name, *arguments, "--out", tmp_path / "file" / "folder" / file)
    forbid_work(monkeypatch)
    monkeypatch.setattr("evaluation.cli.make_parser", lambda: _Ready(args))
    assert main([]) == 2
    assert "nothing can be written into the folder" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


class _Ready:
    def __init__(self, args):
        self.args = args

    def parse_args(self, _):
        return self.args


@pytest.mark.parametrize("name", WRITERS)
def test_what_can_be_written_leaves_no_trace_of_the_check(name, tmp_path):
    arguments, file = WRITERS[name]
    outputs.check_outputs(parsed(name, *arguments, "--out", tmp_path / "a" / "b" / file))
    assert not any(tmp_path.iterdir())


FOREIGN = {
    "plan": ("plan.npz", "thesis.txt"),
    "bench": ("bench.json", "bench.md"),
    "render": ("state.png", "state.gif"),
}


@pytest.mark.parametrize(
    ("name", "file"), [(name, file) for name, files in FOREIGN.items() for file in files]
)
@pytest.mark.parametrize("content", ["three years of work", "{}", "[1]"])
def test_a_file_that_is_not_ours_is_left_alone(name, file, content, tmp_path):
    path = tmp_path / file
    path.write_text(content)
    out = path.with_suffix(".json") if file == "bench.md" else path
    with pytest.raises(InvalidParameterError, match="is left alone"):
        outputs.check_outputs(parsed(name, *WRITERS[name][0], "--out", out))
    assert path.read_text() == content


@pytest.mark.parametrize("name", ["evaluate", "demo", "reproduce"])
def test_a_table_that_is_not_ours_is_left_alone(name, tmp_path):
    folder = tmp_path / "eikonal-toy" if name == "reproduce" else tmp_path
    folder.mkdir(exist_ok=True)
    (folder / "table.md").write_text("of somebody else")
    args = parsed(name, *WRITERS[name][0], "--out", tmp_path)
    with pytest.raises(InvalidParameterError, match=r"table\.md exists"):
        outputs.check_outputs(args)
    (folder / "records.jsonl").write_text("")
    outputs.check_outputs(args)


def test_what_is_ours_may_be_written_anew(sweep_plan, tmp_path):
    plan = sweep_plan.save(tmp_path / "plan.npz")
    outputs.check_outputs(parsed("plan", "--out", plan))
    (tmp_path / "empty.npz").write_bytes(b"")
    outputs.check_outputs(parsed("plan", "--out", tmp_path / "empty.npz"))
    with pytest.raises(InvalidParameterError, match="is a folder"):
        outputs.check_outputs(parsed("plan", "--out", tmp_path))
    (tmp_path / "bench.json").write_text('{"rows": [], "machine": {}}')
    outputs.check_outputs(parsed("bench", "--out", tmp_path / "bench.json"))


# --- Ctrl-C -------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_said_to_be_kept_where_nothing_is(name, tmp_path):
    arguments, file = WRITERS[name]
    assert kept.kept_by(parsed(name, *arguments, "--out", tmp_path / file)) == "nothing is kept"


# --- quiet --------------------------------------------------------------------------------------

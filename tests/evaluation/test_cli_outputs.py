"""What commands write over, what they say is kept when interrupted, and what they leave unsaid."""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from tqdm import tqdm

from evaluation import rollout
from evaluation.cli import main, make_parser
from evaluation.commands import COMMANDS, kept, outputs
from evaluation.records import RecordFile, make_record
from piec_envs import __version__
from piec_envs.console import no_bar, note, quiet
from piec_envs.errors import InvalidParameterError
from planners import CmaEsPlanner, Plan, PlanningInterrupted, search

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


def interrupt_after(monkeypatch, iterations: int) -> None:
    """Ctrl-C in the planner's costs, after so many iterations of its search."""
    costs = search.PathCost.nominal
    calls = []

    def nominal(self, paths):
        if len(paths) > 1:  # not while the best plan is made from what there is
            calls.append(len(paths))
            if len(calls) > iterations:
                raise KeyboardInterrupt
        return costs(self, paths)

    monkeypatch.setattr(search.PathCost, "nominal", nominal)


SMALL = {
    "iterations": 4,
    "population": 4,
    "restarts": 2,
    "screening": 2,
    "survivors": 1,
    "start": "rest",
}


@pytest.mark.parametrize("done", [1, 3])
def test_an_interrupted_planner_has_its_best_plan_so_far(done, monkeypatch):
    env_id = "piec_envs/PlanarArmPush-v0"
    planner = CmaEsPlanner(objective="contact", robust_iterations=0, **SMALL)
    rest = planner.plan(env_id, progress=False)
    interrupt_after(monkeypatch, done)
    with pytest.raises(PlanningInterrupted, match=f"after {done} of 4 iterations") as stopped:
        planner.plan(env_id, progress=False)
    assert rest.cost <= stopped.value.plan.cost < float("inf")


def test_an_interrupted_planner_without_a_plan_has_none(monkeypatch):
    interrupt_after(monkeypatch, 0)
    planner = CmaEsPlanner(objective="contact", robust_iterations=0, **SMALL)
    with pytest.raises(KeyboardInterrupt) as stopped:
        planner.plan("piec_envs/PlanarArmPush-v0", progress=False)
    assert not isinstance(stopped.value, PlanningInterrupted)


def test_piec_plan_keeps_the_best_so_far_and_overwrites_no_plan_with_it(
    tmp_path, monkeypatch, capsys
):
    interrupt_after(monkeypatch, 1)
    out = tmp_path / "plan.npz"
    arguments = ["plan", "--objective", "contact", *TINY, "--out", str(out), "--json"]
    assert main(arguments) == 130
    captured = capsys.readouterr()
    assert (
        "interrupted after 1 of 2 iterations" in captured.err
        and str(out) in json.loads(captured.out)["error"]
    )
    first = out.read_bytes()
    assert Plan.load(out).objective == "contact"
    monkeypatch.undo()
    interrupt_after(monkeypatch, 1)
    assert main(arguments) == 130
    assert out.read_bytes() == first and Plan.load(tmp_path / "plan-interrupted.npz").cost > 0
    assert "plan-interrupted.npz" in capsys.readouterr().err


def test_piec_plan_keeps_nothing_where_there_is_nothing(tmp_path, monkeypatch, capsys):
    interrupt_after(monkeypatch, 0)
    assert (
        main(["plan", "--objective", "contact", *TINY, "--out", str(tmp_path / "plan.npz")]) == 130
    )
    assert "nothing is kept" in capsys.readouterr().err and not any(tmp_path.iterdir())


@pytest.mark.parametrize("name", WRITERS)
def test_nothing_is_said_to_be_kept_where_nothing_is(name, tmp_path):
    arguments, file = WRITERS[name]
    assert kept.kept_by(parsed(name, *arguments, "--out", tmp_path / file)) == "nothing is kept"


def test_what_is_kept_is_counted(tmp_path, monkeypatch, capsys, sweep_plan):
    plan = sweep_plan.save(tmp_path / "plan.npz")

    def stop(*arguments):
        raise KeyboardInterrupt

    run = rollout._run_rows
    arguments = [
        "evaluate",
        str(plan),
        "--episodes",
        "2",
        "--set",
        "escape_field=null",
        "--out",
        str(tmp_path / "out"),
    ]
    assert main([*arguments, "--protocol", "nominal"]) == 0
    monkeypatch.setattr(rollout, "_run_rows", stop)
    assert main([*arguments, "--protocol", "nominal", "disturbance-5mm"]) == 130
    said = capsys.readouterr().err
    assert f"1 evaluation recorded in {tmp_path / 'out'}; the same command goes on" in said
    monkeypatch.setattr(rollout, "_run_rows", run)
    assert main([*arguments, "--protocol", "nominal", "disturbance-5mm"]) == 0


def test_what_is_kept_of_a_study_is_that_of_its_records(tmp_path):
    folder = tmp_path / "eikonal-toy"
    folder.mkdir()
    with RecordFile(folder / "records.jsonl") as file:
        for seed, work in enumerate(("plan", "plan", "evaluate", None)):
            file.append(make_record({} if work is None else {"work": work}, seed, {}, 0.1))
    said = kept.kept_by(parsed("reproduce", "eikonal-toy", "--out", tmp_path))
    assert said.startswith(
        f"2 plans, 1 evaluation, 1 piece of work recorded in {tmp_path}; the same command"
    )


def test_a_training_that_was_stopped_names_its_checkpoint(tmp_path):
    (tmp_path / "planar_arm-network.checkpoint.npz").write_bytes(b"")
    assert "planar_arm-network.checkpoint.npz, is kept" in kept.kept_by(
        parsed("train-field", "--out", tmp_path)
    )
    (tmp_path / "checkpoint-000000000100").mkdir()
    assert "last checkpoint" in kept.kept_by(parsed("train", "--out", tmp_path))
    (tmp_path / "agent.json").write_text("{}")
    assert "has ended" in kept.kept_by(parsed("train", "--out", tmp_path))


# --- quiet --------------------------------------------------------------------------------------


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

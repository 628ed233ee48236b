"""What Ctrl-C leaves of plans, evaluations, studies and trainings, and what commands say of it."""

from __future__ import annotations

import json

import pytest

from evaluation import rollout
from evaluation.cli import main, make_parser
from evaluation.commands import kept
from evaluation.records import RecordFile, make_record
from planners import CmaEsPlanner, Plan, PlanningInterrupted, search

TINY = [
    "--planner",
    "iterations=2",
    "population=4",
    "restarts=1",
    "start=rest",
    "robust_iterations=0",
]


def parsed(*arguments: object):
    return make_parser().parse_args([str(argument) for argument in arguments])


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

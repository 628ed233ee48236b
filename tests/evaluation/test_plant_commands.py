"""`piec evaluate` and `piec render` go by the plan, and say by what they go."""

from __future__ import annotations

import dataclasses
import json

import pytest

from evaluation import evaluate, summarise
from evaluation.cli import main
from evaluation.records import read_records

GOAL = [0.2, 0.5]
OTHER = {"goal": GOAL, "object": "square", "friction": 0.1, "inertia": "own", "preset": "paper"}
DRAWN = {
    "start_noise": [0.02, 0.1],
    "randomize": {"friction": [0.1, 0.9], "object": ["circle", "hexagon"]},
}
TINY = {"iterations": 1, "population": 4, "restarts": 1, "start": "rest", "robust_iterations": 0}


@pytest.fixture
def other_plan(sweep_plan):
    """A plan whose goal, object and everything else are not the environment's own."""
    return dataclasses.replace(sweep_plan, env_kwargs=OTHER)


@pytest.fixture
def drawn_plan(sweep_plan):
    """A plan that was made with drawn starts, frictions and objects."""
    return dataclasses.replace(sweep_plan, env_kwargs={"goal": GOAL, **DRAWN})


@pytest.fixture
def run(capsys):
    def run(*arguments):
        assert main([str(argument) for argument in [*arguments, "--json"]]) == 0
        return json.loads(capsys.readouterr().out)

    return run


def test_evaluate_judges_by_the_plans_own(other_plan, tmp_path, run):
    """A plan for (0.2, 0.5) was judged against (-0.3, 0.4)."""
    file = other_plan.save(tmp_path / "p.npz")
    expected = summarise(evaluate(other_plan))
    document = run("evaluate", file, "--out", tmp_path / "out")
    (result,) = document["evaluations"]
    assert result["d2g_mean"] == expected["d2g_mean"]
    assert {name: result["plant"][name] for name in OTHER} == OTHER
    table = (tmp_path / "out" / "table.md").read_text()
    above = table.partition("| plan")[0]
    assert "goal (0.2, 0.5) m, object square, friction 0.1" in above and "preset paper" in above
    (record,) = read_records(tmp_path / "out" / "records.jsonl")
    assert record["spec"]["env_kwargs"]["goal"] == GOAL


def test_evaluate_takes_options_over_the_plan(other_plan, tmp_path, run):
    file = other_plan.save(tmp_path / "p.npz")
    options = [
        "--plant",
        "default",
        "--set",
        "friction=0.3",
        "--protocol",
        "nominal",
        "friction-0.80",
    ]
    document = run("evaluate", file, "--out", tmp_path / "out", *options)
    first, second = (result["plant"] for result in document["evaluations"])
    assert (first["object"], first["friction"], first["goal"]) == ("circle", 0.3, GOAL)
    assert second == {**first, "friction": 0.8}
    assert "- friction-0.80: friction 0.8\n" in (tmp_path / "out" / "table.md").read_text()


def test_evaluate_says_what_was_drawn_in_planning(drawn_plan, tmp_path, run):
    file = drawn_plan.save(tmp_path / "p.npz")
    document = run("evaluate", file, "--out", tmp_path / "out")
    assert document["evaluations"][0]["n"] == 1
    above = (tmp_path / "out" / "table.md").read_text().partition("| plan")[0]
    assert (
        "made with randomize friction of (0.1, 0.9); object of (circle, hexagon), start_noise "
        "(0.02, 0.1)" in above
    )
    document = run(
        "evaluate", file, "--out", tmp_path / "out", "--plant", "disturbed", "--episodes", 3
    )
    assert document["evaluations"][0]["n"] == 3
    assert document["evaluations"][0]["plant"]["randomize"] == DRAWN["randomize"]


def test_files_of_one_name_are_told_apart(other_plan, drawn_plan, tmp_path, run):
    files = [
        plan.save(tmp_path / name / "p.npz")
        for name, plan in {"a": other_plan, "b": drawn_plan}.items()
    ]
    run("evaluate", *files, "--out", tmp_path / "out")
    table = (tmp_path / "out" / "table.md").read_text()
    assert all(f"Plant of {file}:" in table and f"| {file} " in table for file in files)


def test_render_draws_the_plans_own(other_plan, tmp_path, run):
    file = other_plan.save(tmp_path / "p.npz")
    document = run("render", file, "--frames", 1)
    assert abs(document["end"]["goal_distance"] - evaluate(other_plan).goal_distance[0, -1]) < 1e-12
    assert {name: document["plant"][name] for name in OTHER} == OTHER
    document = run("render", file, "--frames", 1, "--plant", "default")
    assert (document["plant"]["object"], document["plant"]["goal"]) == ("circle", GOAL)


def test_plan_says_its_model(tmp_path, run):
    tiny = [f"{name}={value}" for name, value in TINY.items()]
    made = run(
        "plan",
        "--objective",
        "contact",
        "--planner",
        *tiny,
        "--set",
        "friction=0.1",
        "--out",
        tmp_path / "p",
    )
    assert made["model"]["friction"] == 0.1

"""The table of start postures: what it holds, what `start` takes from it, and what is refused."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from evaluation.studies.franka_starts import CLEARANCE, KINDS, TASKS
from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.escape.field import make_field
from piec_envs.model.start_postures import checked_start, start_names, start_posture, start_table
from piec_envs.world.robots import get_robot
from piec_envs.world.robots.franka import FRANKAS
from planners import CagingProblem, CmaEsConfiguration

ROOT = Path(__file__).resolve().parents[2]
ROWS = [(robot, name) for robot, row in start_table().items() for name in row]
PUSH = "piec_envs/MobileFrankaPush-v0"
CAPSULES = {"geometry": "capsules", "escape_field": None}


def task_of(robot_name):
    return TASKS["mobile" if robot_name.startswith("mobile") else "fixed"]


def problem_of(robot_name, escape):
    """The static problem that a start solves: the whole arm keeps clear, the field is of what
    touches.
    """
    task = task_of(robot_name)
    return CagingProblem(
        get_robot(robot_name).whole_name, task.object, task.start, escape, clearance=CLEARANCE
    )


def test_every_franka_has_its_starts():
    assert set(start_table()) == set(FRANKAS)
    for name, row in start_table().items():
        whole = not {"link", "point"} & set(name.split("_"))
        assert tuple(row) == (KINDS["whole_arm"] if whole else ("cage",))
        assert start_names(name) == (*row, "home") and checked_start("auto", name) == "cage"
    assert start_names("planar_arm") == ("home",) and checked_start("auto", "planar_arm") == "home"


@pytest.mark.parametrize(("robot_name", "name"), ROWS)
def test_starts_are_within_the_limits_and_clear_of_the_object(robot_name, name):
    q = start_posture(name, robot_name)
    escape = make_field("grid", get_robot(robot_name).name, resolution=32)
    problem = problem_of(robot_name, escape)
    assert (q >= problem.lower).all() and (q <= problem.upper).all()
    phi = problem.constraints(q[None])[0][0]
    assert phi.min() >= -1e-5  # rounded to 1e-6 rad and m
    assert phi[: problem.object_rows].min() <= 0.05  # beside it


@pytest.mark.parametrize("contact", ["whole_arm", "link", "point"])
@pytest.mark.parametrize(
    "env_id", [PUSH, "piec_envs/MobileFrankaTrack-v0", "piec_envs/FrankaPush-v0"]
)
def test_an_episode_begins_at_its_start(env_id, contact):
    for start in ("auto", "home"):
        env = gym.make(env_id, contact=contact, start=start, **CAPSULES).unwrapped
        env.reset(seed=0)
        robot = env.model.robot
        expected = robot.home if start == "home" else start_table()[robot.name]["cage"]
        np.testing.assert_array_equal(env.get_state().q_r[0], expected)
        np.testing.assert_array_equal(env.get_state().q_cmd[0], expected)


def test_joint_positions_are_taken_as_they_are():
    q = [-0.5, 0.25, 0.1, -2.0, 1.0]
    env = gym.make(PUSH, start=q, **CAPSULES).unwrapped
    env.reset(seed=0)
    assert env.get_state().q_r[0].tolist() == q and env.config.start == tuple(q)


@pytest.mark.parametrize(
    ("start", "error", "words"),
    [
        ([0.0, 0.0, 0.0], InvalidParameterError, r"start.*\(5,\)"),
        ([0.0, 0.0, np.nan, -1.0, 1.0], InvalidParameterError, "start.*finite"),
        (
            [0.0, 2.5, 0.0, -1.0, 1.0],
            InvalidParameterError,
            "start must be within the joint limits.*2.5",
        ),
        (
            [0.0, 0.0, 0.0, 0.5, 1.0],
            InvalidParameterError,
            "start must be within the joint limits.*0.5",
        ),
        ("touch", UnknownNameError, "start of mobile_franka_capsules.*touch.*cage.*home.*open"),
    ],
    ids=["length", "nan", "base", "joint", "name"],
)
def test_bad_starts_are_refused(start, error, words):
    with pytest.raises(error, match=words):
        gym.make(PUSH, start=start, **CAPSULES)


def test_a_name_of_another_robot_is_refused():
    with pytest.raises(UnknownNameError, match="start of mobile_franka_link_capsules"):
        gym.make(PUSH, contact="link", start="open", **CAPSULES)


def test_the_table_is_what_the_study_found():
    found = json.loads((ROOT / "results" / "franka-starts" / "starts.json").read_text())
    assert found == start_table()


def test_no_posture_near_a_cage_holds_the_object_longer():
    name = "mobile_franka_capsules"
    problem = problem_of(name, make_field("grid", name, resolution=96, method="marching"))
    shipped = start_posture("cage", name)
    search = CmaEsConfiguration(population=12, iterations=10, sigma=0.03)
    found = search.solve(problem, start=np.clip(shipped, problem.lower, problem.upper))
    assert found.feasible
    assert problem.measure(shipped[None]).escape_time[0] >= 0.99 * found.escape_time

"""Exhaustive search: it sees what the problem sees, at every heading, and beats random postures."""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.field import make_field
from piec_envs.world.robots import get_robot
from planners import CagingProblem, CmaEsConfiguration, ExhaustiveConfiguration
from planners.exhaustive import inner_postures, outer_postures
from planners.posture_starts import draw_postures

POSE = np.array([0.05, 0.22, 0.4])
SEARCH = ExhaustiveConfiguration(spacing=0.3, headings=40, polished=3, population=10, iterations=10)


@pytest.fixture(scope="module")
def problem() -> CagingProblem:
    field = make_field("table", "franka_capsules", resolution=49, spacing=0.15, threads=1)
    return CagingProblem("franka_capsules", "paper_pack", POSE, field, threads=1)


def test_the_grid_of_values_is_what_the_problem_measures(problem):
    heads = outer_postures(problem, SEARCH.headings, SEARCH.offset)
    inner = inner_postures(problem, SEARCH.spacing)
    values = SEARCH._values(problem, heads, inner[::7], -np.inf)
    # (B, H, 3)
    q = np.array([[np.append(head, posture) for head in heads] for posture in inner[::7]])
    judged = problem.measure(q.reshape(-1, 3))
    allowed = (judged.phi >= 0).all(axis=1).reshape(values.shape)
    np.testing.assert_array_equal(np.isfinite(values), allowed)
    assert 100 < allowed.sum() < allowed.size
    np.testing.assert_allclose(
        values[allowed], judged.escape_time.reshape(values.shape)[allowed], rtol=1e-9
    )


def test_it_keeps_the_constraints_and_no_random_posture_is_better(problem):
    found = SEARCH.solve(problem)
    assert found.feasible and min(found.object_distance, found.self_distance) >= -1e-6
    assert (found.posture >= problem.lower).all() and (found.posture <= problem.upper).all()
    q = draw_postures(problem, "uniform", 3000, np.random.default_rng(0))
    judged = problem.measure(q)
    assert found.escape_time >= judged.escape_time[judged.feasible].max()
    again = SEARCH.solve(problem, seed=0)
    np.testing.assert_array_equal(found.posture, again.posture)
    assert found.queries == len(inner_postures(problem, SEARCH.spacing)) + 3 * 10 * 10


@pytest.mark.parametrize(
    ("choice", "name"),
    [({"spacing": 0.0}, "spacing"), ({"headings": 0}, "headings"), ({"polished": 1.5}, "polished")],
)
def test_bad_arguments_are_refused(choice, name):
    with pytest.raises(InvalidParameterError, match=name):
        ExhaustiveConfiguration(**choice)


def test_several_poses_are_refused(problem):
    many = CagingProblem(problem.robot, problem.object, np.tile(POSE, (2, 1)), problem.field)
    with pytest.raises(InvalidParameterError, match="one pose"):
        SEARCH.solve(many)


def test_an_object_that_no_posture_clears_is_said(problem):
    inside = CagingProblem(problem.robot, problem.object, np.zeros(3), problem.field)
    with pytest.raises(InvalidParameterError, match="overlap"):
        SEARCH.solve(inside)


# --- a base that slides ------------------------------------------------------------------------

ROUND = np.array([0.35, 0.1, 0.0])
MOBILE = ExhaustiveConfiguration(
    spacing=0.5, headings=1, offset=0.08, polished=3, population=10, iterations=10
)


@pytest.fixture(scope="module")
def sliding() -> CagingProblem:
    field = make_field("table", "mobile_franka_capsules", resolution=49, spacing=0.3, threads=1)
    return CagingProblem("mobile_franka_capsules", "circle_119", ROUND, field, threads=1)


def test_with_a_sliding_base_the_grid_of_values_is_what_the_problem_measures(sliding):
    outer = outer_postures(sliding, 3, 0.3)
    inner = inner_postures(sliding, 0.5)[::9]
    values = MOBILE._values(sliding, outer, inner, -np.inf)
    q = np.array([[np.append(place, posture) for place in outer] for posture in inner])  # (B, H, 5)
    judged = sliding.measure(q.reshape(-1, 5))
    allowed = (judged.phi >= 0).all(axis=1).reshape(values.shape)
    np.testing.assert_array_equal(np.isfinite(values), allowed)
    assert 100 < allowed.sum() < allowed.size
    np.testing.assert_allclose(
        values[allowed], judged.escape_time.reshape(values.shape)[allowed], rtol=1e-9
    )


def test_with_a_sliding_base_no_search_finds_a_better_posture(sliding):
    found = MOBILE.solve(sliding)
    search = CmaEsConfiguration(
        population=20, iterations=30, restarts=1, sigma=0.2, guesses=500, kind="curled"
    )
    nearby = search.solve(sliding, start=np.array([0.2, 0.1, 0.0, -2.0, 1.0]))
    assert found.feasible and nearby.feasible and found.escape_time >= nearby.escape_time
    # of that place without an arm
    free = (1.0 - np.hypot(*(ROUND[:2] - found.posture[:2]))) / sliding.field.u_bar
    assert found.escape_time > free


def test_places_headings_and_inner_postures_cover_the_workspace(sliding):
    outer = outer_postures(sliding, 5, 0.08)
    robot = get_robot(sliding.robot)
    away = outer[:, :2] - ROUND[:2]
    assert np.hypot(*away.T).max() < robot.workspace_radius
    rng = np.random.default_rng(0)
    angle = rng.uniform(0, 2 * np.pi, 500)
    radius = robot.workspace_radius * np.sqrt(rng.uniform(0, 1, 500))
    bases = radius[:, None] * np.column_stack([np.cos(angle), np.sin(angle)])
    gaps = np.hypot(*(bases[:, None] - away[::5]).transpose(2, 0, 1)).min(axis=1)
    inside = radius < robot.workspace_radius - 0.08
    assert gaps[inside].max() <= 0.08 / np.sqrt(2) + 1e-12 and gaps.max() < 0.08 * np.sqrt(2)
    for place in range(0, len(outer), 5):  # every place with every heading
        assert (outer[place : place + 5, :2] == outer[place, :2]).all()
        np.testing.assert_allclose(
            outer[place : place + 5, 2], np.linspace(sliding.lower[2], sliding.upper[2], 5)
        )
    inner = inner_postures(sliding, 0.5)
    for joint in range(2):
        values = np.unique(inner[:, joint])
        assert values[0] == sliding.lower[3 + joint] and values[-1] == sliding.upper[3 + joint]
        assert np.diff(values).max() <= 0.5
    assert len(inner) == np.prod([len(np.unique(column)) for column in inner.T])

"""Exhaustive search: it sees what the problem sees, at every heading, and beats random postures."""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.field import make_field
from planners import CagingProblem, ExhaustiveConfiguration
from planners.configuration import draw_postures
from planners.exhaustive import inner_postures, outer_postures

POSE = np.array([0.05, 0.22, 0.4])
SEARCH = ExhaustiveConfiguration(spacing=0.3, headings=40, polished=3, population=10, iterations=10)


@pytest.fixture(scope="module")
def problem() -> CagingProblem:
    field = make_field("table", "franka_capsules", resolution=49, spacing=0.15, threads=1)
    return CagingProblem("franka_capsules", "paper_pack", POSE, field, threads=1)


def test_the_grid_of_values_is_what_the_problem_measures(problem):
    heads, inner = outer_postures(problem, SEARCH.headings, SEARCH.offset), inner_postures(problem, SEARCH.spacing)
    values = SEARCH._values(problem, heads, inner[::7], -np.inf)
    q = np.array([[np.append(head, posture) for head in heads] for posture in inner[::7]])  # (B, H, 3)
    judged = problem.measure(q.reshape(-1, 3))
    allowed = (judged.phi >= 0).all(axis=1).reshape(values.shape)
    np.testing.assert_array_equal(np.isfinite(values), allowed)
    assert 100 < allowed.sum() < allowed.size
    np.testing.assert_allclose(values[allowed], judged.escape_time.reshape(values.shape)[allowed], rtol=1e-9)


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
    ("choice", "name"), [({"spacing": 0.0}, "spacing"), ({"headings": 0}, "headings"), ({"polished": 1.5}, "polished")]
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

"""What every planner in the table does."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from piec_envs import InvalidParameterError, UnknownNameError
from planners import PLANNERS, Plan
from planners.table import planner_class

PUSH = "piec_envs/PlanarArmPush-v0"
MOBILE = "piec_envs/MobileFrankaPush-v0"
# For each planner small settings, an environment for it, keyword arguments, and one that does not
# fit, if any.
SMALL = {
    "cma-es": (
        {
            "population": 6,
            "iterations": 3,
            "restarts": 2,
            "screening": 1,
            "survivors": 1,
            "robust_iterations": 1,
            "robust_samples": 2,
            "start": "rest",
        },
        PUSH,
        {"escape_field": {"name": "grid", "resolution": 16}, "escape_every": 200},
        None,
    ),
    "carry": ({}, MOBILE, {"geometry": "capsules"}, PUSH),
}
BUDGET = {"cma-es": "iterations"}  # settings of which more means a longer search


def planned(name, changes=None, **kwargs):
    settings, env_id, own, _ = SMALL[name]
    return planner_class(name)(**{**settings, **(changes or {})}).plan(
        env_id, 0, False, **{**own, **kwargs}
    )


@pytest.fixture(scope="module", params=PLANNERS)
def made(request):
    return request.param, planned(request.param)


def test_every_planner_is_tried_here():
    assert set(SMALL) == set(PLANNERS)


def test_the_number_of_threads_changes_nothing(made):
    name, plan = made
    other = planned(name, threads=1)
    np.testing.assert_array_equal(other.path, plan.path)
    assert other.cost == plan.cost and other.nominal == plan.nominal


def test_a_plan_comes_back_from_its_file(made, tmp_path):
    _, plan = made
    back = Plan.load(plan.save(tmp_path / "plan.npz"))
    np.testing.assert_array_equal(back.path, plan.path)
    np.testing.assert_array_equal(back.via_points, plan.via_points)
    assert (back.cost, back.nominal, back.env_kwargs) == (plan.cost, plan.nominal, plan.env_kwargs)


@pytest.mark.parametrize("name", PLANNERS)
def test_what_it_cannot_plan_for_is_refused(name):
    settings, _, _, misfit = SMALL[name]
    planner = planner_class(name)(**settings)
    with pytest.raises(UnknownNameError):
        planner.plan("piec_envs/Nothing-v0", 0, False)
    with pytest.raises(UnknownNameError):
        planner.plan("piec_envs/PlanarArmCage-v0", 0, False)
    if misfit:
        with pytest.raises(InvalidParameterError):
            planner.plan(misfit, 0, False)


@pytest.mark.parametrize("name", BUDGET)
def test_a_search_is_better_than_its_first_guess_and_not_worse_with_twice_the_budget(name):
    """Without noise and restarts a longer search continues a shorter one, whose best it keeps."""
    alone = {"restarts": 1, "robust_iterations": 0}
    first, short, long = (
        planned(name, {**alone, BUDGET[name]: count, "sigma": sigma}).cost
        for count, sigma in ((1, 1e-9), (4, 0.2), (8, 0.2))
    )
    assert short < first and long <= short * (1 + 1e-9)


@pytest.mark.parametrize("name", PLANNERS)
def test_planners_are_dataclasses_with_defaults(name):
    kind = planner_class(name)
    assert dataclasses.is_dataclass(kind) and kind() == kind()

"""Via points, objectives, the enclosing posture and a small run of the planner."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from piec_envs import Model
from piec_envs.env.makers import make_model, make_setup
from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.escape.field import make_field
from piec_envs.model.caging_problem import CagingProblem
from piec_envs.model.task import GOAL_RADIUS
from planners import CmaEsPlanner, Plan
from planners.base import nominal_start, realised_plan
from planners.cma_es import disturbed_samples
from planners.cma_es_configuration import REACHABLE, enclosing_posture
from planners.objectives import MISS_MARGIN, OBJECTIVES, PathCost, crossing
from planners.strategy import make_strategy
from planners.via_points import ViaPointTrajectory

PUSH = "piec_envs/PlanarArmPush-v0"
SMALL = {
    "population": 6,
    "iterations": 3,
    "restarts": 2,
    "survivors": 1,
    "screening": 1,
    "robust_iterations": 1,
}

points = hnp.arrays(float, (5, 4), elements=st.floats(-2.5, 2.5))


@given(via=points)
def test_trajectory_passes_its_points_and_rests_at_both_ends(via):
    trajectory = ViaPointTrajectory(5, 1000)
    start = np.array([0.3, -0.2, 0.1, 0.0])
    path = np.vstack([start, trajectory.path(start, via)])
    np.testing.assert_allclose(path[200::200], via, atol=1e-9)
    scale = 1 + np.abs(via).max()
    assert np.abs(path[1] - path[0]).max() < 1e-3 * scale
    assert np.abs(path[-1] - path[-2]).max() < 1e-3 * scale


def test_trajectory_has_the_least_squared_acceleration():
    """Any bump that keeps the via points and the rest at both ends costs more."""
    trajectory = ViaPointTrajectory(5, 1000)
    path = np.concatenate(
        [[0.0], trajectory.path(np.zeros(1), np.array([[0.5], [0.2], [1.0], [0.3], [0.4]]))[:, 0]]
    )
    t = np.arange(1001)
    bump = np.sin(np.pi * t / 200) ** 2 * np.sin(np.pi * t / 1000)
    least = (np.diff(path, 2) ** 2).sum()
    for size in (-0.1, -0.01, 0.01, 0.1):
        assert (np.diff(path + size * bump, 2) ** 2).sum() > least


@pytest.fixture(scope="module")
def model():
    return make_model(PUSH, escape_field=None)


def test_crossing_is_zero_for_a_free_arm_and_positive_for_a_knot(model):
    free = np.zeros((1, 100, 4))
    knot = np.tile([0.0, 2.5, 2.5, 2.5], (1, 100, 1))
    assert crossing(model, free)[0] == 0
    assert crossing(model, knot)[0] > 0.1


def test_disturbed_cost_without_disturbance_is_the_nominal_one_but_for_the_margin(model):
    cost = PathCost(model, model.reset(0))
    # touches nothing
    path = np.linspace(0, 1, 1000)[None, :, None] * np.array([-1.5, 0.5, 0.5, 0.5])
    end = model.rollout(model.reset(0), path, absolute=True).column("goal_distance")[0, -1]
    margin = model.weights.miss * (end - (GOAL_RADIUS - MISS_MARGIN))
    np.testing.assert_allclose(
        cost.disturbed(path, model.reset(0)), cost.nominal(path) + margin, rtol=1e-9
    )


def test_enclosing_posture_holds_the_object(model):
    field = make_field("grid", "planar_arm", resolution=32)
    pose = np.array([-0.3, 0.4, 0.0])
    posture = enclosing_posture(model.setup, field, pose, seed=(0, 0), curl=1.0)
    problem = CagingProblem("planar_arm", "circle", pose, field, clearance=REACHABLE)
    judged = problem.measure(posture[None])
    assert judged.feasible[0] and (posture[1:] > 0).all()
    assert judged.value[0] > 2 * (1.4 - 0.5) / 0.05  # at least twice the time of an empty workspace
    again = enclosing_posture(model.setup, field, pose, seed=(0, 0), curl=1.0)
    np.testing.assert_array_equal(posture, again)


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_small_plan_is_deterministic_and_executable(objective):
    planner = CmaEsPlanner(objective=objective, escape_every=200, start="rest", **SMALL)
    plan, again = (planner.plan(PUSH, seed=3, progress=False) for _ in range(2))
    np.testing.assert_array_equal(plan.path, again.path)
    assert plan.cost == again.cost and plan.path.shape == (1001, 4)
    # realised joints: step and released lead
    assert (np.abs(np.diff(plan.path, axis=0)) <= 0.005 + 0.01).all()
    assert plan.nominal["d2g"] == pytest.approx(max(0.0, plan.nominal["goal_distance"] - 0.05))


def test_threads_do_not_change_a_plan():
    planner = CmaEsPlanner(objective="contact", start="rest", **SMALL)
    one, two = (planner.plan(PUSH, seed=1, progress=False, threads=threads) for threads in (1, 2))
    np.testing.assert_array_equal(one.path, two.path)


@pytest.mark.parametrize("objective", ["contact", "adversarial"])
def test_a_plan_costs_what_was_judged_when_it_was_found(objective):
    """What is judged is executed as it is, with an adversary as without one."""
    planner = CmaEsPlanner(objective=objective, escape_every=200, start="rest", **SMALL)
    kwargs = {**planner._nominal_kwargs({}), "escape_field": None}
    if objective == "adversarial":
        kwargs["escape_field"] = {"name": "grid", "resolution": 16}
    model, start, setup = nominal_start(PUSH, kwargs, seed=3)
    samples = disturbed_samples(setup, planner, seed=3)
    cost = PathCost(model, start)
    commanded = np.linspace(0, 1, 1000)[None, :, None] * np.array([1.2, 0.5, 0.5, 0.5])
    realised = cost.realised(commanded)
    motion = model.rollout(start, commanded, absolute=True).motion
    np.testing.assert_array_equal(realised, motion.q_r[:, 1:])  # the prior moves nothing
    plan = realised_plan(
        model,
        start,
        commanded[0],
        lambda path: cost.executed(path, samples),
        env_id=PUSH,
        env_kwargs=kwargs,
        via_points=np.zeros((5, 4)),
        objective=objective,
        preset="default",
        seed=3,
    )
    assert plan.cost == cost.executed(realised, samples)[0]


def test_budgets_count_their_rollouts(monkeypatch):
    """Of every candidate: its nominal ones, and the disturbed ones."""
    rows = []
    run = Model.rollout
    monkeypatch.setattr(
        Model,
        "rollout",
        lambda self, *args, **kw: rows.append(len(args[1])) or run(self, *args, **kw),
    )
    for changes in ({}, {"judge": "commanded", "robust_screening": 0, "robust_share": 1.0}):
        small = {**SMALL, "restarts": 3, "survivors": 2, "robust_iterations": 3}
        planner = CmaEsPlanner(
            objective="contact",
            start="rest",
            robust_samples=4,
            **{"robust_screening": 2, **small, **changes},
        )
        rows.clear()
        planner.plan(PUSH, progress=False)
        around = sum(rows) - planner.rollouts
        # choosing where to go on from, and the plan: a few paths, with all samples
        assert 0 < around <= (2 + 4) * 2 + 8 * (2 + 2 + 4)


def test_searches_do_not_share_random_numbers():
    """Each search draws from its own generator and leaves NumPy's global one alone."""
    np.random.seed(5)  # noqa: NPY002  the state that must not change
    before = np.random.get_state()[1].copy()  # noqa: NPY002
    alone = np.array(make_strategy(np.zeros(3), 1.0, 6, (1, 0)).ask())
    first, second = (make_strategy(np.zeros(3), 1.0, 6, (1, stream)) for stream in (0, 1))
    drawn = np.array(second.ask()), np.array(first.ask())
    np.testing.assert_array_equal(drawn[1], alone)
    assert (drawn[0] != drawn[1]).all()
    np.testing.assert_array_equal(np.random.get_state()[1], before)  # noqa: NPY002


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_polishing_disturbs_every_objective_alike(objective):
    """The planner's own noise knows no adversary, or mode 4 would be polished against a steady
    wind.
    """
    kwargs = (
        {"adversary": OBJECTIVES[objective].adversary} if OBJECTIVES[objective].escape_field else {}
    )
    setup = make_setup(PUSH, escape_field="grid" if kwargs else None, **kwargs)
    planner = CmaEsPlanner(objective=objective, robust_samples=8)
    samples = disturbed_samples(setup, planner, seed=2)
    assert all((params.adversary, params.disturbance) == (0.0, 0.005) for params in samples.params)
    assert samples.rows == 8 and len(set(samples.seed.tolist())) == 8


def test_polishing_draws_what_the_env_draws_and_the_nominal_run_does_not():
    """Each disturbed run has a plant and a start of its own; the model they stand beside is the
    task's.
    """
    drawn = {
        "randomize": {"object": ["circle", "square"], "friction": [0.2, 0.8]},
        "start_noise": [0.01, 0.1],
    }
    model, start, setup = nominal_start(PUSH, {"escape_field": None, **drawn}, seed=3)
    np.testing.assert_array_equal(start.pose[0], model.task.start)
    assert start.params == [model.setup.plant]
    planner = CmaEsPlanner(objective="contact")
    samples, again, other = (disturbed_samples(setup, planner, seed) for seed in (2, 2, 1))
    assert {params.object for params in samples.params} == {"circle", "square"}
    assert len({params.friction for params in samples.params}) == samples.rows
    assert all(
        0.2 <= params.friction <= 0.8 and params.disturbance == 0.005 for params in samples.params
    )
    away = np.abs(samples.pose - model.task.start)
    assert (away > 0).all() and (away <= [0.01, 0.01, 0.1]).all()
    np.testing.assert_array_equal(samples.pose, again.pose)
    assert samples.params == again.params != other.params


def test_plans_for_drawn_plants_differ_and_keep_what_was_drawn(tmp_path):
    """The draws reach the search, and the plan's file says what it was made for."""
    planner = CmaEsPlanner(objective="contact", **SMALL)
    drawn = {"randomize": {"friction": [0.0, 1.0]}, "start_noise": [0.01, 0.1]}
    plain = planner.plan(PUSH, progress=False)
    wide = planner.plan(PUSH, progress=False, **drawn)
    assert plain.cost != wide.cost
    assert Plan.load(wide.save(tmp_path / "plan.npz")).env_kwargs["randomize"] == drawn["randomize"]
    with pytest.raises(UnknownNameError, match="object"):
        planner.plan(PUSH, progress=False, randomize={"object": ["cube"]})
    with pytest.raises(InvalidParameterError, match="objective"):
        planner.plan(PUSH, progress=False, randomize={"adversary": [0.0, 1.0]})


@pytest.mark.parametrize(("share", "flees"), [(None, 1.0), (0.25, 0.25), (0.0, 0.0)])
def test_the_nominal_object_flees_as_fast_as_the_planner_is_told(share, flees):
    planner = CmaEsPlanner(objective="adversarial", adversary=share, **SMALL)
    assert planner.plan(PUSH, progress=False).env_kwargs["adversary"] == flees


@pytest.mark.parametrize(("objective", "share"), [("contact", 0.5), ("adversarial", -0.1)])
def test_an_adversary_that_the_objective_cannot_have_is_refused(objective, share):
    with pytest.raises(InvalidParameterError, match=f"got {share:g} with objective '{objective}'"):
        CmaEsPlanner(objective=objective, adversary=share)


def test_the_quick_budget_is_a_quarter_and_can_be_changed():
    assert CmaEsPlanner.quick().rollouts < CmaEsPlanner().rollouts / 4
    changed = CmaEsPlanner.quick(objective="contact", restarts=1)
    assert (changed.objective, changed.restarts, changed.iterations) == ("contact", 1, 30)


def test_bad_arguments():
    with pytest.raises(UnknownNameError, match="caging, contact, proximity"):
        CmaEsPlanner(objective="cage")
    with pytest.raises(UnknownNameError, match="enclose, rest"):
        CmaEsPlanner(start="home")
    with pytest.raises(UnknownNameError, match="commanded, executed"):
        CmaEsPlanner(judge="planned")
    for choice in (
        {"population": 0},
        {"population": 2.5},
        {"sigma": -1.0},
        {"arrive": 0.0},
        {"screening": -5},
        {"robust_samples": 0},
        {"robust_points": 6},
        {"moving_points": 6},
        {"robust_share": 0.0},
        {"robust_screening": -1},
        {"robust_sigma": np.nan},
    ):
        with pytest.raises(InvalidParameterError, match=next(iter(choice))):
            CmaEsPlanner(**choice)
    with pytest.raises(UnknownNameError, match="default, paper"):
        CmaEsPlanner(preset="journal")
    with pytest.raises(UnknownNameError, match="PlanarArmPush"):
        CmaEsPlanner().plan("CartPole-v1")
    with pytest.raises(InvalidParameterError, match="seed"):
        CmaEsPlanner().plan(PUSH, seed=-1)
    with pytest.raises(InvalidParameterError, match="preset"):
        CmaEsPlanner().plan(PUSH, preset="paper")

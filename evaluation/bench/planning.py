"""Plans, and what the spacing of field evaluations does to their costs."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from evaluation.bench.base import Row, Sizes, make_started, median_seconds, row
from evaluation.rollout import evaluate
from evaluation.studies import PUSH
from evaluation.studies.budget import STUDY_PLANNER
from evaluation.studies.franka_push import ENV as FRANKA_PUSH
from evaluation.studies.franka_push import PLANNER as FRANKA_PLANNER
from piec_envs import MissingDependencyError, choose_field, get_task
from planners import CagingProblem, CmaEsConfiguration, CmaEsPlanner, OpenLoopPolicy, Plan
from planners.via_points import ViaPointTrajectory

DISTURBANCE = "disturbance-5mm"
FRESH = 500_000  # seeds of executions from here on, which no planner has seen
BUDGETS: dict[str, Callable[..., CmaEsPlanner]] = {
    "quick plan, caging": partial(CmaEsPlanner.quick, objective="caging"),
    "default plan, caging": partial(CmaEsPlanner, objective="caging"),
    "default plan, contact": partial(CmaEsPlanner, objective="contact"),
}
ONCE: dict[str, Any] = {"iterations": 1, "population": 2, "restarts": 1, "robust_iterations": 1}


def _warm(planner: CmaEsPlanner) -> CmaEsPlanner:
    """The planner, once kernels and field are loaded."""
    dataclasses.replace(planner, **ONCE).plan(PUSH, progress=False)
    return planner


def _timed_plan(planner: CmaEsPlanner, seed: int, progress: bool) -> tuple[Plan, float]:
    """A plan and how long it took, s."""
    begin = time.perf_counter()
    plan = planner.plan(PUSH, seed=seed, progress=progress)
    return plan, time.perf_counter() - begin


def plan_budgets(sizes: Sizes, progress: bool = False) -> list[Row]:
    """Time and success of what users run, with the quick budget and with the default one.

    Args:
        sizes: how much is measured.
        progress: whether to show progress bars.

    Returns:
        Lines of the table.
    """
    rows = []
    plans, executions = sizes.budgets
    for label, make in BUDGETS.items():
        planner = _warm(make(**dict(sizes.default)))
        times = []
        rates = []
        for seed in range(plans):
            plan, seconds = _timed_plan(planner, seed, progress)
            times.append(seconds)
            done = evaluate(
                OpenLoopPolicy(plan), PUSH, DISTURBANCE, executions, FRESH + 1000 * seed
            )
            rates.append(float(done.success.mean()))
        note = f"{planner.rollouts} trajectories, median of {plans} planner seeds"
        rows.append(row(label, float(np.median(times)), "s", "", note))
        note = (
            f"{min(rates):.2f} to {max(rates):.2f} in {plans} plans of {executions} executions each"
        )
        rows.append(row(f"{label}, success at 5 mm", float(np.mean(rates)), "", "", note))
    return rows


def one_search(sizes: Sizes, progress: bool = False) -> list[Row]:
    """One search with two objectives, and what a field on every k-th step alone does to its costs.

    Args:
        sizes: how much is measured.
        progress: whether to show progress bars.

    Returns:
        Lines of the table.
    """
    rows = []
    plans = {}
    chosen = dict(sizes.planner)
    for objective, wanted in (("contact", "at most 10"), ("caging", "at most 15")):
        every = {"escape_every": 1} if objective == "caging" else {}
        planner = CmaEsPlanner(objective=objective, **{**chosen, **every})
        begin = time.perf_counter()
        plans[objective] = planner.plan(PUSH, seed=0, progress=progress)
        note = (
            f"{planner.iterations} iterations x {planner.population} trajectories x "
            f"{plans[objective].horizon} steps"
        )
        if objective == "caging":
            note += f", field {plans[objective].env_kwargs['escape_field']} at every step"
        rows.append(row(f"one search, {objective}", time.perf_counter() - begin, "s", wanted, note))
    k = CmaEsPlanner().escape_every
    rank = rank_correlation(plans["caging"], k, sizes.plans)
    note = f"Spearman, k = {k} against k = 1, {sizes.plans} plans around the caging plan"
    return [*rows, row("rank of plan costs", rank, "", "at least 0.99", note)]


def franka_plan(sizes: Sizes, progress: bool = False) -> list[Row]:
    """One search for a caging plan on the mobile Franka, with the budget of its study.

    Args:
        sizes: how much is measured.
        progress: whether to show progress bars.

    Returns:
        One line of the table, without a result where the package with the meshes is missing.
    """
    planner = CmaEsPlanner(**{**STUDY_PLANNER, **FRANKA_PLANNER, **dict(sizes.planner)})
    label = "one search, mobile Franka, caging"
    wanted = "at most 60"
    try:
        # solved, or read from the cache, before the clock
        choose_field("table", get_task("mobile_franka_push").robot)
        begin = time.perf_counter()
        planner.plan(FRANKA_PUSH, seed=0, progress=progress)
    except MissingDependencyError as error:
        return [{**row(label, np.nan, "s"), "note": str(error)}]
    return [row(label, time.perf_counter() - begin, "s", wanted, "table field on every 5th step")]


def static_caging(sizes: Sizes) -> list[Row]:
    """One search of CMA-ES for a posture that encloses three discs, with the robot's
    default field.
    """
    field = choose_field("auto", "planar_arm")
    problem = CagingProblem("planar_arm", "three_discs", np.array([0.25, 0.15, 0.0]), field)
    search = CmaEsConfiguration()
    seconds = median_seconds(partial(search.solve, problem, 0), sizes.repeats)
    note = f"{search.iterations} iterations x {search.population} postures, field {field.name}"
    return [row("static caging, CMA-ES", seconds, "s", "at most 0.3", note)]


def rank_correlation(plan: Plan, k: int, count: int) -> float:
    """Rank correlation of costs with the field on every k-th step and on every step.

    Args:
        plan: with objective "caging".
        k: steps between two evaluations of the field.
        count: plans drawn around this one, from 0.02 to 0.3 rad away at each via point.

    Returns:
        Spearman's rank correlation, in [-1, 1].
    """
    from scipy.stats import spearmanr

    spread = np.geomspace(0.02, 0.3, count)[:, None, None]
    shift = spread * np.random.default_rng(0).standard_normal((count, *plan.via_points.shape))
    costs = []
    for every in (k, 1):
        model, start = make_started(**{**plan.env_kwargs, "escape_every": every})
        robot = model.robot
        lower = robot.joint_array("lower")
        upper = robot.joint_array("upper")
        via = np.clip(plan.via_points + shift, lower, upper)
        path = ViaPointTrajectory(len(plan.via_points), plan.horizon).path(robot.home, via)
        costs.append(model.rollout(start, np.clip(path, lower, upper), absolute=True).cost)
    return float(spearmanr(costs[0], costs[1]).statistic)

"""Full plans, and what the spacing of field evaluations does to their costs."""

from __future__ import annotations

import time

import numpy as np

from evaluation.bench.base import Row, Sizes, make_batch, row
from evaluation.studies import PUSH
from planners import CmaEsPlanner, Plan
from planners.via_points import ViaPointTrajectory


def full_plans(sizes: Sizes, progress: bool = False) -> list[Row]:
    """A full plan with two objectives, and what evaluating the field on every k-th step does to its costs."""
    rows, plans = [], {}
    chosen = dict(sizes.planner)
    for objective, wanted in (("contact", "at most 10"), ("caging", "at most 90")):
        planner = CmaEsPlanner(objective=objective, **chosen)
        begin = time.perf_counter()
        plans[objective] = planner.plan(PUSH, seed=0, progress=progress)
        note = f"{planner.iterations} iterations x {planner.population} trajectories x {plans[objective].horizon} steps"
        rows.append(row(f"plan, {objective}", time.perf_counter() - begin, "s", wanted, note))
    k = planner.escape_every
    rank = rank_correlation(plans["caging"], k, sizes.plans)
    note = f"Spearman, k = {k} against k = 1, {sizes.plans} plans around the caging plan"
    return [*rows, row("rank of plan costs", rank, "", "at least 0.99", note)]


def rank_correlation(plan: Plan, k: int, count: int) -> float:
    """Rank correlation of costs with the field on every k-th step and on every step.

    Args:
        plan: with objective "caging".
        k: steps between two evaluations of the field.
        count: plans drawn around this one, from 0.02 to 0.3 rad away at each via point.
    """
    from scipy.stats import spearmanr

    spread = np.geomspace(0.02, 0.3, count)[:, None, None]
    shift = spread * np.random.default_rng(0).standard_normal((count, *plan.via_points.shape))
    costs = []
    for every in (k, 1):
        batch = make_batch(**{**plan.env_kwargs, "escape_every": every})
        lower, upper = batch.robot.joint_array("lower"), batch.robot.joint_array("upper")
        via = np.clip(plan.via_points + shift, lower, upper)
        path = ViaPointTrajectory(len(plan.via_points), plan.horizon).path(batch.robot.home, via)
        costs.append(batch.rollout(batch.state, np.clip(path, lower, upper), absolute=True).cost)
    return float(spearmanr(costs[0], costs[1]).statistic)

"""What is computed of every state: the measures, stage cost included, and the observation."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.kernels import batch_kernel
from piec_envs.model.setup import Setup
from piec_envs.model.task import GOAL_RADIUS, PAPER_REFERENCE_POINTS, PRIORS, CostWeights
from piec_envs.model.terms import (
    COS_Q,
    GOAL,
    JOINT_BOUND,
    MEASURE_COLUMNS,
    OBJECT,
    POSITION_BOUND,
    Q_CMD,
    Q_R,
    REFERENCE,
    SIN_Q,
    TIME,
    Layout,
)
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot

_CAGING, _CONTACT, _PROXIMITY = (PRIORS.index(name) for name in ("caging", "contact", "proximity"))
_GOAL_DISTANCE = MEASURE_COLUMNS["goal_distance"]
_D2G = MEASURE_COLUMNS["d2g"]
_MIN_DISTANCE = MEASURE_COLUMNS["min_distance"]
_MEAN_DISTANCE = MEASURE_COLUMNS["mean_distance"]
_PENETRATION = MEASURE_COLUMNS["penetration"]
_TRACKING_ERROR = MEASURE_COLUMNS["tracking_error"]
_TASK, _COMMAND, _PRIOR, _COST = (
    MEASURE_COLUMNS[name] for name in ("cost_task", "cost_command", "cost_prior", "cost")
)


class Yardstick(NamedTuple):
    """What states are measured by and observed with; `make_yardstick` makes it."""

    prior: int  # index into PRIORS, or -1 for none
    weights: CostWeights  # of the stage cost
    goal: np.ndarray  # (2,) m
    reference: np.ndarray  # (M, 2) m; no rows for a goal task
    horizon: int  # time index of the last state
    speed_limit: np.ndarray  # (n,) rad/s or m/s
    lower: np.ndarray  # (n,) joint limits
    upper: np.ndarray  # (n,)
    base: int  # leading joints that slide the base along x and y, 0 or 2
    at: np.ndarray  # (terms,) first entry of each term of TERMS, -1 where it is left out


def make_yardstick(setup: Setup, layout: Layout) -> Yardstick:
    """What the states of a model are measured by and observed with.

    Args:
        setup: of the model.
        layout: of its observations.

    Returns:
        The numbers for the kernels below.
    """
    robot = pack_robot(setup.robot)
    return Yardstick(
        prior=setup.prior,
        weights=setup.weights,
        goal=np.asarray(setup.task.goal, dtype=float),
        reference=setup.task.reference,
        horizon=setup.task.horizon,
        speed_limit=robot.speed_limit,
        lower=robot.lower,
        upper=robot.upper,
        base=get_robot(setup.robot).base_dof,
        at=layout.offsets,
    )


@batch_kernel
def measure_rows(lo, hi, held, first_step, pose, distance, actions, caging, measures):
    """Distances and stage-cost terms of the states of a motion.

    Args:
        lo, hi: row range.
        held: a `Yardstick`, held.
        first_step: time index of the motion's first state, shape (B,).
        pose: shape (B, T, 3).
        distance: signed distance of each link to the object, shape (B, T, links), m.
        actions: the actions between the states, shape (B, T - 1, n); the first state has none.
        caging: shape (B, T).
        measures: output, shape (B, T, len(MEASURES)).
    """
    by = held.value
    weights, goal, reference, speed_limit = by.weights, by.goal, by.reference, by.speed_limit
    links, points = distance.shape[2], reference.shape[0]
    for i in range(lo, hi):
        for t in range(pose.shape[1]):
            x, y = pose[i, t, 0], pose[i, t, 1]
            to_goal = np.sqrt((x - goal[0]) ** 2 + (y - goal[1]) ** 2)
            nearest, total = np.inf, 0.0
            for k in range(links):
                nearest = min(nearest, distance[i, t, k])
                total += distance[i, t, k]
            error, task = 0.0, to_goal * to_goal
            if points > 0:
                now = min(first_step[i] + t, points - 1)
                error = np.sqrt((x - reference[now, 0]) ** 2 + (y - reference[now, 1]) ** 2)
                task = error
                if weights.shortest:
                    task = np.inf
                    for m in range(PAPER_REFERENCE_POINTS):
                        p = m * (points - 1) // (PAPER_REFERENCE_POINTS - 1)
                        task = min(
                            task, np.sqrt((x - reference[p, 0]) ** 2 + (y - reference[p, 1]) ** 2)
                        )
            command = 0.0
            if t > 0:
                for j in range(speed_limit.shape[0]):
                    command += (actions[i, t - 1, j] * speed_limit[j]) ** 2
            hint = 0.0
            if by.prior == _CAGING:
                saturated = min(caging[i, t], weights.saturation)
                excess = caging[i, t] - saturated
                hint = -(saturated + (0.1 * excess if excess > 0.0 else 0.0))
            elif by.prior == _CONTACT:
                hint = nearest
            elif by.prior == _PROXIMITY:
                hint = total / links
            row = measures[i, t]
            row[_GOAL_DISTANCE], row[_D2G] = to_goal, max(0.0, to_goal - GOAL_RADIUS)
            row[_MIN_DISTANCE], row[_MEAN_DISTANCE] = nearest, total / links
            row[_PENETRATION], row[_TRACKING_ERROR] = max(0.0, -nearest), error
            row[_TASK], row[_COMMAND], row[_PRIOR] = task, command, hint
            row[_COST] = weights.task * task + weights.command * command + weights.prior * hint
            if first_step[i] + t == by.horizon:
                row[_COST] += weights.miss * row[_D2G]


@batch_kernel
def observe_rows(lo, hi, held, q_r, q_cmd, pose, step, observation):
    """Write the observations of rows lo to hi - 1.

    Args:
        lo, hi: row range.
        held: a `Yardstick`, held.
        q_r, q_cmd: shape (B, n).
        pose: shape (B, 3).
        step: shape (B,).
        observation: output, shape (B, size), as `observation_layout` says.
    """
    by = held.value
    at, goal, reference, base = by.at, by.goal, by.reference, by.base
    n, last = q_r.shape[1], reference.shape[0] - 1
    for i in range(lo, hi):
        row = observation[i]
        for j in range(n - base):
            row[at[COS_Q] + j], row[at[SIN_Q] + j] = (
                np.cos(q_r[i, base + j]),
                np.sin(q_r[i, base + j]),
            )
        for j in range(n):
            middle, half = 0.5 * (by.upper[j] + by.lower[j]), 0.5 * (by.upper[j] - by.lower[j])
            row[at[Q_R] + j] = min(max((q_r[i, j] - middle) / half, -JOINT_BOUND), JOINT_BOUND)
            row[at[Q_CMD] + j] = min(max((q_cmd[i, j] - middle) / half, -JOINT_BOUND), JOINT_BOUND)
        x = min(max(pose[i, 0], -POSITION_BOUND), POSITION_BOUND)
        y = min(max(pose[i, 1], -POSITION_BOUND), POSITION_BOUND)
        k = at[OBJECT]
        row[k], row[k + 1], row[k + 2], row[k + 3] = x, y, np.cos(pose[i, 2]), np.sin(pose[i, 2])
        if base > 0:
            row[k] -= min(max(q_r[i, 0], -POSITION_BOUND), POSITION_BOUND)
            row[k + 1] -= min(max(q_r[i, 1], -POSITION_BOUND), POSITION_BOUND)
        k = at[GOAL]
        row[k], row[k + 1] = goal[0] - x, goal[1] - y
        k = at[REFERENCE]
        if k >= 0:
            now = min(step[i] + 1, last)
            row[k], row[k + 1] = reference[now, 0] - x, reference[now, 1] - y
        row[at[TIME]] = min(step[i] / by.horizon, 1.0)

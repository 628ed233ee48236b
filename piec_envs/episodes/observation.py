"""Observations: what each entry means, and the kernel that writes them."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.base import POSITION_LIMIT
from piec_envs.kernels import batch_kernel
from piec_envs.world.robots import Robot

POSITION_BOUND = POSITION_LIMIT  # m; positions are clipped here so that the space is bounded
JOINT_BOUND = 1.5  # joint positions over their limits; a pressed joint can pass its limit a little


def observation_layout(robot: Robot, tracking: bool) -> dict[str, slice]:
    """Names and places of the entries of an observation.

    Args:
        robot: the robot.
        tracking: whether the task has a reference.

    Returns:
        For each part its slice, in order.
    """
    n, turning = robot.dof, robot.dof - robot.base_dof
    sizes = {
        "cos_q": turning,
        "sin_q": turning,
        "q_r": n,  # over the limits: -1 is the lower, 1 the upper one
        "q_cmd": n,  # likewise
        "object": 4,  # x, y from the base, cos, sin
        "goal": 2,  # goal minus object, m
        "reference": 2 if tracking else 0,  # reference of the next step minus object, m
        "time": 1,  # step over horizon
    }
    ends = np.cumsum(list(sizes.values()))
    return {
        name: slice(int(end - size), int(end)) for (name, size), end in zip(sizes.items(), ends, strict=True) if size
    }


def observation_bound(robot: Robot, tracking: bool) -> np.ndarray:
    """Largest absolute value of each entry of an observation."""
    layout = observation_layout(robot, tracking)
    bound = np.ones(layout["time"].stop)
    for name in ("q_r", "q_cmd"):
        bound[layout[name]] = JOINT_BOUND
    bound[layout["object"]][:2] = POSITION_BOUND * (2 if robot.base_dof else 1)
    for name in ("goal", "reference"):
        if name in layout:
            bound[layout[name]] = 2 * POSITION_BOUND
    return bound


@batch_kernel
def observe_rows(lo, hi, limits, goal, reference, horizon, base, q_r, q_cmd, pose, step, observation):
    """Write the observations of rows lo to hi - 1.

    Args:
        lo, hi: row range.
        limits: lower and upper joint limits, each of shape (n,).
        goal: shape (2,), m.
        reference: shape (M, 2), m; no rows for a goal task.
        horizon: steps of an episode.
        base: number of leading joints that slide the base along x and y, 0 or 2.
        q_r, q_cmd: shape (B, n).
        pose: shape (B, 3).
        step: shape (B,).
        observation: output, shape (B, size), as `observation_layout` says.
    """
    n, points = q_r.shape[1], reference.shape[0]
    for i in range(lo, hi):
        row, turning = observation[i], n - base
        for j in range(turning):
            row[j], row[turning + j] = np.cos(q_r[i, base + j]), np.sin(q_r[i, base + j])
        k = 2 * turning
        for j in range(n):
            middle, half = 0.5 * (limits[1][j] + limits[0][j]), 0.5 * (limits[1][j] - limits[0][j])
            row[k + j] = min(max((q_r[i, j] - middle) / half, -JOINT_BOUND), JOINT_BOUND)
            row[k + n + j] = min(max((q_cmd[i, j] - middle) / half, -JOINT_BOUND), JOINT_BOUND)
        x = min(max(pose[i, 0], -POSITION_BOUND), POSITION_BOUND)
        y = min(max(pose[i, 1], -POSITION_BOUND), POSITION_BOUND)
        k += 2 * n
        row[k], row[k + 1], row[k + 2], row[k + 3] = x, y, np.cos(pose[i, 2]), np.sin(pose[i, 2])
        if base > 0:
            row[k] -= min(max(q_r[i, 0], -POSITION_BOUND), POSITION_BOUND)
            row[k + 1] -= min(max(q_r[i, 1], -POSITION_BOUND), POSITION_BOUND)
        row[k + 4], row[k + 5] = goal[0] - x, goal[1] - y
        k += 6
        if points > 0:
            now = min(step[i] + 1, points - 1)
            row[k], row[k + 1] = reference[now, 0] - x, reference[now, 1] - y
            k += 2
        row[k] = min(step[i] / horizon, 1.0)

"""Where the arm stands when an episode of motion begins: the table of start postures.

They solve static problems, which the study `franka-starts` states and solves again.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib.resources import files

import numpy as np

from piec_envs.errors import InvalidParameterError, as_floats, check_name
from piec_envs.world.robots import get_robot

HOME = "home"  # the robot's own


@cache
def start_table() -> Mapping[str, Mapping[str, Sequence[float]]]:
    """The table: from the robot's name to names and joint positions, rad and m."""
    return json.loads((files("piec_envs") / "assets" / "starts.json").read_text())


def start_names(robot_name: str) -> tuple[str, ...]:
    """Names of the start postures of a robot; the first one is the default."""
    return (*start_table().get(robot_name, {}), HOME)


def checked_start(start: str | Sequence[float], robot_name: str) -> str | tuple[float, ...]:
    """A `start` argument, validated, with "auto" replaced by what it stands for.

    Args:
        start: a name, "auto", or joint positions, rad or m.
        robot_name: row of the table of robots.

    Returns:
        A name of the table, or joint positions.

    Raises:
        UnknownNameError: for a name that the robot does not have.
        InvalidParameterError: for joint positions of the wrong number, not finite or beyond the
            limits.
    """
    if isinstance(start, str):
        names = start_names(robot_name)
        check_name(f"start of {robot_name}", start, ("auto", *names))
        return names[0] if start == "auto" else start
    robot = get_robot(robot_name)
    lower = robot.joint_array("lower")
    upper = robot.joint_array("upper")
    q = as_floats("start (a name or joint positions)", start, lower.shape, InvalidParameterError)
    if (q < lower).any() or (q > upper).any():
        raise InvalidParameterError(
            f"start must be within the joint limits {lower.tolist()} to {upper.tolist()}, got "
            f"{q.tolist()}"
        )
    return tuple(q.tolist())


def start_posture(start: str | Sequence[float], robot_name: str) -> np.ndarray:
    """The joint positions that a `start` argument stands for.

    Args:
        start: a name, "auto", or joint positions, rad or m.
        robot_name: row of the table of robots.

    Returns:
        Shape (n,), rad or m.
    """
    start = checked_start(start, robot_name)
    if start == HOME:
        return get_robot(robot_name).home
    return np.array(
        start_table()[robot_name][start] if isinstance(start, str) else start, dtype=float
    )

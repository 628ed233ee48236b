"""Which part of the plane pictures show: squares around a posture, or around a whole episode."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.model.task import Task
from piec_envs.rendering.outlines import arm_outlines, base_position
from piec_envs.world.objects import Object
from piec_envs.world.robots import Robot

# half-width of a close view, over the workspace's radius and over what it shows
LEAST_VIEW = 0.45
VIEW_MARGIN = 1.15
# least distance of a base from the edge of an episode's view, over the workspace's radius
NEAR_EDGE = 0.5


class View(NamedTuple):
    """A square of the plane."""

    centre: np.ndarray  # (2,) m
    half: float  # half of its width, m


def close_view(robot: Robot, q: np.ndarray, item: Object, pose: np.ndarray) -> View:
    """A square around a robot and an object.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        item: the object.
        pose: its x, y, angle, shape (3,), m, rad.

    Returns:
        The square.
    """
    around = pose[:2] + item.bounding_radius * np.array([[-1.0, -1.0], [1.0, 1.0]])
    corners = np.concatenate([*arm_outlines(robot, q), around])
    low = corners.min(axis=0)
    high = corners.max(axis=0)
    half = max(LEAST_VIEW * robot.workspace_radius, VIEW_MARGIN * float((high - low).max()) / 2)
    return View(0.5 * (low + high), half)


def episode_view(robot: Robot, q: np.ndarray, task: Task) -> View:
    """A square that stands still over an episode, so that nothing jumps from frame to frame.

    Around a base that stands it is the workspace. For a base that slides it is what the task names,
    start, goal and reference, with the workspace's radius on all sides, and follows a base that
    comes near its edge.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        task: the task.

    Returns:
        The square.
    """
    base = base_position(robot, q)
    radius = robot.workspace_radius
    if not robot.base_dof:
        return View(base, radius)
    named = np.vstack([task.start[:2], task.goal, task.reference])  # (m, 2)
    low = named.min(axis=0)
    high = named.max(axis=0)
    centre = 0.5 * (low + high)
    half = radius + 0.5 * float((high - low).max())
    room = half - NEAR_EDGE * radius
    offset = base - centre
    return View(centre + offset - np.clip(offset, -room, room), half)

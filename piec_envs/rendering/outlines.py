"""Outlines of a robot in the plane: what pictures draw, and what their frames must hold."""

from __future__ import annotations

import numpy as np

from piec_envs.geometry.batched import robot_frames
from piec_envs.world.robots import Robot
from piec_envs.world.shapes import RoundedPolygon


def base_position(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Centre of the workspace: where the joints that slide have moved the base.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.

    Returns:
        Shape (2,), m.
    """
    return robot_frames(robot.name, q)[robot.base_dof, :2]


def placed(shape: RoundedPolygon, frame: np.ndarray, grow: float = 0.0) -> np.ndarray:
    """Outline of a shape in a frame.

    Args:
        shape: the shape.
        frame: x, y (m), cos and sin of its angle, shape (4,).
        grow: width of the band around it to include, m.

    Returns:
        Points, shape (m, 2), m.
    """
    x, y, c, s = frame
    outline = RoundedPolygon(shape.vertices, shape.radius + grow).outline()
    return outline @ np.array([[c, s], [-s, c]]) + (x, y)


def link_outlines(robot: Robot, q: np.ndarray, grow: float = 0.0) -> list[list[np.ndarray]]:
    """Outlines of every link's shapes in the world.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        grow: width of the band around them to include, m.

    Returns:
        For each link, for each of its shapes, points of shape (m, 2), m.
    """
    frames = robot_frames(robot.name, q)
    return [
        [placed(shape, frames[link.frame], grow) for shape in link.shapes] for link in robot.links
    ]


def scenery_outlines(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Outlines of the parts that touch nothing, those without shapes left out, shape (m, 2) each,
    m.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.

    Returns:
        One outline for each shape.
    """
    frames = robot_frames(robot.name, q)
    return [placed(shape, frames[link.frame]) for link in robot.scenery for shape in link.shapes]


def arm_outlines(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Outlines of all that is drawn of a robot, shape (m, 2) each, m.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.

    Returns:
        One outline for each shape.
    """
    return [
        *(outline for link in link_outlines(robot, q) for outline in link),
        *scenery_outlines(robot, q),
    ]

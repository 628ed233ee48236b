"""Kinematics and distances of many states, for callers that are no kernels."""

from __future__ import annotations

import numpy as np

from piec_envs.errors import InvalidStateError
from piec_envs.geometry.body import (
    link_distances,
    make_placed,
    place_object,
    place_robot,
    self_distance,
)
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel
from piec_envs.parallel import run_rows
from piec_envs.world.packed import pack_robot, pack_scene


@batch_kernel
def _robot_rows(robot, q, frames, vertices):
    """Frames of a robot and vertices of its shapes, shapes (B, n), (B, n + 1, 4) and (B, V, 2)."""
    centres = np.empty_like(robot.shapes.centre)
    for i in range(q.shape[0]):
        link_frames(robot, q[i], frames[i])
        place_shapes(robot.shapes, frames[i], vertices[i], centres)


@batch_kernel
def _self_distance_rows(lo, hi, robot, q, least):
    """Least distance of the arm to itself in rows lo to hi - 1, shapes (B, n) and (B,)."""
    frames = np.empty((robot.stiffness.shape[0] + 1, 4))
    vertices, centres = np.empty_like(robot.shapes.vertices), np.empty_like(robot.shapes.centre)
    for i in range(lo, hi):
        link_frames(robot, q[i], frames)
        place_shapes(robot.shapes, frames, vertices, centres)
        least[i] = self_distance(robot, vertices)


@batch_kernel
def _object_distance_rows(lo, hi, scene, q, pose, distances):
    """Distance of each link to the object in rows lo to hi - 1, shapes (B, n), (B, 3), (B,
    links).
    """
    placed = make_placed(scene)
    for i in range(lo, hi):
        place_robot(scene.robot, q[i], placed)
        place_object(scene.object, pose[i], placed)
        link_distances(scene, placed, distances[i])


def robot_frames(robot_name: str, q_r: np.ndarray) -> np.ndarray:
    """Pose of a robot's base and of the frame after each joint.

    Args:
        robot_name: a row of the table of robots.
        q_r: joint positions, shape (..., n), rad or m.

    Returns:
        x, y (m), cos, sin of each frame, shape (..., n + 1, 4).

    Raises:
        UnknownNameError: if the table has no such row.
        InvalidStateError: if q_r does not have n columns.
    """
    return _placed_robot(robot_name, q_r)[0]


def robot_vertices(robot_name: str, q_r: np.ndarray) -> np.ndarray:
    """World vertices of a robot's shapes, without their rounding.

    Args:
        robot_name: a row of the table of robots.
        q_r: joint positions, shape (..., n), rad or m.

    Returns:
        Shape (..., V, 2), m.

    Raises:
        UnknownNameError: if the table has no such row.
        InvalidStateError: if q_r does not have n columns.
    """
    return _placed_robot(robot_name, q_r)[1]


def _placed_robot(robot_name: str, q_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frames (..., n + 1, 4) and vertices (..., V, 2) of a robot."""
    robot = pack_robot(robot_name)
    q = _columns("q_r", q_r, len(robot.stiffness))
    frames = np.empty((*q.shape[:-1], q.shape[-1] + 1, 4))
    vertices = np.empty((*q.shape[:-1], *robot.shapes.vertices.shape))
    _robot_rows(
        robot,
        q.reshape(-1, q.shape[-1]),
        frames.reshape(-1, *frames.shape[-2:]),
        vertices.reshape(-1, *vertices.shape[-2:]),
    )
    return frames, vertices


def self_distances(robot_name: str, q_r: np.ndarray, threads: int | None = None) -> np.ndarray:
    """Least signed distance between parts of a robot that could collide.

    Args:
        robot_name: a row of the table of robots.
        q_r: joint positions, shape (..., n), rad or m.
        threads: number of threads; None takes all cores.

    Returns:
        Shape (...), m; negative where the robot overlaps itself, inf where no two parts could
        collide.

    Raises:
        UnknownNameError: if the table has no such row.
        InvalidStateError: if q_r does not have n columns.
    """
    robot = pack_robot(robot_name)
    q = _columns("q_r", q_r, len(robot.stiffness))
    rows = q.reshape(-1, q.shape[-1])
    least = np.empty(len(rows))
    run_rows(_self_distance_rows, len(rows), threads, robot, rows, least)
    return least.reshape(q.shape[:-1])


def object_distances(
    robot_name: str,
    object_name: str,
    q_r: np.ndarray,
    pose: np.ndarray,
    threads: int | None = None,
) -> np.ndarray:
    """Signed distance of each link of a robot to an object.

    Args:
        robot_name: a row of the table of robots.
        object_name: a row of the table of objects.
        q_r: joint positions, shape (..., n), rad or m.
        pose: the object's x, y, angle, shape (..., 3), m and rad.
        threads: number of threads; None takes all cores.

    Returns:
        Shape (..., links), m; negative where a link overlaps the object.

    Raises:
        UnknownNameError: if a table has no such row.
        InvalidStateError: if q_r and pose do not have n and three columns, or not the same rows.
    """
    scene = pack_scene(robot_name, object_name)
    q = _columns("q_r", q_r, len(scene.robot.stiffness))
    poses = _columns("pose", pose, 3)
    if q.shape[:-1] != poses.shape[:-1]:
        raise InvalidStateError(
            f"q_r and pose must have the same rows, got {q.shape} and {poses.shape}"
        )
    q = q.reshape(-1, q.shape[-1])
    poses = poses.reshape(-1, 3)
    distances = np.empty((len(q), scene.robot.links))
    run_rows(_object_distance_rows, len(q), threads, scene, q, poses, distances)
    return distances.reshape(*np.shape(q_r)[:-1], scene.robot.links)


def _columns(name: str, value: np.ndarray, count: int) -> np.ndarray:
    """An array whose last axis has that many entries, contiguous."""
    array = np.ascontiguousarray(value, dtype=float)
    if np.ndim(value) == 0 or array.shape[-1] != count:
        raise InvalidStateError(f"{name} must have shape (..., {count}), got {np.shape(value)}")
    return array

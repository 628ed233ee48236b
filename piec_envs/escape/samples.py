"""Random configurations and points on which escape fields are trained and judged."""

from __future__ import annotations

import numpy as np

from piec_envs.errors import check_name
from piec_envs.escape.speed import distance_map
from piec_envs.geometry.batched import robot_vertices, self_distances
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot
from piec_envs.world.robots.robot import LEAST_CURL

CURL = (LEAST_CURL, 2.6)  # rad, how far joints bend in a curled configuration
CLOSING = (0.0, 0.1)  # m, range of the distance between two links in a closing configuration
CURLED_REACH = 0.35  # m, points of the curled set lie this close to the robot's centroid


@batch_kernel
def _distances(robot, q, points, out):
    frames = np.empty((q.shape[1] + 1, 4))
    vertices, centres = np.empty_like(robot.shapes.vertices), np.empty_like(robot.shapes.centre)
    work = np.empty((2, points.shape[1]))
    for row in range(q.shape[0]):
        link_frames(robot, q[row], frames)
        place_shapes(robot.shapes, frames, vertices, centres)
        distance_map(robot.shapes, vertices, points[row, :, 0], points[row, :, 1], out[row], work)


def robot_distance(robot_name: str, points: np.ndarray, q_r: np.ndarray) -> np.ndarray:
    """Signed distance of points to a robot.

    Args:
        robot_name: a row of the table of robots.
        points: shape (B, k, 2) or (k, 2), m.
        q_r: joint positions, shape (B, n) or (n,).

    Returns:
        d, shape (B, k) or (k,), m.
    """
    points = np.asarray(points, dtype=float)
    q = np.asarray(q_r, dtype=float)
    columns = np.ascontiguousarray(points.reshape(-1, *points.shape[-2:]))  # (B, k, 2)
    out = np.empty(columns.shape[:2])
    _distances(
        pack_robot(robot_name), np.ascontiguousarray(q.reshape(len(columns), -1)), columns, out
    )
    return out.reshape(points.shape[:-1])


def draw_configurations(
    robot_name: str, kind: str, rows: int, rng: np.random.Generator
) -> np.ndarray:
    """Random configurations.

    Args:
        robot_name: a row of the table of robots.
        kind: "uniform" within the limits; "curled": all joints but the first bend to one side by
            0.6 to 2.6 rad, as far as the limits allow; "closing": curled, with two links that could
            collide up to 0.1 m apart (of a robot without such links just curled).
        rows: how many.
        rng: source of randomness.

    Returns:
        Joint positions, shape (rows, n), within the limits.

    Raises:
        UnknownNameError: if the kind is not known.
    """
    check_name("kind of configurations", kind, ("uniform", "curled", "closing"))
    if kind == "closing":
        kept = np.empty((0, get_robot(robot_name).dof))
        while len(kept) < rows:
            q = draw_configurations(robot_name, "curled", 2 * rows, rng)
            gap = self_distances(robot_name, q, threads=1)
            if np.isinf(gap).all():
                return q[:rows]
            kept = np.concatenate([kept, q[(gap >= CLOSING[0]) & (gap <= CLOSING[1])]])
        return kept[:rows]
    robot = get_robot(robot_name)
    lower = robot.joint_array("lower")
    upper = robot.joint_array("upper")
    q = rng.uniform(lower, upper, size=(rows, robot.dof))
    if kind == "curled":
        first = robot.base_dof + 1
        straight = robot.straight
        side = rng.choice(robot.curl_sides(), size=(rows, 1))
        bend = side * rng.uniform(*CURL, size=(rows, robot.dof - first))
        q[:, first:] = np.clip(straight[first:] + bend, lower[first:], upper[first:])
    return q


def draw_points(
    robot_name: str,
    kind: str,
    q_r: np.ndarray,
    k: int,
    rng: np.random.Generator,
    clearance: float = 0.05,
) -> np.ndarray:
    """Random points inside the workspace disc and clear of the robot, for robots with a fixed base.

    Args:
        robot_name: a row of the table of robots.
        kind: "uniform" in the disc, or "curled": within 0.35 m of the mean of the robot's vertices.
        q_r: joint positions, shape (B, n).
        k: points per configuration.
        rng: source of randomness.
        clearance: least distance to the robot, m.

    Returns:
        Points, shape (B, k, 2), m.
    """
    radius = get_robot(robot_name).workspace_radius
    points = np.empty((len(q_r), k, 2))
    for row, q in enumerate(q_r):
        centre = np.zeros(2)
        reach = radius
        if kind == "curled":
            centre = robot_vertices(robot_name, q[None])[0].mean(axis=0)
            reach = CURLED_REACH
        kept = np.empty((0, 2))
        while len(kept) < k:
            angle = rng.uniform(0, 2 * np.pi, k)
            r = reach * np.sqrt(rng.uniform(size=k))
            batch = centre + np.column_stack([r * np.cos(angle), r * np.sin(angle)])  # (k, 2)
            clear = (robot_distance(robot_name, batch, q) > clearance) & (
                np.hypot(*batch.T) < radius
            )
            kept = np.concatenate([kept, batch[clear]])
        points[row] = kept[:k]
    return points

"""Where training points come from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.samples import draw_configurations, robot_distance, robot_vertices
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot

AROUND = 0.45  # m, half of the points lie this close to the centroid of the robot
CLOSE = 0.12  # m, and a quarter this close to its surface
MAX_DRAWS = 10_000  # after which there are no such points


def _in_disc(rng: np.random.Generator, centre: np.ndarray, radius: float, k: int) -> np.ndarray:
    """Uniform points around each centre (B, 2), shape (B, k, 2)."""
    angle = rng.uniform(0, 2 * np.pi, (len(centre), k))
    r = radius * np.sqrt(rng.uniform(size=(len(centre), k)))
    return centre[:, None] + np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)


def _near_shapes(
    rng: np.random.Generator, robot_name: str, q: np.ndarray, reach: float, k: int
) -> np.ndarray:
    """Points at up to `reach` from random points of the robot's shapes, shape (B, k, 2)."""
    # (B, V, 2)
    shapes = pack_robot(robot_name).shapes
    vertices = robot_vertices(robot_name, q)
    rows = np.arange(len(q))[:, None]
    shape = rng.integers(len(shapes.radius), size=(len(q), k))
    first = shapes.first[shape]
    count = np.diff(shapes.first)[shape]
    a, b = (
        vertices[rows, first + (rng.uniform(size=shape.shape) * count).astype(int)]
        for _ in range(2)
    )
    core = a + rng.uniform(size=(*shape.shape, 1)) * (b - a)
    angle = rng.uniform(0, 2 * np.pi, shape.shape)
    r = shapes.radius[shape] + reach * rng.uniform(size=shape.shape)
    return core + np.stack([r * np.cos(angle), r * np.sin(angle)], axis=-1)


def _accepted(
    draw: Callable[[np.ndarray, int], np.ndarray],
    good: Callable[[np.ndarray, np.ndarray], np.ndarray],
    rows: int,
    k: int,
) -> np.ndarray:
    """K points of each row that are good, drawn again until there are enough.

    Args:
        draw: (rows, count) -> candidates, shape (len(rows), count, 2).
        good: (rows, candidates) -> which to keep.
        rows: how many.
        k: points per row.

    Raises:
        InvalidParameterError: if hardly any point is good.
    """
    points = np.empty((rows, k, 2))
    have = np.zeros(rows, dtype=int)
    open_rows = np.arange(rows if k else 0)
    for _ in range(MAX_DRAWS):
        if not len(open_rows):
            return points
        candidates = draw(open_rows, 2 * k)
        kept = good(open_rows, candidates)  # (R, 2 k)
        slot = have[open_rows, None] + np.cumsum(kept, axis=1) - 1  # where each kept point goes
        kept &= slot < k
        row, column = np.nonzero(kept)
        points[open_rows[row], slot[row, column]] = candidates[row, column]
        have[open_rows] += kept.sum(axis=1)
        open_rows = open_rows[have[open_rows] < k]
    raise InvalidParameterError(
        "hardly any point of the workspace is at the wanted distance from the robot"
    )


def clear_points(
    robot_name: str,
    q: np.ndarray,
    k: int,
    rng: np.random.Generator,
    low: float,
    high: float = np.inf,
) -> np.ndarray:
    """Points inside the workspace at a distance between `low` and `high` from the robot.

    Args:
        robot_name: a row of the table of robots.
        q: configurations, shape (B, n).
        k: points for each.
        rng: source of randomness.
        low, high: range of the distance, m; a finite `high` draws them around the robot.

    Returns:
        Shape (B, k, 2), m.
    """
    radius = get_robot(robot_name).workspace_radius

    def draw(rows, count):
        """Candidates for some rows."""
        if np.isfinite(high):
            return _near_shapes(rng, robot_name, q[rows], high, count)
        return _in_disc(rng, np.zeros((len(rows), 2)), radius, count)

    def good(rows, points):
        """Which candidates lie in the disc and at a wanted distance from the robot."""
        distance = robot_distance(robot_name, points, q[rows])
        return (
            (distance >= low) & (distance <= high) & (np.hypot(*points.transpose(2, 0, 1)) < radius)
        )

    return _accepted(draw, good, len(q), k)


def around_points(
    robot_name: str, q: np.ndarray, k: int, rng: np.random.Generator, low: float
) -> np.ndarray:
    """Points inside the workspace around the centroid of the robot.

    Args:
        robot_name, q, k, rng: as in `clear_points`.
        low: least distance to the robot, m.

    Returns:
        Shape (B, k, 2), m.

    Raises:
        InvalidParameterError: if hardly any point is good.
    """
    radius = get_robot(robot_name).workspace_radius
    centre = robot_vertices(robot_name, q).mean(axis=1)

    def good(rows, points):
        """Which candidates lie in the disc and at a wanted distance from the robot."""
        distance = robot_distance(robot_name, points, q[rows])
        return (distance >= low) & (np.hypot(*points.transpose(2, 0, 1)) < radius)

    return _accepted(
        lambda rows, count: _in_disc(rng, centre[rows], AROUND, count), good, len(q), k
    )


def training_set(
    robot_name: str, configurations: int, k: int, rng: np.random.Generator
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations and points that a field is fitted on.

    Args:
        robot_name: a row of the table of robots.
        configurations: how many: a third each uniform, curled and closing (see
            `draw_configurations`).
        k: points for each: half around the arm, a quarter close to it, the rest anywhere.
        rng: source of randomness.

    Returns:
        (q, points): shapes (configurations, n) and (configurations, k, 2).
    """
    third = configurations // 3
    counts = {"uniform": third, "curled": third, "closing": configurations - 2 * third}
    q = np.concatenate(
        [draw_configurations(robot_name, kind, count, rng) for kind, count in counts.items()]
    )
    around = k // 2
    close = k // 4
    low = 0.0  # also within the wall, so that the field is known wherever it is drawn
    parts = [
        around_points(robot_name, q, around, rng, low),
        clear_points(robot_name, q, close, rng, low, CLOSE),
        clear_points(robot_name, q, k - around - close, rng, low),
    ]
    return q, np.concatenate(parts, axis=1)

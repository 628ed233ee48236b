"""Targets of the Bellman recipe: straight lines, and descent along the network's own field.

Times are integrals of the true slowness along paths that can be gone, so they bound T from above.
"""

from __future__ import annotations

import numpy as np

from piec_envs.escape.network import NetworkField
from piec_envs.escape.speed import slowness
from piec_envs.escape.training.recipes import Bellman
from piec_envs.geometry.body import least_distance
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel, kernel
from piec_envs.parallel import run_rows
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot

CHUNK = 8192  # points whose candidates are in memory together
# widths 1/s of the sigmoid beyond its middle, where the robot slows nothing down by more than 1e-5
FREE = 12.0
LEAST_STEP = 0.002  # m, with which a line crosses the edge of the wall, where the slowness jumps
BEYOND = 1e-9  # m, by which a line that leads out ends outside the circle, where T = 0


@kernel
def _way_out(x, y, e_x, e_y, radius):
    """Length of the straight line from (x, y) along a unit vector to the circle, m."""
    along = x * e_x + y * e_y
    return max(-along + np.sqrt(max(along * along - (x * x + y * y - radius * radius), 0.0)), 0.0)


@kernel
def _add_time(shapes, speed, placed, start, direction, reach, step):
    """Integral of the slowness along start + s direction for s in reach = (from, to), s.

    Steps are at most `step` long and do not jump over the edge of the wall, since d has slope 1;
    for the same reason one step leads from a free point to the next that may not be free.
    """
    vertices, centres = placed
    s, total, free = reach[0], 0.0, max(speed.d0, speed.tau + FREE / speed.s)
    while s < reach[1]:
        d = least_distance(
            shapes, vertices, centres, start[0] + s * direction[0], start[1] + s * direction[1]
        )
        if d - free > step:
            h = min(d - free, reach[1] - s)
        else:
            h = min(max(abs(d - speed.d0), LEAST_STEP), step, reach[1] - s)
            middle = s + 0.5 * h
            x, y = start[0] + middle * direction[0], start[1] + middle * direction[1]
            d = least_distance(shapes, vertices, centres, x, y)
        total += h * slowness(speed, d)
        s += max(h, BEYOND)
    return total


@batch_kernel
def _straight_lines(lo, hi, robot, speed, disc, q, points, directions, lengths, out):
    """Rows lo to hi: the ends of straight lines, stopped at the circle, and the times to get there.

    Args:
        disc: (number of joints that move the base, radius in m, longest step in m).
        q: configurations, shape (N, n).
        points: shape (N, 2), m.
        directions: unit vectors, shape (N, K, 2).
        lengths: increasing, shape (J,), m.
        out: ends (N, K J, 2), m, and times (N, K J), s.
    """
    base, radius, step = disc
    ends, times = out
    frames, centres = np.empty((q.shape[1] + 1, 4)), np.empty_like(robot.shapes.centre)
    vertices, count = np.empty_like(robot.shapes.vertices), lengths.shape[0]
    for row in range(lo, hi):
        link_frames(robot, q[row], frames)
        place_shapes(robot.shapes, frames, vertices, centres)
        p = points[row]
        for k in range(directions.shape[1]):
            e = directions[row, k]
            out_at = _way_out(p[0] - frames[base, 0], p[1] - frames[base, 1], e[0], e[1], radius)
            s, total = 0.0, 0.0
            for j in range(count):
                target = min(lengths[j], out_at)
                total += _add_time(
                    robot.shapes, speed, (vertices, centres), p, e, (s, target), step
                )
                s = target
                over = s + BEYOND if s >= out_at else s
                ends[row, k * count + j, 0], ends[row, k * count + j, 1] = (
                    p[0] + over * e[0],
                    p[1] + over * e[1],
                )
                times[row, k * count + j] = total


class Paths:
    """Straight lines and descents among the links of one robot.

    Args:
        robot_name: a row of the table of robots.
        field: gives the speed model; the network that looks ahead and descends.
        recipe: lengths and steps.
    """

    def __init__(self, robot_name: str, field: NetworkField, recipe: Bellman):
        robot = get_robot(robot_name)
        self.field = field
        self.recipe = recipe
        self.base = robot.base_dof
        self._robot = pack_robot(robot_name)
        self._speed = field.speed.packed()
        self._radius = float(robot.workspace_radius)
        self._reach = 2 * self._radius + 1.0  # m, longer than any line inside the disc

    def lines(self, q, points, directions, lengths) -> tuple[np.ndarray, np.ndarray]:
        """Ends of straight lines, stopped at the circle, and the times to get there.

        Args:
            q: joint positions, shape (N, n), rad or m.
            points: where the lines begin, shape (N, 2), m.
            directions: unit vectors, shape (N, K, 2).
            lengths: J increasing numbers, m.

        Returns:
            (ends, times): shapes (N, K J, 2), m, and (N, K J), s.
        """
        count = directions.shape[1] * len(lengths)
        out = np.empty((len(q), count, 2)), np.empty((len(q), count))
        disc = self.base, self._radius, self.recipe.line_step
        run_rows(
            _straight_lines,
            len(q),
            self.field.threads,
            self._robot,
            self._speed,
            disc,
            q,
            points,
            directions,
            np.asarray(lengths, dtype=float),
            out,
        )
        return out

    def straight_out(
        self, q: np.ndarray, points: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """Time of the best straight line out.

        Args:
            q: joint positions, shape (N, n), rad or m.
            points: shape (N, 2), m.
            rng: turns the directions that are tried.

        Returns:
            Shape (N,), s.
        """
        directions = even_directions(rng, len(q), self.recipe.first_directions)
        return self.lines(q, points, directions, [self._reach])[1].min(axis=1)

    def look_ahead(self, q: np.ndarray, points: np.ndarray, rng: np.random.Generator) -> np.ndarray:
        """Target of the Bellman recipe; see `Bellman`.

        Args:
            q: joint positions, shape (N, n), rad or m.
            points: shape (N, 2), m.
            rng: turns the directions that are tried.

        Returns:
            Shape (N,), s.
        """
        directions = even_directions(rng, len(q), self.recipe.directions)
        # (N, K J, 2), (N, K J)
        ends, times = self.lines(q, points, directions, self.recipe.lengths)
        value = times + self.field.query(ends, q)
        rows = np.arange(len(q))
        best = value.argmin(axis=1)
        if not self.recipe.descent_step:
            return value[rows, best]
        ends = np.ascontiguousarray(ends[rows, best])
        onward = np.minimum(self.descend(q, ends), self.straight_out(q, ends, rng))
        return np.minimum(times[rows, best] + onward, self.descend(q, points))

    def descend(self, q: np.ndarray, points: np.ndarray) -> np.ndarray:
        """Time of following -grad T of the network to the circle.

        Args:
            q: joint positions, shape (N, n), rad or m.
            points: shape (N, 2), m.

        Returns:
            Shape (N,), s; inf where it does not get out.
        """
        points = points.copy()
        total = np.zeros(len(q))
        rows = np.arange(len(q))
        for _ in range(self.recipe.descent_steps):
            times, slopes = self.field.point_gradients(points[rows, None], q[rows])
            inside = times[:, 0] > 0
            # (R, 1, 2)
            rows = rows[inside]
            slopes = slopes[inside]
            if not len(rows):
                return total
            directions = -slopes / np.maximum(np.linalg.norm(slopes, axis=-1, keepdims=True), 1e-12)
            ends, times = self.lines(q[rows], points[rows], directions, [self.recipe.descent_step])
            points[rows] = ends[:, 0]
            total[rows] = total[rows] + times[:, 0]
        total[rows] = np.inf
        return total


def even_directions(rng: np.random.Generator, rows: int, count: int) -> np.ndarray:
    """Unit vectors, evenly spaced from a random one in each row.

    Args:
        rng: source of randomness.
        rows: how many rows.
        count: directions in each.

    Returns:
        Shape (rows, count, 2).
    """
    angle = rng.uniform(0, 2 * np.pi, (rows, 1)) + 2 * np.pi * np.arange(count) / count
    return np.stack([np.cos(angle), np.sin(angle)], axis=-1)


def bellman_targets(
    robot_name: str,
    recipe: Bellman,
    field: NetworkField,
    first: bool,
    q: np.ndarray,
    points: np.ndarray,
    rng: np.random.Generator,
) -> np.ndarray:
    """Targets of one round.

    Args:
        robot_name: a row of the table of robots.
        recipe: lengths and steps.
        field: the network of the round before; in the first, anything with the speed model.
        first: whether this is round 0.
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        rng: source of randomness.

    Returns:
        T, shape (B, k), s.
    """
    paths = Paths(robot_name, field, recipe)
    targets = np.empty(points.shape[:2])
    per_chunk = max(CHUNK // points.shape[1], 1)
    for lo in range(0, len(q), per_chunk):
        rows = slice(lo, lo + per_chunk)
        some = points[rows].reshape(-1, 2)
        some_q = np.repeat(q[rows], points.shape[1], axis=0)
        find = paths.straight_out if first else paths.look_ahead
        targets[rows] = find(some_q, some, rng).reshape(-1, points.shape[1])
    return targets

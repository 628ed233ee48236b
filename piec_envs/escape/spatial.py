"""The exact escape time around the Panda's bodies in space, in the plane that it moves in.

The distance is that of the robot distance field at the height of the plane. A body is felt as far
as it is away there: it need not cut the plane, and its shadow on the plane is larger than it.
"""

from __future__ import annotations

import numpy as np

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.base import ALL_GRADIENTS, POINT_GRADIENT
from piec_envs.escape.between import Field, point_gradient, value
from piec_envs.escape.disc import Disc, make_scratch
from piec_envs.escape.eikonal import BAND, REACH, solve_measured
from piec_envs.escape.paths import MAX_STEPS_PER_NODE, trace
from piec_envs.escape.speed import PackedSpeed, slowness_slope
from piec_envs.geometry.rdf import panda_distance_field
from piec_envs.geometry.rdf.kernels import arm_distance, arm_slope, joint_slope, make_rdf_scratch
from piec_envs.kernels import batch_kernel, kernel
from piec_envs.parallel import run_rows
from piec_envs.world.packed import PackedShapes
from piec_envs.world.robots.franka import ACTIVE, PLANE, all_joints
from piec_envs.world.robots.panda import body_frames

ROBOTS_IN_SPACE = ("franka",)
_NONE = np.empty(0)
_PAIRS = np.empty((0, 2))
_ROWS = np.empty(0, dtype=np.int64)
NO_SHAPES = PackedShapes(np.zeros(1, dtype=np.int64), _PAIRS, _NONE, _ROWS, _ROWS, _PAIRS, _NONE)


@kernel
def _ridge(rdf, frames, x, y, reach, work):
    """The distance on the middle of a passage within `reach` uphill of a node, or the node's own,
    m.
    """
    d, _, n = arm_slope(rdf, frames, (x, y, PLANE), work)
    rise = np.hypot(n[0], n[1])
    if rise < 1e-6:
        return d
    e_x, e_y = n[0] / rise, n[1] / rise
    up, _, m = arm_slope(rdf, frames, (x + reach * e_x, y + reach * e_y, PLANE), work)
    fall = -(e_x * m[0] + e_y * m[1])
    if fall <= 0.0:
        return d
    return d + rise * min(max((up - d + fall * reach) / (rise + fall), 0.0), reach)


@batch_kernel
def _measure(rdf, frames, d0, disc, near):
    """Distances of the disc's nodes, shape (M + E,), m; beside the middle of a passage as in
    `lift_to_axis`.
    """
    work, reach = make_rdf_scratch(rdf), REACH * disc.h
    for k in range(near.shape[0]):
        near[k] = arm_distance(rdf, frames, (disc.x[k], disc.y[k], PLANE), work)
        if d0 - reach < near[k] < d0 + BAND * disc.h:
            near[k] = _ridge(rdf, frames, disc.x[k], disc.y[k], reach, work)


@batch_kernel
def _solve(rdf, nothing, frames, speed, disc, second_order, scratch):
    """One configuration as a `Field`, which lives in the scratch."""
    _measure(rdf, frames, speed.d0, disc, scratch.near)
    return solve_measured(nothing, speed, disc, second_order, scratch)


@kernel
def _along_path(rdf, frames, speed, path, work, out):
    """dT/dq = integral of kappa'(d) dd/dq along a path (m, 2), shape (n,), s/rad; see `paths`."""
    out[:] = 0.0
    for i in range(path.shape[0] - 1):
        x, y = 0.5 * (path[i, 0] + path[i + 1, 0]), 0.5 * (path[i, 1] + path[i + 1, 1])
        length = np.hypot(path[i + 1, 0] - path[i, 0], path[i + 1, 1] - path[i, 1])
        d, body, n = arm_slope(rdf, frames, (x, y, PLANE), work)
        weight = slowness_slope(speed, d) * length
        for k, j in enumerate(ACTIVE):
            if j < rdf.joints[body]:
                out[k] += weight * joint_slope(frames, j, (x, y, PLANE), n)


@batch_kernel
def _answer(lo, hi, rdf, nothing, speed, disc, plan, frames, points, out):
    """Rows lo to hi: one solve each, then every point of the row.

    Args:
        rdf: a `PackedRdf`.
        nothing: `PackedShapes` of no shape.
        plan: (second_order, level of detail).
        frames: poses of the bodies, shape (B, 11, 4, 4), m.
        points: shape (B, k, 2), m.
        out: T (B, k), dT_dp (B, k, 2) and dT_dq (B, k, n), the latter two as far as the level asks.
    """
    second_order, level = plan
    times, slopes_p, slopes_q = out
    if hi <= lo:
        return
    scratch, work = make_scratch(nothing, 1, disc), make_rdf_scratch(rdf)
    path = np.empty((MAX_STEPS_PER_NODE * disc.axis.shape[0], 2))
    for row in range(lo, hi):
        field = _solve(rdf, nothing, frames[row], speed, disc, second_order, scratch)
        for k in range(points.shape[1]):
            x, y = points[row, k, 0], points[row, k, 1]
            t, e_x, e_y = value(field, x, y)
            times[row, k] = t
            if level >= POINT_GRADIENT:
                slopes_p[row, k] = point_gradient(field, x, y, t, e_x, e_y)
            if level >= ALL_GRADIENTS:
                count = trace(field, x, y, path)
                _along_path(rdf, frames[row], speed, path[:count], work, slopes_q[row, k])


class SpatialDisc:
    """Solves the escape time from the robot distance field.

    Args:
        robot_name: "franka".
        speed: largest speed as a function of the distance.
        disc: the grid.
        second_order: whether second-order marching follows the first-order sweeps.

    Raises:
        InvalidParameterError: for another robot.
    """

    def __init__(self, robot_name: str, speed: PackedSpeed, disc: Disc, second_order: bool):
        if robot_name not in ROBOTS_IN_SPACE:
            raise InvalidParameterError(
                f"the robot {robot_name!r} has no distance field in space; "
                f'distance="rdf" is for: {", ".join(ROBOTS_IN_SPACE)}'
            )
        self._fixed = panda_distance_field().packed, NO_SHAPES
        self._speed = speed
        self._disc = disc
        self._second_order = second_order

    def sample(self, q: np.ndarray) -> Field:
        """One configuration on the grid, from q of shape (n,), rad."""
        scratch = make_scratch(self._fixed[1], 1, self._disc)
        frames = body_frames(all_joints(q))
        return _solve(*self._fixed, frames, self._speed, self._disc, self._second_order, scratch)

    def answer_rows(
        self, level: int, threads: int | None, q: np.ndarray, points: np.ndarray, out: tuple
    ) -> None:
        """Fill `out` with the escape times of a batch, and gradients as far as the level asks.

        Args:
            level: VALUE, POINT_GRADIENT or ALL_GRADIENTS of `piec_envs.escape.base`.
            threads: over the rows; None takes all cores.
            q: joint positions, shape (B, n), rad.
            points: shape (B, k, 2), m.
            out: output, T (B, k), s, dT_dp (B, k, 2), s/m, and dT_dq (B, k, n), s/rad.
        """
        plan = (self._second_order, level)
        frames = body_frames(all_joints(q))
        run_rows(
            _answer,
            len(q),
            threads,
            *self._fixed,
            self._speed,
            self._disc,
            plan,
            frames,
            points,
            out,
        )

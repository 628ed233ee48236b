"""The exact escape time at every node of a table over points and two joints, and between the nodes.

A disc workspace makes the field of a robot whose first turning joint stands at its base depend on
the point turned by -q_1 and on the inner joints alone. The table holds the excess E = T - T_0 over
the straight way, which is 0 wherever nothing is in the way, and is read multi-linearly.

T jumps at the edge of the wall, and points just outside lie in cells with nodes inside it. So the
wall's nodes hold the continuation of the free field on their own side of it instead: the arrival
times of a front that enters the wall at the speed that the law of free space has there.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.escape.base import ALL_GRADIENTS, POINT_GRADIENT
from piec_envs.escape.disc import Disc, make_disc, make_scratch, place_robot
from piec_envs.escape.eikonal import solve_disc
from piec_envs.escape.marching import sort_by_time
from piec_envs.escape.speed import SpeedModel, slowness
from piec_envs.escape.sweeping import FAR
from piec_envs.geometry.kinematics import base_gradient, link_frames
from piec_envs.kernels import batch_kernel, kernel
from piec_envs.parallel import run_rows

STRIDE = 2  # the solver's grid is finer than the table by this factor
ROUNDING = 1e-9  # of a position on an axis, in cells


class PackedTable(NamedTuple):
    """A table for the compiled kernels."""

    excess: np.ndarray  # (A, B, N, N) float32, E by two joints and by y and x, s
    start: float  # coordinate of the first grid line, m
    h: float  # m
    lower: np.ndarray  # (2,) positions of the joints at the first node, rad
    step: np.ndarray  # (2,) rad
    base: int  # leading joints that move the base
    radius: float  # of the workspace, m
    u_bar: float  # m/s


def fine_disc(radius: float, u_bar: float, resolution: int) -> Disc:
    """The solver's grid for a table; every second line of it is one of the table's.

    Args:
        radius: of the workspace, m.
        u_bar: speed in free space, m/s.
        resolution: nodes a side of the table.

    Returns:
        The grid, of 2 (resolution - 1) + 1 nodes a side.

    Raises:
        InvalidParameterError: as `make_disc` does.
    """
    return make_disc(radius, u_bar, STRIDE * (resolution - 1) + 1)


@kernel
def _from_neighbours(a, b, f):
    """T of a node from the lesser neighbour a along one axis and b along the other, f being its
    cost, all s.
    """
    gap = abs(a - b)
    return min(a, b) + f if gap >= f else 0.5 * (a + b + np.sqrt(2.0 * f * f - gap * gap))


@kernel
def _farther(time, distance, n, step):
    """T of the neighbour of node n along one axis that is farther from the robot than n; FAR if
    none is.
    """
    m = n - step if distance[n - step] > distance[n + step] else n + step
    return time[m] if distance[m] > distance[n] else FAR


@batch_kernel
def _continue_into_wall(speed, disc, scratch):
    """Replace T at the nodes inside the wall by the continuation of the free field.

    Going deeper, each node is reached from the neighbours that are farther from the robot, so that
    the two sides of a wall do not mix. Nodes without such neighbours, in pockets, take the least
    way from any.

    Args:
        speed: (`PackedSpeed`, the same without a wall).
        disc: a `Disc`.
        scratch: a `Scratch` after `solve_disc`; `time` is changed, all else is overwritten.
    """
    (walled, free), width, m = speed, disc.axis.shape[0], disc.inside
    time, distance, depth = scratch.time.ravel(), scratch.distance.ravel(), scratch.work[0, :m]
    for k in range(m):
        depth[k] = max(0.0, walled.d0 - scratch.near[k])
        if scratch.near[k] <= walled.d0:
            scratch.cost[k] = slowness(free, scratch.near[k]) * disc.h
            time[disc.node[k]] = FAR
    sort_by_time(depth, scratch.keys[:m], scratch.orders[0, :m], scratch.orders[1, :m])
    left = 0
    for i in range(m):
        k = scratch.orders[0, i]
        n = disc.node[k]
        if scratch.near[k] <= walled.d0:
            a, b = _farther(time, distance, n, 1), _farther(time, distance, n, width)
            time[n] = min(_from_neighbours(a, b, scratch.cost[k]), FAR)
            if time[n] >= FAR:
                scratch.orders[1, left] = k
                left += 1
    changed = left > 0
    while changed:
        changed = False
        for i in range(left):
            k = scratch.orders[1, i]
            n = disc.node[k]
            a, b = min(time[n - 1], time[n + 1]), min(time[n - width], time[n + width])
            t = _from_neighbours(a, b, scratch.cost[k])
            if t < time[n]:
                time[n], changed = t, True


@batch_kernel
def _tabulate(lo, hi, robot, speed, disc, base, q, out):
    """E of configurations lo to hi on the coarse grid, `out` of shape (Q, N, N)."""
    if hi <= lo:
        return
    scratch = make_scratch(robot.shapes, q.shape[1] + 1, disc)
    for row in range(lo, hi):
        place_robot(robot, base, q[row], scratch)
        solve_disc(robot.shapes, speed[0], disc, True, scratch)
        _continue_into_wall(speed, disc, scratch)
        for i in range(out.shape[1]):
            for j in range(out.shape[2]):
                out[row, i, j] = (
                    scratch.time[STRIDE * i, STRIDE * j] - disc.bound[STRIDE * i, STRIDE * j]
                )


def tabulate(robot, speed: SpeedModel, disc: Disc, axes: tuple, threads: int | None) -> np.ndarray:
    """The excess over two joints and the points, from second-order marching.

    Args:
        robot: a `PackedRobot`.
        speed: with a leaky wall.
        disc: from `fine_disc`.
        axes: joint positions of the nodes of the last two joints, shapes (A,) and (B,), rad.
        threads: None takes all cores.

    Returns:
        E, shape (A, B, N, N), float32, s.
    """
    joints = robot.joint_axis.shape[0]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 2)  # (A B, 2)
    q = np.hstack([np.zeros((len(nodes), joints - 2)), nodes])  # (A B, n)
    side = len(disc.axis[::STRIDE])
    out = np.empty((len(q), side, side), dtype=np.float32)
    packed = speed.packed()
    pair = packed, packed._replace(d0=-np.inf)
    run_rows(_tabulate, len(q), threads, robot, pair, disc, joints - 3, q, out)
    return out.reshape(*map(len, axes), side, side)


@kernel
def _cell(position, count):
    """(index, place within the cell, slope of the place) on an axis, beyond whose ends nothing
    changes.
    """
    slope = 1.0 if -ROUNDING <= position <= count - 1 + ROUNDING else 0.0
    position = min(max(position, 0.0), count - 1.0)
    i = min(int(position), count - 2)
    return i, position - i, slope


@kernel
def _on_sheet(sheet, i, j, u, v):
    """(E, dE/du, dE/dv) at the place (u, v) of cell (i, j) of one configuration."""
    e_00, e_01 = float(sheet[i, j]), float(sheet[i, j + 1])
    e_10, e_11 = float(sheet[i + 1, j]), float(sheet[i + 1, j + 1])
    low, high = e_00 + u * (e_01 - e_00), e_10 + u * (e_11 - e_10)
    return low + v * (high - low), (1.0 - v) * (e_01 - e_00) + v * (e_11 - e_10), high - low


@kernel
def _excess(table, cell_a, cell_b, x, y):
    """(E, dE/dx, dE/dy, dE/dq_a, dE/dq_b) at a point in the frame of the table; E is at least 0."""
    (a, w, slope_a), (b, z, slope_b) = cell_a, cell_b
    side = table.excess.shape[2]
    i, v, _ = _cell((y - table.start) / table.h, side)
    j, u, _ = _cell((x - table.start) / table.h, side)
    e_00, x_00, y_00 = _on_sheet(table.excess[a, b], i, j, u, v)
    e_01, x_01, y_01 = _on_sheet(table.excess[a, b + 1], i, j, u, v)
    e_10, x_10, y_10 = _on_sheet(table.excess[a + 1, b], i, j, u, v)
    e_11, x_11, y_11 = _on_sheet(table.excess[a + 1, b + 1], i, j, u, v)
    low, high = e_00 + z * (e_01 - e_00), e_10 + z * (e_11 - e_10)
    e = low + w * (high - low)
    if e <= 0.0:
        return 0.0, 0.0, 0.0, 0.0, 0.0
    e_x = (1.0 - w) * (x_00 + z * (x_01 - x_00)) + w * (x_10 + z * (x_11 - x_10))
    e_y = (1.0 - w) * (y_00 + z * (y_01 - y_00)) + w * (y_10 + z * (y_11 - y_10))
    e_b = (1.0 - w) * (e_01 - e_00) + w * (e_11 - e_10)
    return (
        e,
        e_x / table.h,
        e_y / table.h,
        slope_a * (high - low) / table.step[0],
        slope_b * e_b / table.step[1],
    )


@batch_kernel
def interpolate_rows(lo, hi, held, level, q, points, out):
    """Rows lo to hi: every point's T and, as far as the level asks, its gradients.

    Args:
        lo, hi: row range.
        held: (`PackedRobot`, `PackedTable`), held.
        level: VALUE, POINT_GRADIENT or ALL_GRADIENTS.
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        out: T (B, k), dT_dp (B, k, 2) and dT_dq (B, k, n), empty beyond the level.
    """
    robot, table = held.value
    (times, slopes_p, slopes_q), first = out, table.base
    frames = np.zeros((q.shape[1] + 1, 4))
    axis = robot.joint_axis[first, 2]
    for row in range(lo, hi):
        if first > 0:
            link_frames(robot, q[row], frames)
        cos, sin = np.cos(axis * q[row, first]), np.sin(axis * q[row, first])
        cell_a = _cell((q[row, first + 1] - table.lower[0]) / table.step[0], table.excess.shape[0])
        cell_b = _cell((q[row, first + 2] - table.lower[1]) / table.step[1], table.excess.shape[1])
        for k in range(points.shape[1]):
            d_x, d_y = points[row, k, 0] - frames[first, 0], points[row, k, 1] - frames[first, 1]
            x, y, r = cos * d_x + sin * d_y, cos * d_y - sin * d_x, np.hypot(d_x, d_y)
            inside = r < table.radius
            e, e_x, e_y, e_a, e_b = 0.0, 0.0, 0.0, 0.0, 0.0
            if inside:
                e, e_x, e_y, e_a, e_b = _excess(table, cell_a, cell_b, x, y)
            times[row, k] = (table.radius - r) / table.u_bar + e if inside else 0.0
            if level >= POINT_GRADIENT:
                outward = -1.0 / (max(r, 1e-12) * table.u_bar) if inside else 0.0
                slopes_p[row, k, 0] = cos * e_x - sin * e_y + outward * d_x
                slopes_p[row, k, 1] = sin * e_x + cos * e_y + outward * d_y
            if level >= ALL_GRADIENTS:
                slope = slopes_q[row, k]
                slope[first] = axis * (e_x * y - e_y * x)
                slope[first + 1], slope[first + 2] = e_a, e_b
                base_gradient(robot, frames, first, slopes_p[row, k, 0], slopes_p[row, k, 1], slope)

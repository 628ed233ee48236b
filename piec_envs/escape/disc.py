"""The square grid over a disc workspace, and the escape time of one configuration on it.

Nodes outside the disc are given, T = (R - |p|) / u, negative, so that T = 0 holds on the circle to
second order although the circle crosses the cells; u is the speed at the node, since the robot may
reach the circle, and u_bar in the wall. T_0(p) = (R - |p|) / u_bar bounds T from below everywhere;
the solvers are told so, which makes them exact where nothing is in the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import uint64

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.between import Field
from piec_envs.escape.marching import march, sort_by_time
from piec_envs.escape.speed import cost_map, distance_map
from piec_envs.escape.sweeping import (
    FAR,
    WALL,
    Diagonals,
    diagonal_layout,
    sweep_to_rest,
    to_diagonals,
)
from piec_envs.geometry.body import point_distance
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel, kernel

MARGIN = 2  # cells between the circle and the border of the grid
MIN_RESOLUTION = 16
REACH = 0.71  # cells, from a node to the middle of a passage that it stands for
BAND = 1.5  # cells around the edge of the wall where that matters
EDGE = 2.9  # nodes this many cells outside the circle take part in the stencils of those inside


class Disc(NamedTuple):
    """What is the same for every configuration.

    M nodes lie inside the disc, in row order; E more, the edge, lie outside within two cells.
    """

    radius: float  # m
    h: float  # cell size, m
    axis: np.ndarray  # (N,) coordinates of the grid lines, both ways, m
    inside: int  # M
    x: np.ndarray  # (M + E,) nodes inside the disc, then those of the edge, m
    y: np.ndarray  # (M + E,)
    node: np.ndarray  # (M + E,) int64, their flat index in the grid
    edge: np.ndarray  # (2, E) int64, flat index of the edge's nodes in each layout of diagonals
    layout: Diagonals  # where the free nodes lie, row by row and diagonal by diagonal
    bound: np.ndarray  # (N, N) T_0, s
    start: np.ndarray  # (2, 2 N - 1, N) T_0 by diagonals
    least: np.ndarray  # (2, 2 N - 1, N) the same, FAR outside the disc


class Scratch(NamedTuple):
    """Working memory of one thread."""

    frames: np.ndarray  # (n + 1, 4)
    vertices: np.ndarray  # (V, 2)
    centres: np.ndarray  # (S, 2)
    near: np.ndarray  # (M + E,) distances of the nodes, m
    cost: np.ndarray  # (M + E,) their slowness times h, s
    work: np.ndarray  # (2, M + E)
    distance: np.ndarray  # (N, N) m, inf beyond the edge
    time: np.ndarray  # (N, N) s, FAR where nothing leads out
    field: np.ndarray  # (2, 2 N - 1, N) T by diagonals
    costs: np.ndarray  # (2, 2 N - 1, N) the cost by diagonals
    keys: np.ndarray  # (M,) float32
    orders: np.ndarray  # (2, M) uint32


def make_disc(radius: float, u_bar: float, resolution: int) -> Disc:
    """The grid of `resolution` nodes a side that extends two cells beyond the disc.

    Args:
        radius: of the workspace, m.
        u_bar: speed in free space, m/s.
        resolution: nodes a side.

    Returns:
        The grid.

    Raises:
        InvalidParameterError: if the resolution is below 16.
    """
    if int(resolution) != resolution or resolution < MIN_RESOLUTION:
        raise InvalidParameterError(
            f"resolution must be an integer of at least {MIN_RESOLUTION}, got {resolution}"
        )
    resolution = int(resolution)
    h = 2 * radius / (resolution - 1 - 2 * MARGIN)
    axis = (np.arange(resolution) - (resolution - 1) / 2) * h  # (N,)
    y, x = np.meshgrid(axis, axis, indexing="ij")  # (N, N)
    bound = (radius - np.hypot(x, y)) / u_bar
    inside = bound > 0
    edge = np.argwhere(~inside & (bound > -EDGE * h / u_bar))  # (E, 2) row, column
    node = np.concatenate([np.flatnonzero(inside), edge @ [resolution, 1]])  # (M + E,)
    rows = np.stack([edge[:, 0], resolution - 1 - edge[:, 0]])  # (2, E), plain and upside down
    start, least = np.full((2, 2, 2 * resolution - 1, resolution), FAR)
    for flip in range(2):
        to_diagonals(bound, flip, start[flip])
        to_diagonals(np.where(inside, bound, FAR), flip, least[flip])
    return Disc(
        radius=float(radius),
        h=float(h),
        axis=axis,
        inside=int(inside.sum()),
        x=x.ravel()[node],
        y=y.ravel()[node],
        node=node,
        edge=(rows + edge[:, 1]) * resolution + edge[:, 1],
        layout=diagonal_layout(inside),
        bound=bound,
        start=start,
        least=least,
    )


@batch_kernel
def make_scratch(shapes, frames, disc):
    """Working memory for one thread.

    Args:
        shapes: the `PackedShapes` that will be placed.
        frames: how many frames they are fixed in.
        disc: a `Disc`.

    Returns:
        A `Scratch`.
    """
    n, m = disc.axis.shape[0], disc.x.shape[0]
    return Scratch(
        np.empty((frames, 4)),
        np.empty_like(shapes.vertices),
        np.empty_like(shapes.centre),
        np.empty(m),
        np.empty(m),
        np.empty((2, m)),
        np.full((n, n), np.inf),
        disc.bound.copy(),
        disc.start.copy(),
        np.full(disc.start.shape, WALL),
        np.empty(m, dtype=np.float32),
        np.empty((2, m), dtype=np.uint32),
    )


@kernel
def place_robot(robot, base, q, scratch):
    """Frames and vertices of a configuration relative to its base, whose position is returned.

    Args:
        robot: a `PackedRobot`.
        base: number of leading joints that move the base and with it the disc.
        q: joint positions, shape (n,).
        scratch: frames, vertices and centres are written.

    Returns:
        (x, y): the position of the base, m.
    """
    link_frames(robot, q, scratch.frames)
    place_shapes(robot.shapes, scratch.frames, scratch.vertices, scratch.centres)
    x, y = scratch.frames[base, 0], scratch.frames[base, 1]
    for array in (scratch.frames, scratch.vertices):
        for i in range(array.shape[0]):
            array[i, 0] -= x
            array[i, 1] -= y
    return x, y


@batch_kernel
def _first_order(disc, scratch):
    """Sweep, from `scratch.cost` to layout 0 of `scratch.field`."""
    n = disc.axis.shape[0]
    width, stride = uint64(n), uint64(n + 1)
    for flip in range(2):
        field, costs = scratch.field[flip].ravel(), scratch.costs[flip].ravel()
        first = uint64(0)
        for i in range(n):
            lo, count = disc.layout.rows[i, 0], disc.layout.rows[i, 1] - disc.layout.rows[i, 0]
            # grid[i, j] -> [i + j, j]
            start = uint64(n - 1 - i if flip else i) * width + lo * stride
            for j in range(count):
                f = scratch.cost[first + j]
                costs[start + j * stride] = f if f < WALL else WALL
                field[start + j * stride] = FAR
            first += count
    sweep_to_rest(scratch.field, scratch.costs, disc.least, disc.layout)


@batch_kernel
def _by_rows(disc, field, out):
    """Inside nodes of layout 0 in row order, shape (M,)."""
    width, stride = uint64(field.shape[1]), uint64(field.shape[1] + 1)
    field, first = field.ravel(), uint64(0)
    for i in range(disc.axis.shape[0]):
        lo, count = disc.layout.rows[i, 0], disc.layout.rows[i, 1] - disc.layout.rows[i, 0]
        start = uint64(i) * width + lo * stride
        for j in range(count):
            out[first + j] = field[start + j * stride]
        first += count


@batch_kernel
def _give_edge(speed, disc, scratch):
    """T of the nodes just outside the disc, which the robot may slow down, s."""
    time, edge, m = scratch.time.ravel(), disc.edge, disc.inside
    for flip in range(2):
        field, costs = scratch.field[flip].ravel(), scratch.costs[flip].ravel()
        for e in range(edge.shape[1]):
            beyond = np.hypot(disc.x[m + e], disc.y[m + e]) - disc.radius
            f = scratch.cost[m + e] if scratch.near[m + e] > speed.d0 else disc.h / speed.u_bar
            costs[edge[flip, e]] = f
            time[disc.node[m + e]] = field[edge[flip, e]] = -beyond * f / disc.h


@kernel
def lift_to_axis(shapes, d0, vertices, disc, near):
    """Give nodes beside the middle of a passage the distance that its middle has.

    Between two links the distance is largest halfway and falls on both sides, so that nodes off the
    middle close a passage that is open, or thicken the wall across it, by up to a cell. Where the
    middle lies within REACH cells uphill of a node near the wall, the node stands for it.

    Args:
        shapes: the robot's `PackedShapes`.
        d0: thickness of the wall, m.
        vertices: placed, shape (V, 2), m.
        disc: a `Disc`.
        near: distance of the disc's nodes, shape (M + E,), m; changed.
    """
    reach = REACH * disc.h
    for k in range(near.shape[0]):
        d = near[k]
        if d0 - reach < d < d0 + BAND * disc.h:
            _, _, _, _, n_x, n_y = point_distance(shapes, vertices, disc.x[k], disc.y[k])
            up = point_distance(shapes, vertices, disc.x[k] + reach * n_x, disc.y[k] + reach * n_y)[
                0
            ]
            if up < d + (1.0 - 1e-6) * reach:  # d has slope 1 both ways from the middle
                near[k] = max(d, 0.5 * (d + up + reach))


@batch_kernel
def solve_disc(shapes, speed, disc, second_order, scratch):
    """Escape time of a placed robot at every node of the grid.

    Args:
        shapes: the robot's `PackedShapes`.
        speed: a `PackedSpeed`.
        disc: a `Disc`.
        second_order: whether second-order marching follows the first-order sweeps.
        scratch: a `Scratch` with the vertices placed; `time` and `distance` are written.

    Returns:
        The solution as a `Field`, which lives in the scratch.
    """
    distance_map(shapes, scratch.vertices, disc.x, disc.y, scratch.near, scratch.work)
    lift_to_axis(shapes, speed.d0, scratch.vertices, disc, scratch.near)
    return solve_measured(shapes, speed, disc, second_order, scratch)


@batch_kernel
def solve_measured(shapes, speed, disc, second_order, scratch):
    """Escape time at every node of the grid, from the nodes' distances.

    Args:
        shapes: the `PackedShapes` that a point between the nodes is measured to; without any, its
            distance is interpolated from the nodes.
        speed, disc, second_order: as in `solve_disc`.
        scratch: a `Scratch` with `near` filled.

    Returns:
        As `solve_disc`.
    """
    m = disc.inside
    cost_map(speed, scratch.near, disc.h, scratch.cost)
    _give_edge(speed, disc, scratch)
    _first_order(disc, scratch)
    first = scratch.work[0, :m]
    _by_rows(disc, scratch.field[0], first)
    distance, time = scratch.distance.ravel(), scratch.time.ravel()
    for k in range(m):
        time[disc.node[k]] = FAR if second_order else first[k]
    for k in range(disc.node.shape[0]):
        distance[disc.node[k]] = scratch.near[k]
    if second_order:
        sort_by_time(first, scratch.keys[:m], scratch.orders[0, :m], scratch.orders[1, :m])
        march(
            time,
            scratch.cost,
            disc.bound.ravel(),
            scratch.orders[0, :m],
            disc.node,
            disc.axis.shape[0],
        )
    shape = shapes.first, shapes.radius, scratch.vertices
    return Field(disc.radius, disc.h, disc.axis[0], speed, *shape, scratch.time, scratch.distance)

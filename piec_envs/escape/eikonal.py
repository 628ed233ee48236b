"""The escape time of one placed robot: first-order sweeps, then second-order marching, on a disc.

The nodes' distances give their costs; T on the circle is given; see `piec_envs.escape.disc`.
"""

from __future__ import annotations

import numpy as np
from numba import uint64

from piec_envs.escape.between import Field
from piec_envs.escape.marching import march, sort_by_time
from piec_envs.escape.speed import cost_map, distance_map
from piec_envs.escape.sweeping import FAR, WALL, sweep_to_rest
from piec_envs.geometry.body import point_distance
from piec_envs.kernels import batch_kernel, kernel

REACH = 0.71  # cells, from a node to the middle of a passage that it stands for
BAND = 1.5  # cells around the edge of the wall where that matters


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

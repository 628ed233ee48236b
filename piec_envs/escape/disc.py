"""The square grid over a disc workspace, and the working memory of what is solved on it.

Nodes outside the disc are given, T = (R - |p|) / u, negative, so that T = 0 holds on the circle to
second order although the circle crosses the cells; u is the speed at the node, since the robot may
reach the circle, and u_bar in the wall. T_0(p) = (R - |p|) / u_bar bounds T from below everywhere;
the solvers are told so, which makes them exact where nothing is in the way.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.sweeping import FAR, WALL, Diagonals, diagonal_layout, to_diagonals
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel, kernel

MARGIN = 2  # cells between the circle and the border of the grid
MIN_RESOLUTION = 16
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

"""First-order fast sweeping, by diagonals, until nothing changes.

In a sweep along one diagonal of the grid all nodes of a crossing diagonal are independent of each
other, so the field is kept with one row per diagonal and the update vectorises. Two such layouts,
of the grid and of the grid upside down (`flip`), serve the four sweep directions of Zhao ("A fast
sweeping method for eikonal equations", 2005). Indices are unsigned where loops must vectorise:
Numba then needs no test for negative ones.

The cost of an edge is the mean of its two nodes, f_a and f_b on the two axes, and Godunov's update
from the lesser neighbours a and b is the root of (t - a)^2 / f_a^2 + (t - b)^2 / f_b^2 = 1. With
the node's own cost on both axes the error near the robot is 1.5 to 2.5 times as large. On a crest
of T, where the two neighbours on an axis are equal and their costs are not, the least value met is
kept.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import uint64

from piec_envs.errors import InvalidParameterError
from piec_envs.kernels import batch_kernel

FAR = 1e30  # stands for infinity inside the solvers, where inf - inf must not happen
WALL = 4e30  # cost of a node in a hard wall


class Diagonals(NamedTuple):
    """Where the free nodes of an (n, m) grid lie, row by row and diagonal by diagonal."""

    rows: np.ndarray  # (n, 2) uint64, first and last + 1 free column of each row
    span: np.ndarray  # (2, n + m - 1, 2) uint64, the same of each diagonal, plain and flipped


def diagonal_layout(free: np.ndarray) -> Diagonals:
    """The `Diagonals` of a grid whose free nodes are marked; its outermost ring must not be free.

    Args:
        free: nodes that the solver may change, shape (n, m).
    """
    layouts = np.zeros((2, sum(free.shape) - 1, free.shape[1]), dtype=bool)
    for flip in range(2):
        to_diagonals(free, flip, layouts[flip])
    return Diagonals(_extent(free), _extent(layouts))


def _extent(mask: np.ndarray) -> np.ndarray:
    """First and last + 1 set column of each row, shape (..., 2), both 0 where there is none."""
    first = mask.argmax(-1)
    last = mask.shape[-1] - mask[..., ::-1].argmax(-1)
    return (np.stack([first, last], -1) * np.asarray(mask.any(-1))[..., None]).astype(np.uint64)


@batch_kernel
def to_diagonals(grid, flip, out):
    """out[i + j, j] = grid[i, j], with the rows of `grid` taken from last to first if `flip`.

    Args:
        grid: shape (n, m).
        flip: 1 to turn the grid upside down, else 0.
        out: output, shape (n + m - 1, m).
    """
    n, m = grid.shape
    for i in range(n):
        row = n - 1 - i if flip else i
        for j in range(m):
            out[i + j, j] = grid[row, j]


@batch_kernel
def _relax(field, cost, least, first, count, width):
    """Godunov's upwind update of `count` neighbours on one diagonal; returns how many became
    smaller.
    """
    changed = 0
    one = uint64(1)
    for j in range(count):
        k = first + j
        left, right, down, up = k - width - one, k + width + one, k - width, k + width
        t_left, t_right, t_down, t_up = field[left], field[right], field[down], field[up]
        f_left, f_right, f_down, f_up = cost[left], cost[right], cost[down], cost[up]
        a = t_left if t_left < t_right else t_right
        b = t_down if t_down < t_up else t_up
        f_a = 0.5 * (cost[k] + (f_left if t_left < t_right else f_right))
        f_b = 0.5 * (cost[k] + (f_down if t_down < t_up else f_up))
        near = a if a < b else b
        f = f_a if a < b else f_b  # cost towards the lesser neighbour
        g = f_b if a < b else f_a  # and towards the other one
        gap = abs(a - b)
        total = f * f + g * g
        root = total - gap * gap
        both = (f * f * gap + f * g * np.sqrt(root if root > 0.0 else 0.0)) / total
        t = near + (both if gap < f else f)
        t = t if t > least[k] else least[k]
        changed += t < field[k]
        field[k] = t if t < field[k] else field[k]
    return changed


@batch_kernel
def _sweep(field, cost, least, span, backwards):
    """One sweep over the diagonals of one layout; returns how many nodes became smaller."""
    changed = 0
    count = field.shape[0] - 2
    width = uint64(field.shape[1])
    field, cost, least = field.ravel(), cost.ravel(), least.ravel()
    for k in range(count):
        s = count - k if backwards else k + 1
        lo, hi = span[s, 0], span[s, 1]
        changed += _relax(field, cost, least, uint64(s) * width + lo, hi - lo, width)
    return changed


@batch_kernel
def copy_flipped(field, flip, rows):
    """Copy the free nodes from layout `flip` to the other one.

    Args:
        field: both layouts, shape (2, n + m - 1, m).
        flip: the layout to read.
        rows: of the `Diagonals`.
    """
    n, width = rows.shape[0], uint64(field.shape[2])
    source, target = field[flip].ravel(), field[1 - flip].ravel()
    stride = width + uint64(1)
    for i in range(n):
        start, end = uint64(i) * width, uint64(n - 1 - i) * width
        if flip:
            start, end = end, start
        for j in range(rows[i, 0], rows[i, 1]):
            target[end + j * stride] = source[start + j * stride]


@batch_kernel
def sweep_to_rest(field, cost, least, layout):
    """Sweep in the four directions in turn until one sweep changes nothing.

    Args:
        field: T in both layouts, shape (2, n + m - 1, m), updated in place; free nodes start at
            FAR.
        cost: slowness times cell size in both layouts, of the same shape, s; WALL in hard walls.
        least: lower bound of T in both layouts, of the same shape, s; FAR at nodes that are not
            free, which keeps them as they are.
        layout: the `Diagonals`.

    Returns:
        The number of sweeps. Layout 0 of `field` holds the result.
    """
    sweeps = 0
    while True:
        for flip in range(2):
            for backwards in range(2):
                sweeps += 1
                if _sweep(field[flip], cost[flip], least[flip], layout.span[flip], backwards) == 0:
                    if flip:
                        copy_flipped(field, 1, layout.rows)
                    return sweeps
            copy_flipped(field, flip, layout.rows)


def sweep(
    slowness: np.ndarray, boundary: np.ndarray, h: float, least: float | np.ndarray = 0.0
) -> np.ndarray:
    """Solve |grad T| = slowness on any grid, first order (paper, section 3.3, eq. 2).

    Args:
        slowness: 1 / speed at each node, inf in walls, finite where T is given, shape (n, m), s/m.
        boundary: T of the nodes where it is given, inf at all others, shape (n, m), s.
        h: cell size, m.
        least: a known lower bound of T, s.

    Returns:
        T, shape (n, m), s; inf where no path leads to the boundary.

    Raises:
        InvalidParameterError: if the shapes differ or a slowness is not positive.
    """
    check_scene(slowness, boundary)
    free = np.pad(~np.isfinite(boundary) & np.isfinite(slowness), 1)
    grids = (
        np.pad(np.minimum(boundary, FAR), 1, constant_values=FAR),
        np.pad(np.minimum(slowness * h, WALL), 1, constant_values=WALL),
        np.where(
            free, np.pad(np.broadcast_to(np.asarray(least, dtype=float), slowness.shape), 1), FAR
        ),
    )
    layouts = np.full((3, 2, sum(free.shape) - 1, free.shape[1]), FAR)
    for grid, pair in zip(grids, layouts, strict=True):
        for flip in range(2):
            to_diagonals(grid, flip, pair[flip])
    sweep_to_rest(*layouts, diagonal_layout(free))
    i, j = np.indices(free.shape)
    time = layouts[0, 0, i + j, j][1:-1, 1:-1]  # (n, m)
    return np.where(time < FAR / 2, time, np.inf)


def check_scene(slowness: np.ndarray, boundary: np.ndarray) -> None:
    """Refuse a slowness map and boundary values that make no scene.

    Args:
        slowness: 1 / speed at each node, shape (n, m), s/m.
        boundary: T where it is given, inf elsewhere, shape (n, m), s.

    Raises:
        InvalidParameterError: if the shapes differ, a slowness is not positive, or one is infinite
            where the boundary gives T.
    """
    if slowness.shape != boundary.shape or slowness.ndim != 2:
        raise InvalidParameterError(
            f"slowness and boundary must have one shape (n, m), got {slowness.shape} and "
            f"{boundary.shape}"
        )
    if not (slowness > 0).all() or np.isinf(slowness[np.isfinite(boundary)]).any():
        raise InvalidParameterError(
            "slowness must be positive, and finite wherever the boundary gives T"
        )


def sweep_reference(
    slowness: np.ndarray, boundary: np.ndarray, h: float, least: float = 0.0
) -> np.ndarray:
    """`sweep` in plain Python: Gauss-Seidel over all nodes in four orders until nothing changes.

    Args:
        slowness, boundary, h: as in `sweep`.
        least: a known lower bound of T, one for all nodes, s.

    Returns:
        T, shape (n, m), s; inf where no path leads to the boundary.
    """
    time = np.pad(boundary.astype(float), 1, constant_values=np.inf)
    cost = np.pad(slowness * h, 1, constant_values=np.inf)
    free = np.argwhere(np.isinf(time) & np.isfinite(cost))

    def neighbour(i, j, di, dj):
        """The earlier of two opposite neighbours: its time, and the mean slowness on the way."""
        end = min(((i - di, j - dj), (i + di, j + dj)), key=lambda k: time[k])
        return time[end], (cost[i, j] + cost[end]) / 2

    before = None
    while before is None or not np.array_equal(before, time):
        before = time.copy()
        for di, dj in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
            for i, j in sorted(free, key=lambda k: (di * k[0], dj * k[1])):
                (a, f), (b, g) = sorted([neighbour(i, j, 0, 1), neighbour(i, j, 1, 0)])
                t = a + f
                if t > b:  # (t - a)^2 / f^2 + (t - b)^2 / g^2 = 1
                    t = (g**2 * a + f**2 * b + f * g * np.sqrt(f**2 + g**2 - (b - a) ** 2)) / (
                        f**2 + g**2
                    )
                time[i, j] = min(time[i, j], max(t, least))
    return time[1:-1, 1:-1]

"""First-order fast sweeping, by diagonals.

All nodes of one diagonal of the grid are independent of each other in a sweep along the grid's
other diagonal, so the field is stored with one row per diagonal and the update vectorises. Two
such layouts, of the grid and of the grid upside down, serve the four sweep directions of Zhao
("A fast sweeping method for eikonal equations", 2005).
"""

from __future__ import annotations

import numpy as np
from numba import njit

FAR = 1e30  # stands for infinity in the sweeps, where inf - inf must not happen
WALL = 4e30  # cost of a node that is never updated: any candidate through it exceeds FAR


@njit(cache=True, nogil=True)
def to_diagonals(grid, flip, out):
    """out[i + j, j] = grid[i, j], with the rows of `grid` taken from last to first if `flip`.

    Args:
        grid: shape (n, m).
        flip: whether to turn the grid upside down.
        out: output, shape (n + m - 1, m).
    """
    n, m = grid.shape
    for i in range(n):
        row = grid[n - 1 - i if flip else i]
        target = out[i : i + m]
        for j in range(m):
            target[j, j] = row[j]


@njit(cache=True, nogil=True)
def from_diagonals(diagonals, flip, grid):
    """The inverse of `to_diagonals`: grid[i, j] = diagonals[i + j, j], upside down if `flip`."""
    n, m = grid.shape
    for i in range(n):
        row = grid[n - 1 - i if flip else i]
        source = diagonals[i : i + m]
        for j in range(m):
            row[j] = source[j, j]


@njit(cache=True, nogil=True)
def _relax(here, left, right, down, up, cost, least):
    """Godunov's upwind update of the nodes of one diagonal; returns how many became smaller.

    Args:
        here: T of the nodes, shape (n,), updated in place.
        left, right, down, up: T of their neighbours, shape (n,).
        cost: slowness times cell size, shape (n,).
        least: lower bound of T, shape (n,).
    """
    changed = 0
    for k in range(here.shape[0]):
        a = left[k] if left[k] < right[k] else right[k]
        b = down[k] if down[k] < up[k] else up[k]
        f = cost[k]
        gap = a - b
        one = (a if a < b else b) + f
        root = 2.0 * f * f - gap * gap
        two = 0.5 * (a + b + np.sqrt(root if root > 0.0 else 0.0))
        t = two if gap * gap < f * f else one
        t = t if t > least[k] else least[k]
        changed += t < here[k]
        here[k] = t if t < here[k] else here[k]
    return changed


@njit(cache=True, nogil=True)
def _sweep(field, cost, least, span, backwards):
    """One sweep over the diagonals; returns how many nodes became smaller."""
    changed = 0
    count = field.shape[0] - 2
    for k in range(count):
        s = count - k if backwards else k + 1
        lo, hi = span[s, 0], span[s, 1]
        if lo < hi:
            before, after = field[s - 1], field[s + 1]
            changed += _relax(
                field[s, lo:hi],
                before[lo - 1 : hi - 1],
                after[lo + 1 : hi + 1],
                before[lo:hi],
                after[lo:hi],
                cost[s, lo:hi],
                least[s, lo:hi],
            )
    return changed

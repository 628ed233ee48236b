"""Second-order arrival times: nodes are computed once, in the order in which the front reaches
them.

Sethian's fast marching with the one-sided second-order differences of "Fast marching methods" (SIAM
Review 1999, section 3): where the two upwind neighbours on an axis have arrived and T falls towards
the far one, (3 T - 4 T_1 + T_2) / (2 h) replaces (T - T_1) / h. Fast marching finds the order with
a heap while it computes; here it is that of the first-order solution, which sweeping delivers in a
fraction of the heap's time. Two neighbours change places only where the front runs along the edge
between them, and there neither contributes to the other.
"""

from __future__ import annotations

import numpy as np

from piec_envs.escape.sweeping import FAR, sweep
from piec_envs.kernels import batch_kernel

RADIX_BITS = 11  # three digits hold a float32


@batch_kernel
def sort_by_time(time, keys, order, spare):
    """Order of arrival of the nodes, to float32 precision; ties stay in row order.

    Args:
        time: T >= 0 of the nodes, shape (M,), s.
        keys: scratch, shape (M,) float32.
        order: output, shape (M,) uint32.
        spare: scratch, shape (M,) uint32.
    """
    size = time.shape[0]
    for k in range(size):
        keys[k] = time[k]
        spare[k] = k
    bits = keys.view(np.uint32)  # non-negative floats sort as their bits do
    counts = np.empty((1 << RADIX_BITS) + 1, dtype=np.int64)
    source, target = spare, order
    for digit in range(3):
        shift = digit * RADIX_BITS
        counts[:] = 0
        for k in range(size):
            counts[((bits[k] >> shift) & ((1 << RADIX_BITS) - 1)) + 1] += 1
        for c in range(1 << RADIX_BITS):
            counts[c + 1] += counts[c]
        for k in range(size):
            node = source[k]
            bucket = (bits[node] >> shift) & ((1 << RADIX_BITS) - 1)
            target[counts[bucket]] = node
            counts[bucket] += 1
        source, target = target, source


@batch_kernel
def march(time, cost, least, order, node, width):
    """Second-order arrival times of the nodes, one after the other.

    Args:
        time: T on the grid, flat, shape (nodes,), s: given on the boundary, FAR elsewhere; updated
            in place.
        cost: slowness times cell size of the free nodes, shape (M,), s.
        least: lower bound of T on the grid, flat, shape (nodes,), s.
        order: the free nodes in order of arrival, shape (M,).
        node: flat index of each free node, shape (M,); two rings of nodes around the grid are not
            free.
        width: nodes per row.
    """
    for position in range(order.shape[0]):
        free = order[position]
        k, f = node[free], cost[free]
        if f >= FAR:
            continue
        near_a = min(time[k - 1], time[k + 1])
        far_a = time[k - 2] if time[k - 1] < time[k + 1] else time[k + 2]
        near_b = min(time[k - width], time[k + width])
        far_b = time[k - 2 * width] if time[k - width] < time[k + width] else time[k + 2 * width]
        second_a, second_b = far_a <= near_a, far_b <= near_b
        # weight * (T - a)^2 is the squared difference
        a = (4.0 * near_a - far_a) / 3.0 if second_a else near_a
        b = (4.0 * near_b - far_b) / 3.0 if second_b else near_b
        t = min(a + (f / 1.5 if second_a else f), b + (f / 1.5 if second_b else f))
        w_a, w_b = 2.25 if second_a else 1.0, 2.25 if second_b else 1.0
        root = (w_a + w_b) * f * f - w_a * w_b * (a - b) * (a - b)
        if root >= 0.0:
            both = (w_a * a + w_b * b + np.sqrt(root)) / (w_a + w_b)
            t = both if both >= near_a and both >= near_b else t
        time[k] = max(t, least[k])


def fast_march(
    slowness: np.ndarray, boundary: np.ndarray, h: float, least: float | np.ndarray = 0.0
) -> np.ndarray:
    """Solve |grad T| = slowness on any grid, second order (paper, section 3.3, eq. 2).

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
    given = np.isfinite(boundary)
    first = sweep(slowness, boundary, h, least)
    time = np.pad(np.where(given, boundary, FAR), 2, constant_values=FAR)
    bound = np.pad(np.broadcast_to(np.asarray(least, dtype=float), slowness.shape), 2)
    node = np.flatnonzero(np.pad(~given & np.isfinite(first), 2))  # (M,)
    reached = np.pad(first, 2).ravel()[node]
    cost = (np.pad(slowness, 2).ravel() * h)[node]
    march(
        time.ravel(),
        cost,
        bound.ravel(),
        np.argsort(reached, kind="stable").astype(np.uint32),
        node,
        time.shape[1],
    )
    time = time[2:-2, 2:-2]  # (n, m)
    return np.where(time < FAR / 2, time, np.inf)


def march_reference(
    slowness: np.ndarray, boundary: np.ndarray, h: float, least: float = 0.0
) -> np.ndarray:
    """`fast_march` in plain Python: accept the least tentative time, recompute its neighbours.

    Args:
        slowness, boundary, h: as in `fast_march`.
        least: a known lower bound of T, one for all nodes, s.

    Returns:
        T, shape (n, m), s; inf where no path leads to the boundary.
    """
    time = np.pad(boundary.astype(float), 2, constant_values=np.inf)
    cost = np.pad(slowness * h, 2, constant_values=np.inf)
    known = np.isfinite(time)
    open_nodes = {tuple(k) for k in np.argwhere(~known & np.isfinite(cost))}

    def arrival(i, j):
        """Second-order time at a node from its accepted neighbours."""
        bases = []
        weights = []
        nears = []
        for di, dj in ((0, 1), (1, 0)):
            sides = [s for s in (-1, 1) if known[i + s * di, j + s * dj]]
            if not sides:
                continue
            s = min(sides, key=lambda s: time[i + s * di, j + s * dj])
            near = (i + s * di, j + s * dj)
            far = (i + 2 * s * di, j + 2 * s * dj)
            second = known[far] and time[far] <= time[near]
            nears.append(time[near])
            bases.append((4 * time[near] - time[far]) / 3 if second else time[near])
            weights.append(2.25 if second else 1.0)
        b = np.array(bases)
        w = np.array(weights)
        f = cost[i, j]
        one = (b + f / np.sqrt(w)).min()
        root = (w @ b) ** 2 - w.sum() * (w @ b**2 - f**2)  # sum of w (t - b)^2 = f^2
        if len(b) < 2 or root < 0:
            return one
        t = (w @ b + np.sqrt(root)) / w.sum()
        return t if t >= max(nears) else one

    def beside(i, j):
        """Open neighbours of a node."""
        return {(i + 1, j), (i - 1, j), (i, j + 1), (i, j - 1)} & open_nodes

    for k in [
        k
        for k in open_nodes
        if any(known[k[0] + a, k[1] + b] for a, b in ((1, 0), (-1, 0), (0, 1), (0, -1)))
    ]:
        time[k] = max(arrival(*k), least)
    while open_nodes:
        k = min(open_nodes, key=lambda k: time[k])
        if not np.isfinite(time[k]):
            break
        open_nodes.remove(k)
        known[k] = True
        for n in beside(*k):
            time[n] = min(time[n], max(arrival(*n), least))
    return time[2:-2, 2:-2]

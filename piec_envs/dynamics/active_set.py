"""The compiled solver of the contact QP: an active-set method on its dual.

The dual of the QP in `contact_qp` is min 1/2 x^T G x + x^T r over x >= 0 with G = A Q^-1 A^T + c I,
where r holds the constraint values at the free step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.rigid import FAILED, give_way, is_answer
from piec_envs.kernels import batch_kernel, inlined_kernel, kernel

VIOLATION_TOLERANCE = 1e-13  # m
LANES = 16  # loops over rows run to a multiple of this, since a compiler's vector loop leaves out the remainder
DEPENDENT = 1e-6  # a row whose part off the rows before it has at most this share of its square depends on them


class DualScratch(NamedTuple):
    """Scratch of the dual problem; the passive set is what may have a positive multiplier."""

    scale: np.ndarray  # (d,) diagonal of Q^-1/2
    columns: np.ndarray  # (d, m) (A Q^-1/2)^T; contiguous over the rows of A, so that loops over them are
    value: np.ndarray  # (m,) constraint values after that step
    multipliers: np.ndarray  # (m,) lambda
    passive: np.ndarray  # (m,) int64
    G: np.ndarray  # (m, m) A Q^-1 A^T + c I on pairs of passive rows
    L: np.ndarray  # (m, m) Cholesky factor of G on the passive rows, in their order
    inverse: np.ndarray  # (m,) 1 / diagonal of L
    forward: np.ndarray  # (m,) solution of L forward = -r
    z: np.ndarray  # (m,) minimiser on the passive set


@batch_kernel
def make_dual(weight, m):
    """Scratch for problems of up to m rows with the diagonal `weight` of Q."""
    d, padded = weight.shape[0], (m + LANES - 1) // LANES * LANES
    return DualScratch(
        1.0 / np.sqrt(weight),
        np.zeros((d, padded)),
        np.zeros(padded),
        np.empty(m),
        np.empty(m, dtype=np.int64),
        np.empty((m, m)),
        np.empty((m, m)),
        np.empty(m),
        np.empty(m),
        np.empty(m),
    )


@inlined_kernel
def _scale_rows(rows, m, compliance, dual):
    """Columns of A Q^-1/2; returns c, the compliance times the largest entry of A Q^-1 A^T."""
    largest = 0.0
    for i in range(m):
        square = 0.0
        for j in range(dual.scale.shape[0]):
            entry = rows[i, j] * dual.scale[j]
            dual.columns[j, i] = entry
            square += entry * entry
        largest = max(largest, square)
    return compliance * largest


@inlined_kernel
def _values(r, m, p, dual):
    """Values r + A Q^-1 A^T lambda of all constraints, from the p passive multipliers."""
    for i in range(m):
        dual.value[i] = r[i]
    if p == 0:
        return
    padded = (m + LANES - 1) // LANES * LANES
    for j in range(dual.scale.shape[0]):
        step = 0.0
        for k in range(p):
            step += dual.columns[j, dual.passive[k]] * dual.multipliers[dual.passive[k]]
        for i in range(padded):
            dual.value[i] += step * dual.columns[j, i]


@inlined_kernel
def _enter(i, p, c, dual):
    """Append row i to the passive set: its entries of G."""
    dual.passive[p] = i
    for k in range(p + 1):
        other, total = dual.passive[k], 0.0
        for j in range(dual.scale.shape[0]):
            total += dual.columns[j, i] * dual.columns[j, other]
        dual.G[i, other] = dual.G[other, i] = total
    dual.G[i, i] += c


@inlined_kernel
def _factor(r, begin, p, dual):
    """Rows begin to p - 1 of the Cholesky factor of G on the passive set, and of its forward solution."""
    L, passive = dual.L, dual.passive
    for i in range(begin, p):
        a = passive[i]
        square, forward = dual.G[a, a], -r[a]
        for k in range(i):
            total = dual.G[a, passive[k]]
            for j in range(k):
                total -= L[i, j] * L[k, j]
            entry = total * dual.inverse[k]
            L[i, k] = entry
            square -= entry * entry
            forward -= entry * dual.forward[k]
        dual.inverse[i] = 1.0 / np.sqrt(max(square, 1e-300))
        dual.forward[i] = forward * dual.inverse[i]


@inlined_kernel
def _substitute(p, dual):
    """Minimiser z on the passive set: L^T z = forward."""
    L, z = dual.L, dual.z
    for i in range(p):
        z[i] = dual.forward[i]
    for i in range(p - 1, -1, -1):
        z[i] *= dual.inverse[i]
        for j in range(i):
            z[j] -= L[i, j] * z[i]


@inlined_kernel
def _step_inside(p, dual):
    """Share of the way from the multipliers to z on which none turns negative; above 1 if none does."""
    share = np.inf
    for i in range(p):
        z = dual.z[i]
        if z <= 0.0:
            old = dual.multipliers[dual.passive[i]]
            share = min(share, old / (old - z) if old > z else 0.0)
    return share


@inlined_kernel
def _leave(share, p, dual):
    """Go that share of the way to z and drop the rows whose multipliers reach 0.

    Returns:
        (begin, p): the first position that has changed, and the set's new size.
    """
    kept, begin = 0, -1
    for i in range(p):
        a, z = dual.passive[i], dual.z[i]
        value = dual.multipliers[a] + share * (z - dual.multipliers[a])
        if z > 0.0 or value > 1e-14 * abs(z):
            dual.multipliers[a] = value
            dual.passive[kept] = a
            kept += 1
        else:
            dual.multipliers[a] = 0.0
            begin = kept if begin < 0 else begin
    return (kept if begin < 0 else begin), kept


@inlined_kernel
def _minimise(r, begin, p, whole, dual):
    """Minimise on the passive set, dropping rows that turn negative.

    Args:
        r: as in `solve_dual`.
        begin: first position of the passive set whose factor is not known.
        p: size of the passive set.
        whole: whether to go all the way to a minimiser with negative entries, not just to the bound.
        dual: scratch.

    Returns:
        The passive set's new size.
    """
    while True:
        _factor(r, begin, p, dual)
        _substitute(p, dual)
        share = _step_inside(p, dual)
        if share > 1.0:
            for i in range(p):
                dual.multipliers[dual.passive[i]] = dual.z[i]
            return p
        begin, p = _leave(1.0 if whole else share, p, dual)


@inlined_kernel
def _most_violated(m, blocked, dual):
    """The row with the least value of those that do not press, -1 where none is violated."""
    found, worst = -1, -VIOLATION_TOLERANCE
    for i in range(m):
        if dual.value[i] < worst and dual.multipliers[i] <= 0.0 and i != blocked:
            found, worst = i, dual.value[i]
    return found


@inlined_kernel
def _start(r, m, c, dual):
    """Multipliers of the violated rows alone, less those that would pull; returns the passive set's size.

    A row that is added or dropped later costs an iteration. Rows that depend on those before stay out.
    """
    p = 0
    for i in range(m):
        if r[i] < -VIOLATION_TOLERANCE:
            _enter(i, p, c, dual)
            _factor(r, p, p + 1, dual)
            if dual.inverse[p] ** 2 * dual.G[i, i] * DEPENDENT < 1.0:
                p += 1
    return _minimise(r, p, p, True, dual)


@kernel
def _solve_rigid(r, m, dual):
    """The same as `solve_dual` without compliance, where rows may depend on each other and answers are checked."""
    p, blocked = 0, -1
    for _ in range(3 * m + 10):
        _values(r, m, p, dual)
        enter = _most_violated(m, blocked, dual)
        if enter < 0:
            return p if is_answer(m, p, dual) else FAILED
        _enter(enter, p, 0.0, dual)
        _factor(r, p, p + 1, dual)
        begin, p = give_way(p + 1, dual)
        if begin < 0:
            return FAILED
        p = _minimise(r, begin, p, False, dual)
        blocked = -1 if dual.multipliers[enter] > 0.0 else enter
    return FAILED


@inlined_kernel
def solve_dual(rows, m, compliance, r, guess, dual):
    """Exact active-set solution of min 1/2 x^T G x + x^T r over x >= 0 (Lawson and Hanson 1974).

    G = A Q^-1 A^T + c I is only formed on the rows that enter the passive set, and its Cholesky factor
    grows with it.

    Args:
        rows: A, at least (m, d).
        m: number of rows.
        compliance: c relative to the largest diagonal entry of A Q^-1 A^T.
        r: constraint values at the free step, shape (m,), m.
        guess: whether to begin with the violated rows pressing; the solution is the same.
        dual: scratch from `make_dual` with the diagonal of Q; `dual.multipliers` is the solution.

    Returns:
        Number of rows with a positive multiplier; they stand first in `dual.passive`. FAILED where there is no
        solution, or none is found.
    """
    c = _scale_rows(rows, m, compliance, dual)
    for i in range(m):
        dual.multipliers[i] = 0.0
    if c == 0.0:  # its multipliers are not unique: row by row there are fewest
        return _solve_rigid(r, m, dual)
    p, blocked = 0, -1
    if guess:
        p = _start(r, m, c, dual)
    for _ in range(3 * m + 10):
        _values(r, m, p, dual)
        enter = _most_violated(m, blocked, dual)
        if enter < 0:
            return p
        _enter(enter, p, c, dual)
        p = _minimise(r, p, p + 1, False, dual)
        blocked = -1 if dual.multipliers[enter] > 0.0 else enter  # rounding sent it straight out again
    return FAILED

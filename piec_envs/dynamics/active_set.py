"""The compiled solver of the contact QP: an active-set method on its dual.

The dual of the QP in `contact_qp` is min 1/2 x^T G x + x^T r over x >= 0 with G = A Q^-1 A^T + c I,
where r holds the constraint values at the free step.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.rigid import FAILED, give_way, is_answer
from piec_envs.kernels import batch_kernel, inlined_kernel

VIOLATION_TOLERANCE = 1e-13  # m
# a row whose part off the rows before it has at most this share of its square depends on them
DEPENDENT = 1e-6


class DualScratch(NamedTuple):
    """Scratch of the dual problem; the passive set is what may have a positive multiplier."""

    scale: np.ndarray  # (d,) diagonal of Q^-1/2
    scaled: np.ndarray  # (m, d) A Q^-1/2
    step: np.ndarray  # (d,) Q^-1/2 A^T lambda
    value: np.ndarray  # (m,) constraint values after that step; filled without compliance alone
    multipliers: np.ndarray  # (m,) lambda
    passive: np.ndarray  # (m,) int64
    G: np.ndarray  # (m, m) A Q^-1 A^T + c I on a passive row and those that were so before it
    L: np.ndarray  # (m, m) Cholesky factor of G on the passive rows, in their order
    inverse: np.ndarray  # (m,) 1 / diagonal of L
    forward: np.ndarray  # (m,) solution of L forward = -r
    z: np.ndarray  # (m,) minimiser on the passive set


@batch_kernel
def make_dual(weight, m):
    """Scratch for problems of up to m rows.

    Args:
        weight: diagonal of Q, shape (d,).
        m: rows at most.

    Returns:
        A `DualScratch`.
    """
    d = weight.shape[0]
    scale = np.empty(d)
    for j in range(d):
        scale[j] = 1.0 / np.sqrt(weight[j])
    return DualScratch(
        scale,
        np.empty((m, d)),
        np.empty(d),
        np.empty(m),
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
    """A Q^-1/2; returns c, the compliance times the largest entry of A Q^-1 A^T."""
    largest = 0.0
    for i in range(m):
        square = 0.0
        for j in range(dual.scale.shape[0]):
            entry = rows[i, j] * dual.scale[j]
            dual.scaled[i, j] = entry
            square += entry * entry
        largest = max(largest, square)
    return compliance * largest


@inlined_kernel
def _sum_step(p, dual):
    """The scaled step that the p passive multipliers bring."""
    for j in range(dual.scale.shape[0]):
        step = 0.0
        for k in range(p):
            step += dual.scaled[dual.passive[k], j] * dual.multipliers[dual.passive[k]]
        dual.step[j] = step


@inlined_kernel
def _value(i, r, p, dual):
    """Entry i of r + A Q^-1 A^T lambda, the constraint values after the step."""
    value = r[i]
    if p > 0:
        for j in range(dual.scale.shape[0]):
            value += dual.step[j] * dual.scaled[i, j]
    return value


@inlined_kernel
def _most_violated(r, m, p, blocked, dual):
    """The row with the least value of those that do not press, -1 where none is violated."""
    found, worst = -1, -VIOLATION_TOLERANCE
    if p < m:
        _sum_step(p, dual)
        for i in range(m):
            if dual.multipliers[i] <= 0.0 and i != blocked:
                value = _value(i, r, p, dual)
                if value < worst:
                    found, worst = i, value
    return found


@inlined_kernel
def _enter(i, p, c, dual):
    """Append row i to the passive set: its entries of G."""
    dual.passive[p] = i
    for k in range(p + 1):
        other, total = dual.passive[k], 0.0
        for j in range(dual.scale.shape[0]):
            total += dual.scaled[i, j] * dual.scaled[other, j]
        dual.G[i, other] = total
    dual.G[i, i] += c


@inlined_kernel
def _factor(r, begin, p, dual):
    """Rows begin to p - 1 of the Cholesky factor of G on the passive set, and of its forward
    solution.
    """
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
    """Share of the way from the multipliers to z on which none turns negative; above 1 if none
    does.
    """
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
        whole: whether to go all the way to a minimiser with negative entries, not just to the
            bound.
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
def _guess(r, m, c, dual):
    """Let the violated rows press; returns the passive set's size.

    A row that is added or dropped later costs an iteration. Rows that depend on those before stay
    out.
    """
    p = 0
    for i in range(m):
        if r[i] < -VIOLATION_TOLERANCE:
            _enter(i, p, c, dual)
            _factor(r, p, p + 1, dual)
            if dual.inverse[p] ** 2 * dual.G[i, i] * DEPENDENT < 1.0:
                p += 1
    return p


@inlined_kernel
def _is_solved(r, m, p, dual):
    """`is_answer` of the p passive multipliers."""
    _sum_step(p, dual)
    for i in range(m):
        dual.value[i] = _value(i, r, p, dual)
    return is_answer(m, p, dual)


@inlined_kernel
def solve_dual(rows, m, compliance, r, guess, dual):
    """Exact active-set solution of min 1/2 x^T G x + x^T r over x >= 0 (Lawson and Hanson 1974).

    G = A Q^-1 A^T + c I is only formed on the rows that enter the passive set, and its Cholesky
    factor grows with it.

    Args:
        rows: A, at least (m, d).
        m: number of rows.
        compliance: c relative to the largest diagonal entry of A Q^-1 A^T.
        r: constraint values at the free step, shape (m,), m.
        guess: whether to begin with the violated rows pressing; the solution is the same.
        dual: scratch from `make_dual` with the diagonal of Q; `dual.multipliers` is the solution.

    Returns:
        Number of rows with a positive multiplier; they stand first in `dual.passive`. FAILED where
        there is no solution, or none is found.
    """
    c = _scale_rows(rows, m, compliance, dual)
    for i in range(m):
        dual.multipliers[i] = 0.0
    rigid = c == 0.0  # multipliers are not unique: row by row there are fewest
    p = _guess(r, m, c, dual) if guess and not rigid else 0
    begin, whole, enter = p, True, -1
    for _ in range(3 * m + 10):
        p = _minimise(r, begin, p, whole, dual)
        sent_out = enter >= 0 and not dual.multipliers[enter] > 0.0  # again, by rounding
        enter = _most_violated(r, m, p, enter if sent_out else -1, dual)
        if enter < 0:
            return FAILED if rigid and not _is_solved(r, m, p, dual) else p
        _enter(enter, p, c, dual)
        begin, p, whole = p, p + 1, False
        if rigid:
            _factor(r, p - 1, p, dual)
            begin, p = give_way(p, dual)
            if begin < 0:
                return FAILED
    return FAILED

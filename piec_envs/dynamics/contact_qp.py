"""The contact QP of one quasi-dynamic step (paper eq. 7), and two solvers of it.

    min over dq   1/2 dq^T Q dq - dq^T b  +  sum_i s_i^2 / (2 c)
    s.t.          A dq + phi + s >= 0

Q is diagonal. The slack s is the contact compliance: with multipliers lambda it equals c lambda,
so the dual matrix A Q^-1 A^T gets + c I and the multipliers are unique. c = 0 is the rigid problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from piec_envs.kernels import batch_kernel, kernel

VIOLATION_TOLERANCE = 1e-13  # m


@dataclass(frozen=True, eq=False)
class ContactProblem:
    """One contact QP.

    Args:
        weight: diagonal of Q, shape (d,).
        free: unconstrained minimiser Q^-1 b, shape (d,), rad or m.
        rows: A, shape (m, d).
        gap: phi, shape (m,), m.
        compliance: c relative to the largest diagonal entry of A Q^-1 A^T.
    """

    weight: np.ndarray
    free: np.ndarray
    rows: np.ndarray
    gap: np.ndarray
    compliance: float

    @property
    def slack_scale(self) -> float:
        """c, m per unit of multiplier."""
        return self.compliance * float((self.rows**2 / self.weight).sum(axis=1).max(initial=0.0))

    def residual(self, solution: ContactSolution) -> float:
        """Largest of |stationarity| / K, violation in m, and complementarity / K."""
        stiffness = self.weight.max()
        dq, multipliers = solution.step, solution.multipliers
        stationarity = self.weight * (dq - self.free) - self.rows.T @ multipliers  # (d,)
        margin = self.rows @ dq + self.gap + self.slack_scale * multipliers  # (m,)
        return max(
            float(np.abs(stationarity).max(initial=0.0)) / stiffness,
            float((-margin).max(initial=0.0)),
            float((-multipliers).max(initial=0.0)) / stiffness,
            float(np.abs(margin * multipliers).max(initial=0.0)) / stiffness,
        )


@dataclass(frozen=True, eq=False)
class ContactSolution:
    """The step dq, shape (d,), and the multipliers lambda, shape (m,)."""

    step: np.ndarray
    multipliers: np.ndarray


def solve_osqp(problem: ContactProblem) -> ContactSolution:
    """Solve with OSQP, set up afresh: the plain reference.

    The slack is measured in units that make its weight equal to the largest entry of Q.
    """
    import osqp
    from scipy import sparse

    m, d = problem.rows.shape
    if m == 0:
        return ContactSolution(problem.free.copy(), np.zeros(0))
    c = problem.slack_scale
    unit = 1.0 / np.sqrt(c * problem.weight.max()) if c else 1.0
    slack_weight = problem.weight.max() if c else 0.0
    P = sparse.diags(np.concatenate([problem.weight, np.full(m if c else 0, slack_weight)]), format="csc")
    linear = np.concatenate([-problem.weight * problem.free, np.zeros(m if c else 0)])
    A = sparse.csc_matrix(np.hstack([problem.rows, np.eye(m) / unit]) if c else problem.rows)
    solver = osqp.OSQP()
    solver.setup(
        P, linear, A, l=-problem.gap, u=np.full(m, np.inf), verbose=False,
        eps_abs=1e-12, eps_rel=1e-12, max_iter=100_000,
    )  # fmt: skip
    result = solver.solve(raise_error=False)
    return ContactSolution(result.x[:d], np.maximum(-result.y, 0.0))


class DualScratch(NamedTuple):
    """Scratch of the dual problem; the passive set is what may have a positive multiplier."""

    columns: np.ndarray  # (d, m) (A Q^-1/2)^T; contiguous over the rows of A, so that loops over them are
    step: np.ndarray  # (d,) Q^1/2 times the step that the multipliers make
    value: np.ndarray  # (m,) constraint values after that step
    multipliers: np.ndarray  # (m,) lambda
    passive: np.ndarray  # (m,) int64
    G: np.ndarray  # (m, m) A Q^-1 A^T + c I on pairs of passive rows
    L: np.ndarray  # (m, m) Cholesky factor of G on the passive rows, in their order
    inverse: np.ndarray  # (m,) 1 / diagonal of L
    forward: np.ndarray  # (m,) solution of L forward = -r
    z: np.ndarray  # (m,) minimiser on the passive set


@batch_kernel
def make_dual(d, m):
    """Scratch for problems of up to m rows in d unknowns."""
    return DualScratch(
        np.empty((d, m)),
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


@kernel
def _scale_rows(rows, m, weight, compliance, dual):
    """Columns of A Q^-1/2; returns c, the compliance times the largest entry of A Q^-1 A^T."""
    for i in range(m):
        dual.value[i] = 0.0
    for j in range(weight.shape[0]):
        scale = 1.0 / np.sqrt(weight[j])
        for i in range(m):
            entry = rows[i, j] * scale
            dual.columns[j, i] = entry
            dual.value[i] += entry * entry
    largest = 0.0
    for i in range(m):
        largest = max(largest, dual.value[i])
    return compliance * largest


@kernel
def _values(r, m, p, dual):
    """Values r + A Q^-1 A^T lambda of all constraints, from the p passive multipliers."""
    for i in range(m):
        dual.value[i] = r[i]
    for j in range(dual.step.shape[0]):
        step = 0.0
        for k in range(p):
            step += dual.columns[j, dual.passive[k]] * dual.multipliers[dual.passive[k]]
        for i in range(m):
            dual.value[i] += step * dual.columns[j, i]


@kernel
def _enter(i, p, c, dual):
    """Append row i to the passive set: its entries of G."""
    dual.passive[p] = i
    for k in range(p + 1):
        other, total = dual.passive[k], 0.0
        for j in range(dual.step.shape[0]):
            total += dual.columns[j, i] * dual.columns[j, other]
        dual.G[i, other] = dual.G[other, i] = total
    dual.G[i, i] += c


@kernel
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


@kernel
def _substitute(p, dual):
    """Minimiser z on the passive set: L^T z = forward."""
    L, z = dual.L, dual.z
    for i in range(p):
        z[i] = dual.forward[i]
    for i in range(p - 1, -1, -1):
        z[i] *= dual.inverse[i]
        for j in range(i):
            z[j] -= L[i, j] * z[i]


@kernel
def _step_inside(p, dual):
    """Share of the way from the multipliers to z on which none turns negative; above 1 if none does."""
    share = np.inf
    for i in range(p):
        z = dual.z[i]
        if z <= 0.0:
            old = dual.multipliers[dual.passive[i]]
            share = min(share, old / (old - z) if old > z else 0.0)
    return share


@kernel
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


@kernel
def _minimise(r, p, dual):
    """Minimise on the passive set, whose last row is new, dropping rows that turn negative; returns its new size."""
    begin = p - 1
    while True:
        _factor(r, begin, p, dual)
        _substitute(p, dual)
        share = _step_inside(p, dual)
        if share > 1.0:
            for i in range(p):
                dual.multipliers[dual.passive[i]] = dual.z[i]
            return p
        begin, p = _leave(share, p, dual)


@kernel
def solve_dual(rows, m, weight, compliance, r, dual):
    """Exact active-set solution of min 1/2 x^T G x + x^T r over x >= 0 (Lawson and Hanson 1974).

    G = A Q^-1 A^T + c I is only formed on the rows that enter the passive set, and its Cholesky factor
    grows with it.

    Args:
        rows: A, at least (m, d).
        m: number of rows.
        weight: diagonal of Q, shape (d,).
        compliance: c relative to the largest diagonal entry of A Q^-1 A^T.
        r: constraint values at the free step, shape (m,), m.
        dual: scratch from `make_dual`; `dual.multipliers` is the solution.

    Returns:
        Number of rows with a positive multiplier; they stand first in `dual.passive`.
    """
    c = _scale_rows(rows, m, weight, compliance, dual)
    for i in range(m):
        dual.multipliers[i] = 0.0
    p, blocked = 0, -1
    for _ in range(3 * m + 10):
        _values(r, m, p, dual)
        enter, worst = -1, -VIOLATION_TOLERANCE
        for i in range(m):
            if dual.value[i] < worst and dual.multipliers[i] <= 0.0 and i != blocked:
                enter, worst = i, dual.value[i]
        if enter < 0:
            return p
        _enter(enter, p, c, dual)
        p = _minimise(r, p + 1, dual)
        blocked = -1 if dual.multipliers[enter] > 0.0 else enter  # rounding sent it straight out again
    return p

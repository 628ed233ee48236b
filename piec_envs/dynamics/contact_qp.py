"""The contact QP of one quasi-dynamic step (paper eq. 7), and two solvers of it.

    min over dq   1/2 dq^T Q dq - dq^T b  +  sum_i s_i^2 / (2 c)
    s.t.          A dq + phi + s >= 0

Q is diagonal. The slack s is the contact compliance: with multipliers lambda it equals c lambda,
so the dual matrix A Q^-1 A^T gets + c I and the multipliers are unique. c = 0 is the rigid problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piec_envs.kernels import kernel

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


@kernel
def dual_matrix(rows, m, weight, compliance, G):
    """G = A Q^-1 A^T + c I of the first m rows; returns c."""
    largest = 0.0
    for i in range(m):
        for k in range(i + 1):
            total = 0.0
            for j in range(weight.shape[0]):
                total += rows[i, j] * rows[k, j] / weight[j]
            G[i, k] = G[k, i] = total
        largest = max(largest, G[i, i])
    c = compliance * largest
    for i in range(m):
        G[i, i] += c
    return c


@kernel
def _solve_passive(G, r, passive, p, L, z):
    """Solve G z = -r on the rows `passive[:p]` by Cholesky; L and z are scratch and output."""
    for i in range(p):
        a = passive[i]
        for k in range(i + 1):
            total = G[a, passive[k]]
            for j in range(k):
                total -= L[i, j] * L[k, j]
            if i == k:
                L[i, i] = np.sqrt(max(total, 1e-300))
            else:
                L[i, k] = total / L[k, k]
        total = -r[a]
        for j in range(i):
            total -= L[i, j] * z[j]
        z[i] = total / L[i, i]
    for i in range(p - 1, -1, -1):
        total = z[i]
        for j in range(i + 1, p):
            total -= L[j, i] * z[j]
        z[i] = total / L[i, i]


@kernel
def _enter_and_leave(G, r, passive, p, L, z, multipliers):
    """Minimise on the passive set, dropping rows that turn negative; returns the set's new size."""
    while True:
        _solve_passive(G, r, passive, p, L, z)
        step, inside = 1.0, True
        for i in range(p):
            if z[i] <= 0.0:
                inside = False
                old = multipliers[passive[i]]
                step = min(step, old / (old - z[i]) if old > z[i] else 0.0)
        if inside:
            for i in range(p):
                multipliers[passive[i]] = z[i]
            return p
        kept = 0
        for i in range(p):
            a = passive[i]
            value = multipliers[a] + step * (z[i] - multipliers[a])
            multipliers[a] = 0.0
            if z[i] > 0.0 or value > 1e-14 * abs(z[i]):
                multipliers[a] = value
                passive[kept] = a
                kept += 1
        p = kept


@kernel
def solve_dual(G, r, m, multipliers, passive, L, z):
    """Exact active-set solution of min 1/2 x^T G x + x^T r over x >= 0 (Lawson and Hanson 1974).

    Args:
        G: dual matrix, at least (m, m), positive definite.
        r: constraint values at the free step, shape (m,), m.
        m: number of rows.
        multipliers: output, shape (m,).
        passive, L, z: scratch of sizes (m,), (m, m), (m,).

    Returns:
        Number of rows with a positive multiplier; they stand first in `passive`.
    """
    for i in range(m):
        multipliers[i] = 0.0
    p, blocked = 0, -1
    for _ in range(3 * m + 10):
        enter, worst = -1, -VIOLATION_TOLERANCE
        for i in range(m):
            if multipliers[i] > 0.0 or i == blocked:
                continue
            value = r[i]
            for k in range(p):
                value += G[i, passive[k]] * multipliers[passive[k]]
            if value < worst:
                enter, worst = i, value
        if enter < 0:
            return p
        passive[p] = enter
        p = _enter_and_leave(G, r, passive, p + 1, L, z, multipliers)
        blocked = -1 if multipliers[enter] > 0.0 else enter  # rounding sent it straight out again
    return p

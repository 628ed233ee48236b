"""The contact QP of one quasi-dynamic step (paper eq. 11), as a value object, and its reference
solver.

    min over dq   1/2 dq^T Q dq - dq^T b  +  sum_i s_i^2 / (2 c)
    s.t.          A dq + phi + s >= 0

Q is diagonal. The slack s is the contact compliance: with multipliers lambda it equals c lambda,
so the dual matrix A Q^-1 A^T gets + c I and the multipliers are unique. c = 0 is the rigid problem.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

# OSQP's rounds of scaling, its own choice first: some rigid problems it solves without alone
SCALINGS = (10, 0)


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
        dq = solution.step
        multipliers = solution.multipliers
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
    """The answer to a contact problem.

    Args:
        step: dq, shape (d,), rad or m.
        multipliers: lambda, shape (m,), one for each row of A.
        solved: whether the solver says that they solve it.
    """

    step: np.ndarray
    multipliers: np.ndarray
    solved: bool = True


def solve_osqp(problem: ContactProblem) -> ContactSolution:
    """Solve with OSQP, set up afresh: the plain reference.

    The slack is measured in units that make its weight equal to the largest entry of Q. Where OSQP
    finds no solution its x is a large finite number: the step is then zero, and not `solved`.
    """
    import osqp
    from scipy import sparse

    m, d = problem.rows.shape
    if m == 0:
        return ContactSolution(problem.free.copy(), np.zeros(0))
    c = problem.slack_scale
    unit = 1.0 / np.sqrt(c * problem.weight.max()) if c else 1.0
    slack_weight = problem.weight.max() if c else 0.0
    P = sparse.diags(
        np.concatenate([problem.weight, np.full(m if c else 0, slack_weight)]), format="csc"
    )
    linear = np.concatenate([-problem.weight * problem.free, np.zeros(m if c else 0)])
    A = sparse.csc_matrix(np.hstack([problem.rows, np.eye(m) / unit]) if c else problem.rows)
    for scaling in SCALINGS:
        solver = osqp.OSQP()
        solver.setup(
            P, linear, A, l=-problem.gap, u=np.full(m, np.inf), verbose=False,
            eps_abs=1e-12, eps_rel=1e-12, max_iter=100_000, scaling=scaling,
        )  # fmt: skip
        result = solver.solve(raise_error=False)
        if result.info.status_val in (
            osqp.SolverStatus.OSQP_SOLVED,
            osqp.SolverStatus.OSQP_SOLVED_INACCURATE,
        ):
            return ContactSolution(result.x[:d], np.maximum(-result.y, 0.0))
    return ContactSolution(np.zeros(d), np.zeros(m), solved=False)

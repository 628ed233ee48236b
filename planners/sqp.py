"""Static caging by sequential quadratic programming (paper, appendix A.1.2)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import osqp
from scipy import sparse

from piec_envs import (
    CAGING_SCALE,
    CagingProblem,
    InvalidParameterError,
    Postures,
    as_count,
    as_floats,
)
from planners.configuration import Configuration, Incumbent
from planners.posture_starts import Start

OSQP_OPTIONS = {"verbose": False, "eps_abs": 1e-6, "eps_rel": 1e-6, "max_iter": 4000}
SOLVED = (osqp.SolverStatus.OSQP_SOLVED, osqp.SolverStatus.OSQP_SOLVED_INACCURATE)
UNDONE = (1.0, 0.5, 0.25, 0.125)  # shares of an overlap that a step undoes, the first that it can
KEPT = 1e-6  # m; while no violation is larger the step size grows ...
GROW = 1.1  # ... by this factor, up to 1
BROKEN = 1e-3  # m; beyond this violation it shrinks ...
# ... by this factor, down to this
SHRINK = 0.8
LEAST_STEP = 0.1


class Linearised(NamedTuple):
    """The problem around one posture."""

    q: np.ndarray  # (n,)
    g: np.ndarray  # (n,) gradient of the objective -scale T_hat
    phi: np.ndarray  # (m,) constraints, m
    dphi: np.ndarray  # (m, n)
    judged: Postures  # of this one posture


@dataclass(frozen=True)
class SqpConfiguration:
    """Solves a `CagingProblem` by SQP; the same calls and result as `CmaEsConfiguration`.

    Each iteration solves, with OSQP,

        min over D   1/2 D^T H D + g^T D   s.t.   phi + dphi_dq D >= 0,   lower <= q + D <= upper

    and moves by step size times D. The objective is -caging = -0.02 T_hat, so g = -J^T with the row
    J = 0.02 dT_hat_dq, and H = J^T J + 1e-2 I: with one residual, Gauss-Newton is of rank one. The
    step size is multiplied by 0.8, down to 0.1, while a constraint is broken by more than 1e-3 m
    and by 1.1, up to 1, while none is broken by more than 1e-6 m. A search ends at |D| < 1e-2 or
    after 100 iterations.

    Where the paper is silent:

    - The objective's scale decides how far a step goes, since D = -g / (|J|^2 + 1e-2) for a free
      step. In seconds |J| is 10 to 300, so that |D| < 1e-2 would often end the search at once.
    - Linearised constraints of an overlapping posture can contradict each other. Then only a share
      of each overlap has to be undone, the largest of 1, 1/2, 1/4 and 1/8 that can be.
    - Distances and T_hat are far from linear over a radian, so |D_j| <= `trust`.
    - T_hat is a least value over escape routes. Its maximum is a ridge on which the gradient jumps,
      and D never becomes small. After `stall` iterations without a better posture the search goes
      back to the best one and halves `trust`, until D is small. The result is the best feasible
      iterate, not the last.
    - Where the arm is off the fastest way out, T_hat has no gradient and SQP nothing to follow.
      `restarts` begin at the best of a few random postures.

    Args:
        iterations: most iterations of a search.
        restarts: further searches, each from the best of `guesses` random postures.
        guesses: random postures to choose a start from, where none is given.
        kind: how they are drawn: "uniform", "curled", "left" or "right".
        scale: of the objective, 1/s.
        regulariser: added to the diagonal of H.
        trust: largest change of a joint in a step, rad or m.
        stall: iterations without a better posture after which `trust` is halved.
        tolerance: a search ends at a step shorter than this, rad or m.
    """

    iterations: int = 100
    restarts: int = 0
    guesses: int = 40
    kind: str = "curled"
    scale: float = CAGING_SCALE
    regulariser: float = 1e-2
    trust: float = 0.3
    stall: int = 5
    tolerance: float = 1e-2

    def __post_init__(self):
        for name, least in (("iterations", 1), ("restarts", 0), ("stall", 1)):
            as_count(name, getattr(self, name), least)
        for name in ("scale", "regulariser", "trust", "tolerance"):
            if not float(as_floats(name, getattr(self, name), (), InvalidParameterError)) > 0:
                raise InvalidParameterError(f"{name} must be above 0, got {getattr(self, name)}")
        Start(self.guesses, self.kind)

    def solve(
        self, problem: CagingProblem, seed: int | Sequence[int] = 0, start: np.ndarray | None = None
    ) -> Configuration:
        """Search for the best posture; see `CmaEsConfiguration.solve`."""
        starts = Start(self.guesses, self.kind).searches(problem, seed, start, 1 + self.restarts)
        found = []
        for held in starts:
            self._search(held)
            found.append(held)
        best = max(found, key=lambda held: held.rank)
        return dataclasses.replace(best.result(), queries=sum(held.queries for held in found))

    def _search(self, held: Incumbent) -> None:
        """One search from where `held` starts."""
        problem = held.problem
        q = held.start
        size = 1.0
        trust = self.trust
        stalled = 0
        best = None
        for _ in range(self.iterations):
            here = self.linearise(problem, q)
            if held.offer(q[None], here.judged) or best is None:
                best = here
                stalled = 0
            else:
                stalled += 1
            if stalled == self.stall:
                here = best
                trust = trust / 2
                stalled = 0
            size = step_size(size, -float(here.phi.min()))
            step = self.step(problem, here, trust)
            if np.linalg.norm(step) < self.tolerance:
                break
            q = np.clip(here.q + size * step, problem.lower, problem.upper)

    def linearise(self, problem: CagingProblem, q: np.ndarray) -> Linearised:
        """The problem around a posture.

        Args:
            problem: with one pose.
            q: the posture, shape (n,), rad or m.

        Returns:
            Objective and constraints with their gradients there.
        """
        times, slopes = problem.escape_time(q[None])
        phi, dphi = problem.constraints(q[None])
        return Linearised(q, -self.scale * slopes[0], phi[0], dphi[0], Postures(times, phi))

    def step(self, problem: CagingProblem, here: Linearised, trust: float) -> np.ndarray:
        """The step D of the quadratic program around a posture (paper, appendix A.1.2).

        Args:
            problem: gives the joint limits.
            here: the problem around the posture.
            trust: largest change of a joint, rad or m.

        Returns:
            Shape (n,), rad or m; zero where no share of an overlap can be undone.
        """
        n = len(here.q)
        hessian = np.outer(here.g, here.g) + self.regulariser * np.eye(n)  # H = J^T J + 1e-2 I
        rows = sparse.csc_matrix(np.vstack([here.dphi, np.eye(n)]))  # (m + n, n)
        low = np.maximum(problem.lower - here.q, -trust)
        high = np.minimum(problem.upper - here.q, trust)
        upper = np.concatenate([np.full(len(here.phi), np.inf), high])
        for share in UNDONE:
            room = np.where(here.phi < 0, share * here.phi, here.phi)  # (m,) m
            solver = osqp.OSQP()
            lower = np.concatenate([-room, low])
            solver.setup(
                sparse.csc_matrix(np.triu(hessian)), here.g, rows, lower, upper, **OSQP_OPTIONS
            )
            result = solver.solve(raise_error=False)
            if result.info.status_val in SOLVED:
                return np.clip(result.x, low, high)
        return np.zeros(n)


def step_size(size: float, violation: float) -> float:
    """The next step size (paper, appendix A.1.2).

    Args:
        size: the last one, in (0, 1].
        violation: the most by which the posture breaks a constraint, m.

    Returns:
        The size, shrunk by 0.8 above 1e-3 m, grown by 1.1 below 1e-6 m, else as it is.
    """
    if violation > BROKEN:
        return max(LEAST_STEP, SHRINK * size)
    return min(1.0, GROW * size) if violation < KEPT else size

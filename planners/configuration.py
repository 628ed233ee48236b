"""What searches for an enclosing posture hold: the best so far, and what they found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piec_envs import CagingProblem, Postures


@dataclass(frozen=True, eq=False)
class Configuration:
    """What a static caging optimiser found.

    Args:
        posture: joint positions, within the limits, shape (n,), rad or m.
        start: where the search began that found it, shape (n,).
        escape_time: T_hat under the problem's field, s.
        feasible: whether it keeps all constraints.
        object_distance: least distance of a link to the object, m.
        self_distance: least distance of two links that could collide, m; inf if that is left free.
        queries: postures at which the field was asked, gradients included.
        history: T_hat of the best posture so far after each iteration, shape (iterations,), s;
            -inf before the first feasible one.
    """

    posture: np.ndarray
    start: np.ndarray
    escape_time: float
    feasible: bool
    object_distance: float
    self_distance: float
    queries: int
    history: np.ndarray


class Incumbent:
    """The best posture so far: feasible before infeasible, then by value.

    Args:
        problem: what is solved.
        start: where the search begins, shape (n,).
        queries: postures at which the field has been asked before.
    """

    def __init__(self, problem: CagingProblem, start: np.ndarray, queries: int = 0):
        self.problem = problem
        self.start = start
        self.posture = start
        self.rank = (False, -np.inf)
        self.escape_time = -np.inf
        self.phi = np.full(1, -np.inf)
        self.queries = queries
        self.history = list[float]()

    def offer(self, q: np.ndarray, judged: Postures) -> bool:
        """Take the best of some postures if it beats the one that is held; ends an iteration.

        Args:
            q: postures, shape (B, n), rad or m.
            judged: what the problem says of them.

        Returns:
            Whether it does.
        """
        value = judged.value
        feasible = judged.feasible
        best = int(np.argmax(np.where(feasible, value, -np.inf) if feasible.any() else value))
        rank = (bool(feasible[best]), float(value[best]))
        better = rank > self.rank
        if better:
            self.rank = rank
            self.posture = q[best].copy()
            self.phi = judged.phi[best]
            self.escape_time = float(judged.escape_time[best])
        self.queries += len(q)
        self.history.append(self.escape_time if self.rank[0] else -np.inf)
        return better

    def result(self) -> Configuration:
        """What was found."""
        distances = self.phi + self.problem.clearance
        rows = self.problem.object_rows
        return Configuration(
            posture=self.posture,
            start=self.start,
            escape_time=self.escape_time,
            feasible=self.rank[0],
            object_distance=float(distances[:rows].min()),
            self_distance=float(distances[rows:].min(initial=np.inf)),
            queries=self.queries,
            history=np.array(self.history),
        )

"""Static caging by CMA-ES: the posture that encloses the object best (paper, appendix A.1.2)."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import CagingProblem, EscapeField, InvalidParameterError, Setup, as_count, as_floats
from planners.configuration import Configuration, Incumbent
from planners.posture_starts import Start
from planners.strategy import make_strategy

# s/rad^2 of a candidate's distance beyond the joint limits, where CMA-ES may ask
LIMIT_WEIGHT = 1e3
REACHABLE = 0.005  # m; a posture that touches nothing can be reached


@dataclass(frozen=True)
class CmaEsConfiguration:
    """Solves a `CagingProblem` by CMA-ES; constraints are penalised, limits clip.

    Args:
        population: postures in each iteration.
        iterations: iterations of a search.
        restarts: further searches, each from the best of `guesses` random postures.
        sigma: first step size, rad or m.
        guesses: random postures to choose a start from, where none is given.
        kind: how they are drawn: "uniform", "curled", "left" or "right".
    """

    population: int = 100
    iterations: int = 100
    restarts: int = 0
    sigma: float = 0.5
    guesses: int = 1
    kind: str = "uniform"

    def __post_init__(self):
        for name, least in (("population", 2), ("iterations", 1), ("restarts", 0)):
            as_count(name, getattr(self, name), least)
        if not float(as_floats("sigma", self.sigma, (), InvalidParameterError)) > 0:
            raise InvalidParameterError(f"sigma must be above 0, got {self.sigma}")
        Start(self.guesses, self.kind)

    def solve(
        self, problem: CagingProblem, seed: int | Sequence[int] = 0, start: np.ndarray | None = None
    ) -> Configuration:
        """Search for the best posture.

        Args:
            problem: with one pose.
            seed: a number, or several, that seed all randomness.
            start: where the first search begins, shape (n,); None draws one.

        Returns:
            The best posture that keeps all constraints, if any was found, over all searches;
            `queries` counts all of them, `history` is of the best one.

        Raises:
            InvalidStateError: for a start of the wrong shape, not finite or beyond the limits.
        """
        starts = Start(self.guesses, self.kind).searches(problem, seed, start, 1 + self.restarts)
        found = []
        for search, held in enumerate(starts):
            self._search(held, (*np.atleast_1d(seed).tolist(), search))
            found.append(held)
        best = max(found, key=lambda held: held.rank)
        return dataclasses.replace(best.result(), queries=sum(held.queries for held in found))

    def _search(self, held: Incumbent, seed: tuple[int, ...]) -> None:
        """One search; the package's own handling of bounds costs as much as all the rest."""
        problem = held.problem
        strategy = make_strategy(held.start, self.sigma, self.population, seed)
        for _ in range(self.iterations):
            asked = strategy.ask()
            candidates = np.array(asked)  # (population, n)
            q = np.clip(candidates, problem.lower, problem.upper)
            judged = problem.measure(q)
            beyond = ((candidates - q) ** 2).sum(axis=1)
            strategy.tell(asked, (LIMIT_WEIGHT * beyond - judged.value).tolist())
            held.offer(q, judged)


def enclosing_posture(
    setup: Setup,
    field: EscapeField,
    pose: np.ndarray,
    seed: Sequence[int],
    curl: float | None = None,
) -> np.ndarray:
    """A posture that encloses the object of a task at a pose, for planners to start from.

    Random curled postures start CMA-ES, since the objective is flat where the arm is far away.

    Args:
        setup: gives robot and object.
        field: the escape field.
        pose: object pose, shape (3,).
        seed: numbers that seed all randomness.
        curl: 1 or -1 to start from arms curled to the left or right; None takes both.

    Returns:
        Joint positions, shape (n,).
    """
    threads = setup.threads
    problem = CagingProblem(
        setup.robot, setup.plant.object, pose, field, clearance=REACHABLE, threads=threads
    )
    kind = "curled" if curl is None else "left" if curl > 0 else "right"
    search = CmaEsConfiguration(50, iterations=40, restarts=1, sigma=0.3, guesses=500, kind=kind)
    return search.solve(problem, seed).posture

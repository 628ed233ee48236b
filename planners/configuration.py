"""Static caging by CMA-ES: the posture that encloses the object best (paper, appendix A.1.2)."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import (
    CURL,
    CagingProblem,
    EscapeField,
    InvalidParameterError,
    InvalidStateError,
    Postures,
    Setup,
    as_count,
    as_floats,
    check_name,
    get_robot,
)
from planners.strategy import GUESS_STREAM, make_strategy

GUESSES = ("uniform", "curled", "left", "right")
# s/rad^2 of a candidate's distance beyond the joint limits, where CMA-ES may ask
LIMIT_WEIGHT = 1e3
REACHABLE = 0.005  # m; a posture that touches nothing can be reached


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


def check_start(problem: CagingProblem, start: np.ndarray) -> np.ndarray:
    """A start posture, checked.

    Args:
        problem: gives the joint limits.
        start: joint positions, shape (n,), rad or m.

    Returns:
        A copy, shape (n,).

    Raises:
        InvalidStateError: if it has the wrong shape, is not finite, or breaks the joint limits.
    """
    start = as_floats("start posture", start, problem.lower.shape, InvalidStateError)
    if (start < problem.lower).any() or (start > problem.upper).any():
        raise InvalidStateError(
            f"the start posture must be within the joint limits {problem.lower.tolist()} to "
            f"{problem.upper.tolist()}, got {start.tolist()}"
        )
    return start


def draw_postures(
    problem: CagingProblem, kind: str, rows: int, rng: np.random.Generator
) -> np.ndarray:
    """Random postures.

    Args:
        problem: gives the joint limits.
        kind: "uniform" within the limits; "left", "right" or, at random, either that the robot can
            ("curled"): all joints but the first bend that way.
        rows: how many.
        rng: source of randomness.

    Returns:
        Shape (rows, n).

    Raises:
        UnknownNameError: for another kind.
        InvalidParameterError: for a side to which the robot cannot curl.
    """
    check_name("kind of postures", kind, GUESSES)
    q = rng.uniform(problem.lower, problem.upper, (rows, len(problem.lower)))
    if kind != "uniform":
        robot = get_robot(problem.robot)
        sides = robot.curl_sides(CURL[0])
        side = {"left": 1.0, "right": -1.0}.get(kind, rng.choice(sides, (rows, 1)))
        if np.ndim(side) == 0 and side not in sides:
            raise InvalidParameterError(
                f"the limits of {robot.name!r} do not let it curl to the {kind}"
            )
        turning = slice(robot.base_dof + 1, None)
        straight = robot.straight[turning]
        lower = problem.lower[turning]
        upper = problem.upper[turning]
        q[:, turning] = np.clip(straight + np.abs(q[:, turning] - straight) * side, lower, upper)
    return q


@dataclass(frozen=True)
class Start:
    """Where searches begin.

    Args:
        guesses: random postures of which the best is taken.
        kind: how they are drawn; see `draw_postures`.
    """

    guesses: int
    kind: str

    def __post_init__(self):
        as_count("guesses", self.guesses)
        check_name("kind of postures", self.kind, GUESSES)

    def searches(
        self,
        problem: CagingProblem,
        seed: int | Sequence[int],
        start: np.ndarray | None,
        count: int,
    ) -> Iterator[Incumbent]:
        """Where each of some searches begins: the first at `start`, if that is given.

        Args:
            problem: in which they are held.
            seed: a number, or several, that seed the random postures.
            start: joint positions, shape (n,), rad or m; None draws it as all others.
            count: how many searches.

        Yields:
            What holds one search, at its start.

        Raises:
            InvalidStateError: for a start of the wrong shape, not finite or beyond the limits.
        """
        rng = np.random.default_rng([GUESS_STREAM, *np.atleast_1d(seed).tolist()])
        for search in range(count):
            if search == 0 and start is not None:
                yield Incumbent(problem, check_start(problem, start))
                continue
            sample = draw_postures(problem, self.kind, self.guesses, rng)
            best = int(np.argmax(problem.measure(sample).value)) if self.guesses > 1 else 0
            yield Incumbent(problem, sample[best], queries=self.guesses if self.guesses > 1 else 0)


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

"""Where searches for an enclosing posture begin: random postures, curled or not."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import (
    CagingProblem,
    InvalidParameterError,
    InvalidStateError,
    as_count,
    as_floats,
    check_name,
    get_robot,
)
from planners.configuration import Incumbent
from planners.strategy import GUESS_STREAM

GUESSES = ("uniform", "curled", "left", "right")


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
        sides = robot.curl_sides()
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

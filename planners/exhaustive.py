"""Static caging by exhaustive search, for arms of few joints: what the best posture really is.

A field in a disc workspace turns with the arm, so one solve for a posture of the inner joints answers for
every heading of the first joint: the object is turned back instead.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs.episodes.posture import CagingProblem
from piec_envs.errors import InvalidParameterError, as_count, as_floats
from piec_envs.escape.field import REDUCTIONS
from piec_envs.world.robots import get_robot
from planners.configuration import CmaEsConfiguration, Configuration

LEAST_SPACING = 0.005  # rad
CHUNK = 256  # inner postures at once
APART = 2.0  # spacings in some joint between two postures that are polished


@dataclass(frozen=True)
class ExhaustiveConfiguration:
    """Solves a `CagingProblem` by trying every posture of a grid, then CMA-ES from the best of them.

    Args:
        spacing: of the inner joints, rad.
        headings: values of the first joint, evenly spaced within its limits.
        polished: how many of the best postures CMA-ES goes on from.
        population: of that search.
        iterations: of that search.
    """

    spacing: float = 0.05
    headings: int = 180
    polished: int = 10
    population: int = 30
    iterations: int = 40

    def __post_init__(self):
        for name, least in (("headings", 1), ("polished", 1), ("population", 2), ("iterations", 1)):
            as_count(name, getattr(self, name), least)
        if not float(as_floats("spacing", self.spacing, (), InvalidParameterError)) >= LEAST_SPACING:
            raise InvalidParameterError(f"spacing must be at least {LEAST_SPACING} rad, got {self.spacing}")

    def solve(
        self, problem: CagingProblem, seed: int | Sequence[int] = 0, start: np.ndarray | None = None
    ) -> Configuration:
        """Find the best posture; the same call as of the other optimisers.

        Args:
            problem: with one pose, and a robot whose first joint turns about a base that stands still.
            seed: a number, or several, that seed the polish.
            start: not needed: all postures are tried.

        Returns:
            The best posture of all; `start` is the one of the grid that it came from, and `queries`
            counts the solves of the grid and the postures of the polish.

        Raises:
            InvalidParameterError: for another robot, or if all postures of the grid overlap something.
        """
        heads, inner = self._grids(problem)
        values = np.concatenate(
            [self._values(problem, heads, inner[i : i + CHUNK]) for i in range(0, len(inner), CHUNK)]
        )  # (B, H)
        polish = CmaEsConfiguration(self.population, self.iterations, sigma=self.spacing / 2)
        if not np.isfinite(values).any():
            raise InvalidParameterError(
                f"at pose {problem.pose.tolist()} every posture of the grid overlaps {problem.object!r} or itself"
            )
        seeds = np.atleast_1d(seed).tolist()
        found = [polish.solve(problem, (*seeds, k), q) for k, q in enumerate(self._best(heads, inner, values))]
        best = max(found, key=lambda one: (one.feasible, one.escape_time))
        return dataclasses.replace(best, queries=len(inner) + sum(one.queries for one in found))

    def _grids(self, problem: CagingProblem) -> tuple[np.ndarray, np.ndarray]:
        """Headings, shape (H,), and postures of the inner joints, shape (B, n - 1)."""
        first = get_robot(problem.robot).joints[0]
        if problem.pose.ndim != 1 or first.axis[2] == 0 or np.hypot(*first.origin[:2]) > 0:
            raise InvalidParameterError(
                "exhaustive search needs one pose, and a robot whose first joint turns about the base; "
                f"got poses of shape {problem.pose.shape} and {problem.robot!r}"
            )
        lower, upper = problem.lower, problem.upper
        counts = np.ceil((upper - lower) / self.spacing).astype(int) + 1
        axes = [np.linspace(lower[j], upper[j], counts[j]) for j in range(1, len(lower))]
        return np.linspace(lower[0], upper[0], self.headings), np.array(list(itertools.product(*axes)))

    def _values(self, problem: CagingProblem, heads: np.ndarray, inner: np.ndarray) -> np.ndarray:
        """Escape time of each inner posture at each heading, -inf where something overlaps, shape (B, H), s."""
        B, H, turn = len(inner), len(heads), get_robot(problem.robot).joints[0].axis[2] * heads
        c, s, points = np.cos(turn)[:, None], np.sin(turn)[:, None], problem.key_points  # (k, 2)
        turned = np.stack([c * points[:, 0] + s * points[:, 1], c * points[:, 1] - s * points[:, 0]], axis=-1)
        times = problem.field.query(np.broadcast_to(turned.reshape(-1, 2), (B, H * len(points), 2)), _join(0.0, inner))
        value = REDUCTIONS[problem.reduce](times.reshape(B, H, -1), axis=2)
        q = np.stack([_join(head, inner) for head in heads], axis=1)  # (B, H, n)
        phi, _ = problem.constraints(q.reshape(B * H, -1))
        return np.where((phi >= 0).all(axis=1).reshape(B, H), value, -np.inf)

    def _best(self, heads: np.ndarray, inner: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The best postures that are not beside one another, shape (m, n)."""
        kept: list[np.ndarray] = []
        for flat in np.argsort(-values, axis=None, kind="stable"):
            if not np.isfinite(values.ravel()[flat]):
                break
            row, head = np.unravel_index(flat, values.shape)
            q = np.append(heads[head], inner[row])
            if all((np.abs(q - other) > APART * self.spacing).any() for other in kept):
                kept.append(q)
            if len(kept) == self.polished:
                break
        return np.array(kept)


def _join(head: float, inner: np.ndarray) -> np.ndarray:
    """Whole postures, shape (B, n)."""
    return np.column_stack([np.full(len(inner), head), inner])

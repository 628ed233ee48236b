"""Static caging by exhaustive search, for arms of few joints: what the best posture really is.

A field in a disc workspace moves with the base and turns with the arm, so one solve for a posture
of the inner joints answers for every place of the base and every heading of the first joint that
turns: the object is moved back instead.
"""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import (
    REDUCTIONS,
    CagingProblem,
    InvalidParameterError,
    as_count,
    as_floats,
    get_robot,
)
from planners.cma_es_configuration import CmaEsConfiguration
from planners.configuration import Configuration

LEAST_SPACING = 0.005  # rad, m
CANDIDATES = 2**20  # postures at once, which bounds the memory
WORTH = 0.9  # postures below this share of the best value so far are left out
APART = 2.0  # spacings in some joint between two postures that are polished


@dataclass(frozen=True)
class ExhaustiveConfiguration:
    """Solves a `CagingProblem` by trying every posture of a grid, then CMA-ES from the best of
    them.

    Args:
        spacing: of the inner joints, rad.
        headings: values of the first joint that turns, evenly spaced within its limits; 1 is the
            middle, enough for a round object and a base that slides.
        offset: of the places of a sliding base, m.
        polished: how many of the best postures CMA-ES goes on from.
        population: of that search.
        iterations: of that search.
    """

    spacing: float = 0.05
    headings: int = 180
    offset: float = 0.02
    polished: int = 10
    population: int = 30
    iterations: int = 40

    def __post_init__(self):
        for name, least in (("headings", 1), ("polished", 1), ("population", 2), ("iterations", 1)):
            as_count(name, getattr(self, name), least)
        for name in ("spacing", "offset"):
            if (
                not float(as_floats(name, getattr(self, name), (), InvalidParameterError))
                >= LEAST_SPACING
            ):
                raise InvalidParameterError(
                    f"{name} must be at least {LEAST_SPACING}, got {getattr(self, name)}"
                )

    def solve(
        self, problem: CagingProblem, seed: int | Sequence[int] = 0, start: np.ndarray | None = None
    ) -> Configuration:
        """Find the best posture; the same call as of the other optimisers.

        Args:
            problem: with one pose, and a robot whose first joint that turns does so about the base.
            seed: a number, or several, that seed the polish.
            start: not needed, of any shape: all postures are tried.

        Returns:
            The best posture of all; `start` is the one of the grid that it came from, and `queries`
            counts the solves of the grid and the postures of the polish.

        Raises:
            InvalidParameterError: for another robot, or if all postures of the grid overlap
                something.
        """
        outer = outer_postures(problem, self.headings, self.offset)
        inner = inner_postures(problem, self.spacing)
        chunk = max(1, CANDIDATES // len(outer))
        # (B, H), s
        values = np.full((len(inner), len(outer)), -np.inf)
        top = 0.0
        for i in range(0, len(inner), chunk):
            values[i : i + chunk] = self._values(problem, outer, inner[i : i + chunk], WORTH * top)
            top = max(top, float(values[i : i + chunk].max()))
        polish = CmaEsConfiguration(self.population, self.iterations, sigma=self.spacing / 2)
        if not np.isfinite(values).any():
            raise InvalidParameterError(
                f"at pose {problem.pose.tolist()} every posture of the grid overlaps "
                f"{problem.object!r} or itself"
            )
        seeds = np.atleast_1d(seed).tolist()
        found = [
            polish.solve(problem, (*seeds, k), q)
            for k, q in enumerate(self._best(outer, inner, values))
        ]
        best = max(found, key=lambda one: (one.feasible, one.escape_time))
        return dataclasses.replace(best, queries=len(inner) + sum(one.queries for one in found))

    def _values(
        self, problem: CagingProblem, outer: np.ndarray, inner: np.ndarray, least: float
    ) -> np.ndarray:
        """Escape time of each inner posture for each outer one, shape (B, H), s.

        It is -inf where something overlaps, or where it is below `least`, s.
        """
        B = len(inner)
        H = len(outer)
        (*base, head) = outer.T
        turn = get_robot(problem.robot).joints[len(base)].axis[2] * head
        # (H or 1, k, 2)
        points = problem.key_points - (np.column_stack(base)[:, None] if base else 0.0)
        c = np.cos(turn)[:, None]
        s = np.sin(turn)[:, None]
        x = points[..., 0]
        y = points[..., 1]
        turned = np.stack([c * x + s * y, c * y - s * x], axis=-1)  # (H, k, 2)
        q = np.column_stack([np.zeros((B, outer.shape[1])), inner])  # (B, n)
        times = problem.field.query(
            np.broadcast_to(turned.reshape(-1, 2), (B, turned.size // 2, 2)), q
        )
        value = REDUCTIONS[problem.reduce](times.reshape(B, H, -1), axis=2)
        row, place = np.nonzero(value >= least)
        phi, _ = problem.constraints(np.column_stack([outer[place], inner[row]]))
        apart = (phi >= 0).all(axis=1)
        free = np.full((B, H), -np.inf)
        free[row[apart], place[apart]] = value[row[apart], place[apart]]
        return free

    def _best(self, outer: np.ndarray, inner: np.ndarray, values: np.ndarray) -> np.ndarray:
        """The best postures that are not beside one another, shape (m, n)."""
        kept: list[np.ndarray] = []
        near = APART * np.where(
            np.arange(outer.shape[1] + inner.shape[1]) < outer.shape[1] - 1,
            self.offset,
            self.spacing,
        )
        for flat in np.argsort(-values, axis=None, kind="stable"):
            if not np.isfinite(values.ravel()[flat]):
                break
            row, place = np.unravel_index(flat, values.shape)
            q = np.append(outer[place], inner[row])
            if all((np.abs(q - other) > near).any() for other in kept):
                kept.append(q)
            if len(kept) == self.polished:
                break
        return np.array(kept)


def outer_postures(problem: CagingProblem, headings: int, offset: float) -> np.ndarray:
    """Places of the base, if it slides, with headings of the first joint that turns.

    Args:
        problem: with one pose.
        headings: evenly spaced within that joint's limits; 1 is the middle.
        offset: of the places, from which the object's origin is in the workspace, m.

    Returns:
        Shape (H, b + 1), m and rad.

    Raises:
        InvalidParameterError: for several poses, or if that joint is not at the base.
    """
    robot = get_robot(problem.robot)
    lower = problem.lower
    upper = problem.upper
    b = robot.base_dof
    radius = robot.workspace_radius
    if problem.pose.ndim != 1 or b not in (0, 2) or np.hypot(*robot.joints[b].origin[:2]) > 0:
        raise InvalidParameterError(
            "exhaustive search needs one pose, and a robot whose first joint that turns does so "
            "about the base, "
            f"which stands still or slides along x and y; got poses of shape "
            f"{problem.pose.shape} and "
            f"{problem.robot!r}"
        )
    ends = (lower[b], upper[b]) if headings > 1 else ((lower[b] + upper[b]) / 2,) * 2
    heads = np.linspace(*ends, headings)
    places = np.zeros((1, 0))
    if b:
        steps = offset * np.arange(-int(radius / offset), int(radius / offset) + 1)
        places = np.stack(np.meshgrid(steps, steps), axis=-1).reshape(-1, 2)
        places = problem.pose[:2] + places[np.hypot(*places.T) < radius]
    return np.column_stack([np.repeat(places, headings, axis=0), np.tile(heads, len(places))])


def inner_postures(problem: CagingProblem, spacing: float) -> np.ndarray:
    """All postures of the joints after the first that turns, on a grid within their limits.

    Args:
        problem: gives the joint limits.
        spacing: largest step of a joint, rad.

    Returns:
        Shape (B, n - b - 1), rad.
    """
    first = get_robot(problem.robot).base_dof + 1
    lower = problem.lower[first:]
    upper = problem.upper[first:]
    counts = np.ceil((upper - lower) / spacing).astype(int) + 1
    return np.array(list(itertools.product(*map(np.linspace, lower, upper, counts))))

"""A simulated batch of trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from piec_envs.dynamics.protocol import Motion
from piec_envs.model.state import State
from piec_envs.model.terms import MEASURE_COLUMNS


class Measured(NamedTuple):
    """What is measured of one state of each row."""

    link_distance: np.ndarray  # (B, links) signed distance of each link to the object, m
    contact: np.ndarray  # (B, links) whether it touches
    measures: np.ndarray  # (B, len(MEASURES))

    def column(self, name: str) -> np.ndarray:
        """One measure by its name in MEASURES, shape (B,)."""
        return self.measures[:, MEASURE_COLUMNS[name]]

    def put(self, rows: np.ndarray, other: Measured) -> Measured:
        """The same with other rows in place of some.

        Args:
            rows: row numbers.
            other: one row for each of them.

        Returns:
            New arrays.
        """
        copies = [array.copy() for array in self]
        for array, fresh in zip(copies, other, strict=True):
            array[rows] = fresh
        return Measured(*copies)


@dataclass(frozen=True, eq=False)
class Rollout:
    """A simulated batch of trajectories; index 0 of the time axis is the start.

    Args:
        motion: states and contacts.
        measures: distances and cost terms, shape (B, N + 1, len(MEASURES)); see `column`.
        escape_time: object's escape time, held between refreshes, shape (B, N + 1), s; zeros
            without a field.
        final: state after the last step.
    """

    motion: Motion
    measures: np.ndarray
    escape_time: np.ndarray
    final: State

    def column(self, name: str) -> np.ndarray:
        """One measure over time by its name in MEASURES, shape (B, N + 1)."""
        return self.measures[:, :, MEASURE_COLUMNS[name]]

    @property
    def last(self) -> Measured:
        """What is measured of the last states."""
        return Measured(
            self.motion.link_distance[:, -1], self.motion.contact[:, -1], self.measures[:, -1]
        )

    @property
    def cost(self) -> np.ndarray:
        """Stage costs of all steps added up, shape (B,)."""
        costs = self.column("cost")
        return costs[:, 1] if costs.shape[1] == 2 else costs[:, 1:].sum(axis=1)


def join_rollouts(pieces: list[Rollout]) -> Rollout:
    """Concatenate rollouts in time.

    Args:
        pieces: each begins where the one before ends.

    Returns:
        The whole.
    """
    if len(pieces) == 1:
        return pieces[0]
    joined: dict[str, Any] = {}
    motions = [piece.motion for piece in pieces]
    for name in vars(motions[0]):
        parts = [getattr(motion, name) for motion in motions]
        joined[name] = parts[-1] if name == "memory" else _joined(parts, shared=name != "actions")
    measures = _joined([piece.measures for piece in pieces])
    times = _joined([piece.escape_time for piece in pieces])
    return Rollout(Motion(**joined), measures, times, pieces[-1].final)


def _joined(parts: list[np.ndarray], shared: bool = True) -> np.ndarray:
    """Arrays one after the other along their second axis, whose ends two neighbours may share."""
    later = [part[:, 1:] for part in parts[1:]] if shared else parts[1:]
    return np.concatenate([parts[0], *later], axis=1)

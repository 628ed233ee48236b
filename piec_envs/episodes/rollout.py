"""A simulated batch of trajectories."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piec_envs.dynamics.base import Motion
from piec_envs.episodes.state import State
from piec_envs.episodes.tasks import MEASURES


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
        return self.measures[:, :, MEASURES.index(name)]

    @property
    def cost(self) -> np.ndarray:
        """Stage costs of all steps added up, shape (B,)."""
        return self.column("cost")[:, 1:].sum(axis=1)


def join_motions(pieces: list[Motion]) -> Motion:
    """Concatenate motions in time; each begins where the one before ends."""
    joined: dict[str, Any] = {}
    for name in vars(pieces[0]):
        if name == "memory":
            joined[name] = pieces[-1].memory
            continue
        parts = [getattr(piece, name) if k == 0 or name == "actions" else getattr(piece, name)[:, 1:]
                 for k, piece in enumerate(pieces)]  # fmt: skip
        joined[name] = np.concatenate(parts, axis=1)
    return Motion(**joined)

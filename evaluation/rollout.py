"""`evaluate`: many episodes of one policy under one protocol, in batches of rows."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

import piec_envs  # noqa: F401  registers the environments
from evaluation.protocols import get_protocol, is_random
from piec_envs.errors import InvalidParameterError, RecordError, UnknownNameError
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.tasks import MEASURES

MAX_ROWS = 256  # rows of one batch; bounds the memory, changes no result
_MEASURED = ("goal_distance", "min_distance", "mean_distance", "tracking_error")


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What B episodes did; index 0 of the time axis is the start.

    Args:
        spec: env_id, env_kwargs of the plant, protocol, episodes, seed and `every`, as JSON values.
        goal_distance: object's centre to the goal's, shape (B, N + 1), m.
        min_distance: object to the nearest link, shape (B, N + 1), m.
        mean_distance: object to the links, mean over them, shape (B, N + 1), m.
        tracking_error: distance to the reference of that time, shape (B, N + 1), m; 0 without one.
        caging: 0.02 times the escape time, shape (B, N + 1); None without a field.
        contact: links in contact, shape (B, N + 1, links).
        pose: object x, y, angle, shape (B, N + 1, 3), m and rad.
        q_r: joint positions, shape (B, N + 1, n), rad or m.
        d2g: distance to the goal region after the last step, shape (B,), m.
        success: whether the episode counts as a success, shape (B,).
    """

    spec: dict[str, Any]
    goal_distance: np.ndarray
    min_distance: np.ndarray
    mean_distance: np.ndarray
    tracking_error: np.ndarray
    caging: np.ndarray | None
    contact: np.ndarray
    pose: np.ndarray
    q_r: np.ndarray
    d2g: np.ndarray
    success: np.ndarray

    @property
    def episodes(self) -> int:
        """B, the number of episodes that were run."""
        return len(self.d2g)

    @property
    def executions(self) -> int:
        """n, the number of distinct executions: episodes that did the same count once."""
        return len({row.tobytes() for row in np.concatenate([self.pose, self.q_r], axis=2)})

    @property
    def contact_fraction(self) -> np.ndarray:
        """Fraction of the steps in which each link touches the object, shape (B, links)."""
        return self.contact[:, 1:].mean(axis=1)

    def save(self, path: str | os.PathLike, every: int = 1) -> Path:
        """Write the arrays as an npz file.

        Args:
            path: where to.
            every: keep every k-th state alone, for figures.
        """
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        arrays = {name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)}
        kept = {name: value[:, ::every] if value.ndim > 1 else value for name, value in arrays.items()}
        temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        with open(temporary, "wb") as file:
            spec = {**self.spec, "every": self.spec["every"] * every}
            np.savez_compressed(file, spec=json_text(spec), **kept)
        os.replace(temporary, target)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike) -> Evaluation:
        """Read a file of `save`.

        Raises:
            RecordError: if the file is missing, broken or foreign.
        """
        ...


class _Recorder:
    """Collects the states of a batch as it is stepped."""

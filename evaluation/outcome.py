"""What an evaluation saw: arrays over episodes and time, and their file."""

from __future__ import annotations

import json
import os
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from piec_envs import RecordError, files

FORMAT = "piec-evaluation-1"


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What B episodes did; index 0 of the time axis is the start.

    Args:
        spec: env_id, env_kwargs of the plant, protocol, episodes and seed, as JSON values.
        goal_distance: object's centre to the goal's, shape (B, N + 1), m.
        min_distance: object to the nearest link, shape (B, N + 1), m.
        mean_distance: object to the links, mean over them, shape (B, N + 1), m.
        tracking_error: distance to the reference of that time, shape (B, N + 1), m; 0 without one.
        caging: 0.02 times the escape time, shape (B, N + 1); None without a field.
        contact: links in contact, shape (B, N + 1, links).
        pose: object x, y, angle, shape (B, N + 1, 3), m and rad.
        q_r: joint positions, shape (B, N + 1, n), rad or m.
        success: whether the episode counts as a success, shape (B,).
        d2g: distance to the goal region after the last step, shape (B,), m.
        diverged: whether the simulation became unstable, shape (B,); from then on all arrays hold
            their last good entries.
        every: steps between two entries of the time axis, 1 unless read from a thinned file.
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
    success: np.ndarray
    d2g: np.ndarray
    diverged: np.ndarray
    every: int = 1

    @property
    def episodes(self) -> int:
        """B, the number of episodes that were run."""
        return len(self.success)

    @property
    def distinct(self) -> np.ndarray:
        """The episodes that are distinct executions: of those that did the same, the first; shape
        (n,).
        """
        states = np.concatenate([self.pose, self.q_r], axis=2)  # (B, N + 1, 3 + n)
        first = {states[i].tobytes(): i for i in reversed(range(len(states)))}
        return np.array(sorted(first.values()))

    @property
    def contact_fraction(self) -> np.ndarray:
        """Fraction of the steps in which each link touches the object, shape (B, links)."""
        return self.contact[:, 1:].mean(axis=1)

    def expanded(self) -> Evaluation:
        """A thinned evaluation on the full time axis again: numbers interpolated, contacts held."""
        if self.every == 1:
            return self
        steps = np.arange((self.goal_distance.shape[1] - 1) * self.every + 1)  # (N + 1,)
        arrays = {
            name: value
            for name, value in vars(self).items()
            if isinstance(value, np.ndarray) and value.ndim > 1
        }
        full: dict[str, Any] = {
            name: _between(value, steps / self.every) for name, value in arrays.items()
        }
        return replace(self, every=1, **full)

    def save(self, path: str | os.PathLike, every: int = 1) -> Path:
        """Write an npz file, under a temporary name first.

        Args:
            path: where to.
            every: keep each k-th state alone; above 1 also in single precision, enough for figures.

        Returns:
            The path.
        """
        target = Path(path)
        target.parent.mkdir(parents=True, exist_ok=True)
        arrays = {
            name: value for name, value in vars(self).items() if isinstance(value, np.ndarray)
        }
        thinned = (
            arrays if every == 1 else {name: _thin(value, every) for name, value in arrays.items()}
        )
        meta = json.dumps({"spec": self.spec, "every": self.every * every}, sort_keys=True)
        temporary = target.with_name(f".{target.name}.{os.getpid()}.tmp")
        with open(temporary, "wb") as file:
            np.savez_compressed(file, format=FORMAT, meta=meta, **thinned)
        os.replace(temporary, target)
        return target

    @classmethod
    def load(cls, path: str | os.PathLike) -> Evaluation:
        """Read a file of `save`.

        Raises:
            RecordError: if the file is missing, broken or foreign.
        """
        try:
            with np.load(path, allow_pickle=False) as data:
                if str(data["format"]) != FORMAT:
                    raise RecordError(f"{path} has format {data['format']}, but {FORMAT} is needed")
                meta = json.loads(str(data["meta"]))
                arrays = {name: data[name] for name in data.files if name not in ("format", "meta")}
            # Files from before simulations could diverge do not say so.
            stable = np.zeros(len(arrays["success"]), dtype=bool)
            return cls(**meta, **{"caging": None, "diverged": stable, **arrays})
        except RecordError:
            raise
        except files.BROKEN_FILE as error:
            raise RecordError(files.why_unreadable(path, "evaluation", error)) from error


def _thin(value: np.ndarray, every: int) -> np.ndarray:
    """Each k-th entry of the time axis, if there is one, and floats in single precision."""
    kept = value[:, ::every] if value.ndim > 1 else value
    return kept.astype(np.float32) if kept.dtype == np.float64 else kept


def _between(value: np.ndarray, when: np.ndarray) -> np.ndarray:
    """Entries of the time axis (the second one) at fractional indices."""
    low = when.astype(int)
    if value.dtype == bool:
        return value[:, low]
    share = (when - low).reshape(1, -1, *[1] * (value.ndim - 2)).astype(value.dtype)
    high = np.minimum(low + 1, value.shape[1] - 1)
    return value[:, low] + share * (value[:, high] - value[:, low])

"""The `info` of a batch: numbers alone, the same keys at reset and at every step, fresh arrays each time.

What stays the same through an episode, names among it, is told on request: `batch_params`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.episodes.tasks import MEASURES, TRACKING_TOLERANCE
from piec_envs.escape.field import CAGING_SCALE

_COLUMNS = {name: i for i, name in enumerate(MEASURES)}
_REPORTED = tuple((name, i) for name, i in _COLUMNS.items() if name not in ("cost", "tracking_error"))


def batch_info(batch: EpisodeBatch) -> dict:
    """Info of all rows at present.

    Args:
        batch: the episodes.

    Returns:
        Arrays of numbers or truth values, with one entry for each row.
    """
    measures = batch.measures.copy()
    info: dict = {name: measures[:, i] for name, i in _REPORTED}
    success = info["d2g"] == 0
    if batch.tracking:
        info["tracking_error"] = measures[:, _COLUMNS["tracking_error"]]
        info["mean_tracking_error"] = batch.state.error_sum / np.maximum(batch.state.step, 1)
        success &= info["mean_tracking_error"] <= TRACKING_TOLERANCE
    info["is_success"] = success & ~batch.state.diverged
    info["diverged"] = batch.state.diverged.copy()
    info["link_distance"], info["contact_links"] = batch.link_distance.copy(), batch.contact.copy()
    if batch.field is not None:
        info["escape_time"] = batch.state.escape_time.copy()
        info["caging"] = CAGING_SCALE * batch.state.escape_time
    return info


def batch_params(batch: EpisodeBatch) -> dict[str, np.ndarray]:
    """The plant parameters in force in the running episodes, and where their objects started.

    Args:
        batch: the episodes.

    Returns:
        The fields of `PlantParams`, one entry for each row, and "start", the object's pose, shape (B, 3), m and rad.
    """
    return {name: values.copy() for name, values in batch.params_info.items()} | {"start": batch.state.start.copy()}


def row_info(info: Mapping[str, np.ndarray], row: int = 0) -> dict[str, Any]:
    """The info of one row: NumPy's numbers and arrays, the only ones that all of Gymnasium's converters take.

    A truth value is an array without axes, since a NumPy bool counts neither as a number nor as an array.
    """
    entries = {name: value[row] for name, value in info.items()}
    return {name: np.array(entry) if isinstance(entry, np.bool_) else entry for name, entry in entries.items()}


def with_masks(info: Mapping[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The info of a VectorEnv as Gymnasium lays it out.

    Args:
        info: from `batch_info`.
        rows: mask of the rows that the info holds for, shape (B,).

    Returns:
        The arrays, blank in the other rows, each beside its mask under the key with a leading "_".
    """
    masked: dict[str, np.ndarray] = {}
    whole = bool(rows.all())
    for name, value in info.items():
        masked[name] = value
        if not whole:
            masked[name] = np.zeros_like(value)
            masked[name][rows] = value[rows]
        masked[f"_{name}"] = rows.copy()
    return masked

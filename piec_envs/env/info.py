"""The `info` of episodes: numbers alone, the same keys at reset and at every step, fresh arrays
each time.

What stays the same through an episode, names among it, is told on request: `get_params`.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from piec_envs.escape.field import CAGING_SCALE
from piec_envs.model.rollout import Measured
from piec_envs.model.state import State
from piec_envs.model.task import TRACKING_TOLERANCE
from piec_envs.model.terms import MEASURE_COLUMNS, MEASURES

REPORTED = tuple(
    measure.name for measure in MEASURES if measure.name not in ("cost", "tracking_error")
)
_PLACES = tuple((name, MEASURE_COLUMNS[name]) for name in REPORTED)
_D2G = MEASURE_COLUMNS["d2g"]
_ERROR = MEASURE_COLUMNS["tracking_error"]


def motion_info(
    state: State, measured: Measured, tracks: bool, has_field: bool
) -> dict[str, np.ndarray]:
    """Info of all rows of episodes of motion.

    Args:
        state: B rows.
        measured: of these states.
        tracks: whether the task has a reference.
        has_field: whether an escape time is computed.

    Returns:
        Arrays of numbers or truth values, with one entry for each row.
    """
    measures = measured.measures.copy()
    info: dict[str, np.ndarray] = {name: measures[:, i] for name, i in _PLACES}
    success = measures[:, _D2G] == 0
    if tracks:
        info["tracking_error"] = measures[:, _ERROR]
        info["mean_tracking_error"] = state.error_sum / np.maximum(state.step, 1)
        success &= info["mean_tracking_error"] <= TRACKING_TOLERANCE
    info["is_success"] = success & ~state.diverged
    info["diverged"] = state.diverged.copy()
    info["link_distance"] = measured.link_distance.copy()
    info["contact_links"] = measured.contact.copy()
    if has_field:
        info["escape_time"] = state.escape_time.copy()
        info["caging"] = CAGING_SCALE * state.escape_time
    return info


def single_info(state: State, measured: Measured, tracks: bool, has_field: bool) -> dict[str, Any]:
    """`row_info` of `motion_info` for a single row, without its arrays of one entry.

    Args:
        state: one row.
        measured: of this state.
        tracks: whether the task has a reference.
        has_field: whether an escape time is computed.

    Returns:
        NumPy's numbers and arrays.
    """
    measures = measured.measures[0]
    info: dict[str, Any] = {name: measures[i] for name, i in _PLACES}
    success = measures[_D2G] == 0
    if tracks:
        info["tracking_error"] = measures[_ERROR]
        mean = state.error_sum[0] / max(state.step[0], 1)
        info["mean_tracking_error"] = mean
        success = success and mean <= TRACKING_TOLERANCE
    diverged = state.diverged[0]
    info["is_success"] = np.array(success and not diverged)
    info["diverged"] = np.array(diverged)
    info["link_distance"] = measured.link_distance[0].copy()
    info["contact_links"] = measured.contact[0].copy()
    if has_field:
        info["escape_time"] = state.escape_time[0]
        info["caging"] = CAGING_SCALE * state.escape_time[0]
    return info


def row_info(info: Mapping[str, np.ndarray], row: int = 0) -> dict[str, Any]:
    """The info of one row: NumPy's numbers and arrays, the only ones that all of Gymnasium's
    converters take.

    A truth value is an array without axes, since a NumPy bool counts neither as a number nor as an
    array.

    Args:
        info: of all rows.
        row: its number.

    Returns:
        Entries without the axis of rows.
    """
    entries = {name: value[row] for name, value in info.items()}
    return {
        name: np.array(entry) if isinstance(entry, np.bool_) else entry
        for name, entry in entries.items()
    }


def with_masks(info: Mapping[str, np.ndarray], rows: np.ndarray) -> dict[str, np.ndarray]:
    """The info of a VectorEnv as Gymnasium lays it out.

    Args:
        info: of all rows.
        rows: mask of the rows that the info holds for, shape (B,).

    Returns:
        The arrays, blank in the other rows, each beside its mask under the key with a leading "_".
    """
    masked: dict[str, np.ndarray] = {}
    whole = bool(rows.all())
    masks = np.repeat(rows[None], len(info), axis=0)  # (entries, B), one of its own for each
    for (name, value), mask in zip(info.items(), masks, strict=True):
        masked[name] = value
        if not whole:
            masked[name] = np.zeros_like(value)
            masked[name][rows] = value[rows]
        masked[f"_{name}"] = mask
    return masked

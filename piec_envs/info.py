"""The `info` of a batch: the same keys at reset and at every step, fresh arrays each time."""

from __future__ import annotations

import dataclasses

import numpy as np

from piec_envs.core import EpisodeBatch
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.state import PlantParams
from piec_envs.tasks import MEASURES, TRACKING_TOLERANCE

_REPORTED = tuple(name for name in MEASURES if name not in ("cost", "tracking_error"))
_PARAM_NAMES = tuple(field.name for field in dataclasses.fields(PlantParams))


def batch_info(batch: EpisodeBatch) -> dict:
    """Info of all rows at present.

    Args:
        batch: the episodes.

    Returns:
        Arrays with one entry for each row; "params" is a dict of such arrays.
    """
    info: dict = {name: batch.measures[:, MEASURES.index(name)].copy() for name in _REPORTED}
    success = info["d2g"] == 0
    if batch.tracking:
        mean_error = batch.state.error_sum / np.maximum(batch.state.step, 1)
        info["tracking_error"] = batch.measures[:, MEASURES.index("tracking_error")].copy()
        info["mean_tracking_error"] = mean_error
        success &= mean_error <= TRACKING_TOLERANCE
    info["is_success"] = success
    info["link_distance"] = batch.link_distance.copy()
    info["contact_links"] = batch.contact.copy()
    if batch.field is not None:
        info["escape_time"] = batch.state.escape_time.copy()
        info["caging"] = CAGING_SCALE * batch.state.escape_time
    info["params"] = _params_info(batch)
    return info


def _params_info(batch: EpisodeBatch) -> dict:
    params = batch.state.params
    columns: dict = {}
    for name in _PARAM_NAMES:
        values = [getattr(row, name) for row in params]
        columns[name] = np.array(values, dtype=object if isinstance(values[0], str) else float)
    columns["start"] = batch.state.start.copy()
    return columns


def row_info(info: dict) -> dict:
    """The info of the only row of a batch of one, with plain Python scalars."""
    row: dict = {}
    for name, value in info.items():
        if isinstance(value, dict):
            row[name] = row_info(value)
        elif value.ndim == 1:
            row[name] = value[0] if value.dtype == object else value.item()
        else:
            row[name] = value[0]
    return row


def with_masks(info: dict, rows: np.ndarray) -> dict:
    """The info of a VectorEnv as Gymnasium lays it out.

    Args:
        info: from `batch_info`.
        rows: mask of the rows that the info holds for, shape (B,).

    Returns:
        The arrays, blank in the other rows, each beside its mask under the key with a leading "_".
    """
    masked: dict = {}
    for name, value in info.items():
        if isinstance(value, dict):
            masked[name] = with_masks(value, rows)
        else:
            masked[name] = np.full_like(value, None if value.dtype == object else 0)
            masked[name][rows] = value[rows]
        masked[f"_{name}"] = rows.copy()
    return masked

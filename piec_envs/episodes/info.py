"""The `info` of a batch: the same keys at reset and at every step, fresh arrays each time."""

from __future__ import annotations

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
        Arrays with one entry for each row; "params" is a dict of such arrays.
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
    info["params"] = {name: values.copy() for name, values in batch.params_info.items()}
    info["params"]["start"] = batch.state.start.copy()
    return info


def row_info(info: dict) -> dict:
    """The info of the only row of a batch of one, with plain Python scalars."""
    return {
        name: row_info(value) if type(value) is dict else value.item() if value.ndim == 1 else value[0]
        for name, value in info.items()
    }


def with_masks(info: dict, rows: np.ndarray) -> dict:
    """The info of a VectorEnv as Gymnasium lays it out.

    Args:
        info: from `batch_info`.
        rows: mask of the rows that the info holds for, shape (B,).

    Returns:
        The arrays, blank in the other rows, each beside its mask under the key with a leading "_".
    """
    masked: dict = {}
    whole = bool(rows.all())
    for name, value in info.items():
        if isinstance(value, dict):
            masked[name] = with_masks(value, rows)
        elif whole:
            masked[name] = value
        else:
            masked[name] = np.full_like(value, None if value.dtype == object else 0)
            masked[name][rows] = value[rows]
        masked[f"_{name}"] = rows.copy()
    return masked

"""Keeps the escape time of a batch of episodes, and the drift of objects that flee, up to date."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.base import CONTROL_PERIOD
from piec_envs.episodes.state import State
from piec_envs.escape.field import EscapeField, key_points_world, object_escape_time
from piec_envs.world.objects import get_object


def refresh_escape(field: EscapeField, state: State, rows: np.ndarray) -> None:
    """Compute the escape time of some rows, and the drift of those whose object flees.

    Args:
        field: the escape field.
        state: its `escape_time` and `drift` are written.
        rows: row numbers.
    """
    names = np.array([state.params[row].object for row in rows])
    flees = np.array([state.params[row].adversary for row in rows])
    for name in dict.fromkeys(names):
        key_points = get_object(str(name)).key_points
        calm, fleeing = rows[(names == name) & (flees == 0)], rows[(names == name) & (flees > 0)]
        if len(calm):
            state.escape_time[calm] = object_escape_time(field, key_points, state.pose[calm], state.q_r[calm])
        if len(fleeing):
            points = key_points_world(key_points, state.pose[fleeing])  # (rows, k, 2)
            times, slopes = field.point_gradients(points, state.q_r[fleeing])
            state.escape_time[fleeing] = times.mean(axis=-1)
            state.drift[fleeing] = _drift(slopes.mean(axis=-2), field.u_bar * flees[(names == name) & (flees > 0)])


def _drift(slope: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Displacement in one step down the escape time: w = -h u grad T / |grad T| (paper, section 6.1).

    Args:
        slope: gradient of the escape time, shape (rows, 2), s/m.
        speed: shape (rows,), m/s.

    Returns:
        Shape (rows, 2), m; zero where the slope vanishes.
    """
    steepness = np.sqrt(slope[:, 0] ** 2 + slope[:, 1] ** 2)
    scale = np.where(steepness > 0, CONTROL_PERIOD * speed / np.maximum(steepness, 1e-12), 0.0)
    return -scale[:, None] * slope

"""Keeps the escape time of a batch of episodes, and the drift of objects that flee, up to date."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.base import CONTROL_PERIOD, Motion
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


def advance_escape(
    field: EscapeField | None, state: State, motion: Motion, first_step: np.ndarray, every: int
) -> np.ndarray:
    """Escape time along a motion that ended in `state`, refreshed on every k-th step and held between.

    Where an object flees, the motion must end at the next refresh of any row, since the drift follows.

    Args:
        field: the escape field; without one the escape time stays as it is.
        state: holds the escape time, and the drift, of the motion's start; both are brought up to its end.
        motion: of N steps.
        first_step: number of each row's first state, shape (B,).
        every: k.

    Returns:
        Shape (B, N + 1), s.
    """
    times = np.repeat(state.escape_time[:, None], motion.pose.shape[1], axis=1)
    if field is None:
        return times
    if times.shape[1] == 2 or any(params.adversary > 0 for params in state.params):
        refresh_escape(field, state, np.flatnonzero(state.step % every == 0))
        times[:, -1] = state.escape_time
    else:
        times = _along(field, times, state, motion, first_step, every)
        state.escape_time = times[:, -1].copy()
    return times


def _along(field, held, state, motion, first_step, every) -> np.ndarray:
    """Escape times of all refreshes along a motion in one query for each object, shape (B, N + 1), s."""
    times, step = held.copy(), np.arange(held.shape[1])
    due = ((first_step[:, None] + step) % every == 0) & (step > 0)  # (B, N + 1)
    names = np.array([params.object for params in state.params])
    for name in dict.fromkeys(names):
        here = due & (names == name)[:, None]
        key_points = get_object(str(name)).key_points
        times[here] = object_escape_time(field, key_points, motion.pose[here], motion.q_r[here])
    refreshed = np.maximum.accumulate(np.where(due, step, 0), axis=1)
    return np.take_along_axis(times, refreshed, axis=1)


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

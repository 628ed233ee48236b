"""Keeps the escape time of a batch of episodes, and the drift of objects that flee, up to date."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.protocol import CONTROL_PERIOD, Motion
from piec_envs.errors import InvalidParameterError
from piec_envs.escape.field import (
    EscapeField,
    choose_field,
    key_points_world,
    object_escape_time,
)
from piec_envs.model.setup import Setup
from piec_envs.model.state import State
from piec_envs.model.task import PRIORS
from piec_envs.world.objects import get_object


def model_field(setup: Setup) -> EscapeField | None:
    """The escape field of a model, fit for what is asked of it.

    Args:
        setup: of the model.

    Returns:
        The field; None where none is to be computed.

    Raises:
        InvalidParameterError: if the prior or an adversary needs a field that is not there, or a
            leaky one.
    """
    if setup.escape_field is None:
        flees = setup.plant.adversary or setup.randomize.get("adversary")
        if setup.prior == PRIORS.index("caging") or flees:
            raise InvalidParameterError(
                "prior='caging' and adversary need an escape field, but escape_field=None"
            )
        return None
    field = choose_field(setup.escape_field, setup.robot, threads=setup.threads)
    if setup.prior == PRIORS.index("caging") and not field.leak > 0:
        raise InvalidParameterError(
            "the caging prior needs a leaky wall, since behind a hard one the escape time is "
            "infinite; "
            "take leak > 0 or prior=None"
        )
    return field


def refresh_escape(field: EscapeField, state: State, rows: np.ndarray) -> None:
    """Compute the escape time of some rows, and the drift of those whose object flees.

    Args:
        field: the escape field.
        state: its `escape_time` and `drift` are written.
        rows: row numbers.
    """
    calm = rows
    fleeing = rows[:0]
    if len(state.params.fleeing):
        calm = np.setdiff1d(rows, state.params.fleeing, assume_unique=True)
        fleeing = np.intersect1d(rows, state.params.fleeing, assume_unique=True)
    for name, all_rows in state.params.by_object.items():
        key_points = get_object(name).key_points
        here = _among(calm, all_rows, state.rows)
        if len(here) == state.rows:
            state.escape_time = object_escape_time(field, key_points, state.pose, state.q_r)
        elif len(here):
            state.escape_time[here] = object_escape_time(
                field, key_points, state.pose[here], state.q_r[here]
            )
        here = _among(fleeing, all_rows, state.rows)
        if len(here):
            points = key_points_world(key_points, state.pose[here])  # (rows, k, 2)
            times, slopes = field.point_gradients(points, state.q_r[here])
            state.escape_time[here] = times.mean(axis=-1)
            columns = state.params.columns
            begun = state.step[here] >= np.round(columns["adversary_after"][here] / CONTROL_PERIOD)
            speed = field.u_bar * columns["adversary"][here] * begun
            state.drift[here] = _drift(slopes.mean(axis=-2), speed)


def _among(rows: np.ndarray, others: np.ndarray, count: int) -> np.ndarray:
    """The rows that are among others, of `count` in all."""
    return rows if len(others) == count else np.intersect1d(rows, others, assume_unique=True)


def advance_escape(
    field: EscapeField | None, state: State, motion: Motion, first_step: np.ndarray, every: int
) -> np.ndarray:
    """Escape time along a motion that ended in `state`, refreshed on every k-th step and held
    between.

    Where an object flees, the motion must end at the next refresh of any row, since the drift
    follows.

    Args:
        field: the escape field; without one the escape time stays as it is.
        state: holds the escape time, and the drift, of the motion's start; both are brought up to
            its end.
        motion: of N steps.
        first_step: number of each row's first state, shape (B,).
        every: k.

    Returns:
        Shape (B, N + 1), s.
    """
    times = np.repeat(state.escape_time[:, None], motion.pose.shape[1], axis=1)
    if field is None:
        return times
    if times.shape[1] == 2 or len(state.params.fleeing):
        due = np.flatnonzero(state.step % every == 0)
        if len(due):
            state.escape_time = state.escape_time.copy()
            state.drift = state.drift.copy()
            refresh_escape(field, state, due)
            times[:, -1] = state.escape_time
    else:
        times = _along(field, times, state, motion, first_step, every)
        state.escape_time = times[:, -1].copy()
    return times


def _along(field, held, state, motion, first_step, every) -> np.ndarray:
    """Escape times of all refreshes along a motion in one query for each object, shape (B, N + 1),
    s.
    """
    times = held.copy()
    step = np.arange(held.shape[1])
    due = ((first_step[:, None] + step) % every == 0) & (step > 0)  # (B, N + 1)
    for name, rows in state.params.by_object.items():
        here = due
        if len(rows) < state.rows:
            here = np.zeros_like(due)
            here[rows] = due[rows]
        key_points = get_object(name).key_points
        times[here] = object_escape_time(field, key_points, motion.pose[here], motion.q_r[here])
    refreshed = np.maximum.accumulate(np.where(due, step, 0), axis=1)
    return np.take_along_axis(times, refreshed, axis=1)


def _drift(slope: np.ndarray, speed: np.ndarray) -> np.ndarray:
    """Displacement in one step down the escape time: w = -h u grad T / |grad T| (paper, section
    6.1).

    Args:
        slope: gradient of the escape time, shape (rows, 2), s/m.
        speed: shape (rows,), m/s.

    Returns:
        Shape (rows, 2), m; zero where the slope vanishes.
    """
    steepness = np.sqrt(slope[:, 0] ** 2 + slope[:, 1] ** 2)
    scale = np.where(steepness > 0, CONTROL_PERIOD * speed / np.maximum(steepness, 1e-12), 0.0)
    return -scale[:, None] * slope

"""The random displacements of the object, drawn for whole episodes."""

from __future__ import annotations

import numpy as np

from piec_envs.model.state import State

_STREAM = 1  # keeps these random numbers apart from those of the start


def draw_disturbance(state: State, horizon: int) -> np.ndarray | None:
    """Draw each row's displacements from its episode seed, so that every way to run it agrees.

    Args:
        state: gives seeds and parameters.
        horizon: steps of an episode; a longer one begins anew with the first displacement.

    Returns:
        Shape (B, horizon, 2), m; None where no row is disturbed.
    """
    if not state.params.disturbed:
        return None
    noise = np.zeros((state.rows, horizon, 2))
    for i, (seed, params) in enumerate(zip(state.seed, state.params, strict=True)):
        if not params.disturbance:
            continue
        rng = np.random.default_rng([int(seed), _STREAM])
        if params.disturbance_kind == "gaussian":
            noise[i] = params.disturbance * rng.standard_normal((horizon, 2))
        else:
            angle = rng.uniform(-np.pi, np.pi, horizon)
            noise[i] = params.disturbance * np.column_stack([np.cos(angle), np.sin(angle)])
    return noise


def next_displacements(state: State, steps: int, noise: np.ndarray | None) -> np.ndarray | None:
    """The object's free displacement in the next steps.

    Args:
        state: B rows.
        steps: how many.
        noise: from `draw_disturbance`.

    Returns:
        Shape (B, steps, 2), m; None where nothing moves by itself.
    """
    fleeing = state.params.fleeing
    if noise is None and not len(fleeing):
        return None
    drift = np.zeros((state.rows, 2))
    drift[fleeing] = state.drift[fleeing]  # a calm object may still hold an old drift
    displacement = np.repeat(drift[:, None], steps, axis=1)
    if noise is not None:
        when = (state.step[:, None] + np.arange(steps)) % noise.shape[1]  # (B, steps)
        displacement = displacement + noise[np.arange(state.rows)[:, None], when]
    return displacement

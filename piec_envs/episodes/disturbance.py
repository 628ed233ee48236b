"""The random displacements of the object, drawn for whole episodes."""

from __future__ import annotations

import numpy as np

from piec_envs.episodes.state import State

_STREAM = 1  # keeps these random numbers apart from those of the start


def draw_disturbance(state: State, horizon: int) -> np.ndarray | None:
    """Draw each row's displacements from its episode seed, so that every way to run it agrees.

    Args:
        state: gives seeds and parameters.
        horizon: steps of an episode; a longer one begins anew with the first displacement.

    Returns:
        Shape (B, horizon, 2), m; None where no row is disturbed.
    """
    if not any(params.disturbance for params in state.params):
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

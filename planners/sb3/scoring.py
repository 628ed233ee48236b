"""How good a model is on the way: episodes from starts that no training sees."""

from __future__ import annotations

from typing import Any

import numpy as np

from planners.sb3.normalisation import normalise, statistics_of
from planners.sb3.spec import EVALUATION_SEED
from planners.sb3.vec_env import NativeVecEnv


def score(model: Any, venv: NativeVecEnv) -> dict[str, float]:
    """Evaluate a model for one episode in each row, always from the same starts.

    Args:
        model: of Stable-Baselines3.
        venv: rows of their own.

    Returns:
        "success_rate", and the means "return" and "d2g" (m).
    """
    statistics = statistics_of(model.get_vec_normalize_env())
    venv.seed(EVALUATION_SEED)
    observation = venv.reset()
    returns = np.zeros(venv.num_envs)
    running = np.ones(venv.num_envs, dtype=bool)
    finals: list[dict[str, Any]] = [{} for _ in range(venv.num_envs)]
    while running.any():
        action, _ = model.predict(normalise(observation, statistics), deterministic=True)
        observation, reward, ended, infos = venv.step(action)
        returns += running * reward
        for row in np.flatnonzero(ended & running).tolist():
            finals[row] = infos[row]
        running &= ~ended
    return {
        "success_rate": float(np.mean([final["is_success"] for final in finals])),
        "return": float(returns.mean()),
        "d2g": float(np.mean([final["d2g"] for final in finals])),
    }

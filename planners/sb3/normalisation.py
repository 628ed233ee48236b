"""The running statistics of SB3's `VecNormalize` as JSON, so that nothing of them is unpickled."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from stable_baselines3.common.running_mean_std import RunningMeanStd
from stable_baselines3.common.vec_env import VecNormalize

Statistics = dict[str, Any]


def statistics_of(venv: VecNormalize | None) -> Statistics | None:
    """What a `VecNormalize` has counted so far; None without one."""
    if venv is None:
        return None
    return {
        "observation": {name: _as_json(rms) for name, rms in _observation_parts(venv).items()},
        "return": _as_json(venv.ret_rms),
        "clip": float(venv.clip_obs),
        "epsilon": float(venv.epsilon),
    }


def restore_statistics(venv: VecNormalize | None, statistics: Statistics | None) -> None:
    """Put a `VecNormalize` back to where it was.

    Args:
        venv: is changed; nothing happens if it is None.
        statistics: from `statistics_of`; nothing happens if they are None.
    """
    if venv is None or statistics is None:
        return
    for name, rms in _observation_parts(venv).items():
        _restore(rms, statistics["observation"][name])
    _restore(venv.ret_rms, statistics["return"])


def normalise(observation: Any, statistics: Statistics | None) -> Any:
    """Observations in single precision, as the agent saw them in training.

    Args:
        observation: array, or dict of arrays.
        statistics: from `statistics_of`.

    Returns:
        float32, an array or a dict of them as given; only cast where there are no statistics.
    """
    if isinstance(observation, Mapping):
        return {name: _scaled(value, statistics, name) for name, value in observation.items()}
    return _scaled(observation, statistics, "")


def _scaled(value: Any, statistics: Statistics | None, name: str) -> np.ndarray:
    value = np.asarray(value, dtype=np.float32)
    rms = None if statistics is None else statistics["observation"].get(name)
    if statistics is None or rms is None:
        return value
    spread = np.sqrt(np.array(rms["variance"]) + statistics["epsilon"])
    scaled = (value - np.array(rms["mean"])) / spread
    return np.clip(scaled, -statistics["clip"], statistics["clip"]).astype(np.float32)


def _observation_parts(venv: VecNormalize) -> dict[str, RunningMeanStd]:
    """The statistics of each part of an observation; "" is that of an array."""
    if not venv.norm_obs:
        return {}
    return venv.obs_rms if isinstance(venv.obs_rms, dict) else {"": venv.obs_rms}


def _as_json(rms: RunningMeanStd) -> dict[str, Any]:
    return {
        "mean": np.asarray(rms.mean).tolist(),
        "variance": np.asarray(rms.var).tolist(),
        "count": float(rms.count),
    }


def _restore(rms: RunningMeanStd, stored: Mapping[str, Any]) -> None:
    rms.mean = np.array(stored["mean"])
    rms.var = np.array(stored["variance"])
    rms.count = stored["count"]

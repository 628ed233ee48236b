"""Agents of Stable-Baselines3 on the native VectorEnvs: training, files, policies. Needs the extra
`rl`.

Importing this package loads neither torch nor Stable-Baselines3; the first use of a name below
does.
"""

from importlib import import_module
from typing import Any

from planners.sb3.algorithms import ALGORITHMS, check_installed
from planners.sb3.spec import TrainSpec

_LAZY = {
    "Agent": "agent",
    "AgentPolicy": "agent",
    "NativeVecEnv": "vec_env",
    "default_spec": "hyperparameters",
    "open_loop": "nominal",
    "train": "training",
}

__all__ = ["ALGORITHMS", "TrainSpec", "check_installed", *_LAZY]


def __getattr__(name: str) -> Any:
    if name not in _LAZY:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    check_installed()
    return getattr(import_module(f"{__name__}.{_LAZY[name]}"), name)

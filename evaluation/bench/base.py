"""What benchmarks share: sizes, rows of the table, and the timing of a call."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np

import piec_envs  # noqa: F401  registers the environments
from evaluation.studies import PUSH
from piec_envs.episodes.batch import EpisodeBatch

Row = dict[str, Any]


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Args:
        repeats: measurements of which the median is taken.
        motion: steps of a motion in contact.
        rows: rows of a batched motion.
        mujoco_rows: rows of one under MuJoCo.
        states: states whose steps are timed one by one.
        envs: rows of the vector environments.
        env_steps: steps of the native VectorEnv in one measurement, a multiple of ten.
        sync_steps: steps of Gymnasium's SyncVectorEnv, likewise.
        single_steps: steps of a single environment.
        fields: configurations solved in one measurement.
        table: nodes a side and spacing (rad) of a tabulated field.
        planner: arguments of `CmaEsPlanner` for a full plan.
        plans: how many are ranked with the planner's k and with k = 1.
        action_repeats: control steps of an action, while a learner collects rollouts.
    """

    repeats: int = 5
    motion: int = 1000
    rows: int = 64
    mujoco_rows: int = 100
    states: int = 1000
    envs: int = 256
    env_steps: int = 200
    sync_steps: int = 20
    single_steps: int = 1000
    fields: int = 100
    table: tuple[int, float] = (101, 0.07)
    planner: tuple[tuple[str, Any], ...] = (("restarts", 1), ("robust_iterations", 0))
    plans: int = 50
    action_repeats: tuple[int, ...] = (1, 10)


QUICK = Sizes(
    repeats=2,
    motion=200,
    rows=4,
    mujoco_rows=2,
    states=5,
    envs=8,
    env_steps=10,
    sync_steps=10,
    single_steps=50,
    fields=5,
    table=(33, 0.4),
    planner=(("restarts", 1), ("robust_iterations", 0), ("iterations", 2), ("population", 4), ("start", "rest")),
    plans=5,
    action_repeats=(10,),
)


def median_seconds(call: Callable[[], Any], repeats: int) -> float:
    """Median time of a call, after one that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def row(benchmark: str, result: float, unit: str, wanted: str = "", note: str = "") -> Row:
    """One line of the table."""
    return {"benchmark": benchmark, "result": float(result), "unit": unit, "wanted": wanted, "note": note}


def make_batch(**kwargs: Any) -> EpisodeBatch:
    """The batch behind a fresh single environment, started."""
    env: Any = gym.make(PUSH, disable_env_checker=True, **kwargs).unwrapped
    env.reset(seed=0)
    return env.batch

"""Time of steps through Gymnasium's interface alone, so that any commit can be measured: prints
JSON, us.

CPU time of the process for single environments, wall time for each row of native vector
environments and rollouts.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import gymnasium as gym
import numpy as np

import piec_envs  # noqa: F401  registers the environments

PUSH = "piec_envs/PlanarArmPush-v0"
SINGLE: dict[str, tuple[str, dict[str, Any]]] = {
    "single, no field": (PUSH, {"escape_field": None}),
    "single, defaults": (PUSH, {}),
    "single, MobileFrankaPush": ("piec_envs/MobileFrankaPush-v0", {}),
}
ROWS = {"256 rows, no field": (256, {"escape_field": None}), "256 rows, defaults": (256, {})}
REPEATS = 7


def median_us(call: Callable[[], Any], times: int, clock: Callable[[], float]) -> float:
    """Median time of a call over REPEATS runs of `times` calls, us."""
    found = []
    for _ in range(REPEATS):
        begin = clock()
        for _ in range(times):
            call()
        found.append((clock() - begin) / times)
    return 1e6 * float(np.median(found))


def single(env_id: str, kwargs: dict[str, Any]) -> float:
    """CPU time of a step under random actions, us."""
    env = gym.make(env_id, **kwargs)
    actions = iter(np.random.default_rng(0).uniform(-1, 1, (100_000, *env.action_space.shape)))
    env.reset(seed=0)
    for _ in range(50):
        env.step(next(actions))
    return median_us(lambda: env.step(next(actions)), 130, time.process_time)


def rows(count: int, kwargs: dict[str, Any]) -> tuple[float, float]:
    """Wall time of a row's step, of the native vector environment and of `rollout` with the same
    actions, us.
    """
    envs = gym.make_vec(PUSH, num_envs=count, vectorization_mode="vector_entry_point", **kwargs)
    actions = np.random.default_rng(0).uniform(-1, 1, (40, *envs.action_space.shape))
    envs.reset(seed=0)
    state = envs.unwrapped.get_state()
    controls = np.ascontiguousarray(actions.transpose(1, 0, 2))

    def episode() -> None:
        envs.unwrapped.set_state(state)
        for action in actions:
            envs.step(action)

    episode()
    native = median_us(episode, 1, time.perf_counter)
    envs.unwrapped.rollout(state, controls=controls)
    rolled = median_us(
        lambda: envs.unwrapped.rollout(state, controls=controls), 1, time.perf_counter
    )
    return native / (count * len(actions)), rolled / (count * len(actions))


if __name__ == "__main__":
    told = {name: single(*case) for name, case in SINGLE.items()}
    for name, case in ROWS.items():
        told[f"native, {name}"], told[f"rollout, {name}"] = rows(*case)
    print(json.dumps(told))

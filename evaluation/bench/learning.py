"""How quickly a learner gets its experience."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.bench.base import Row, Sizes, row
from evaluation.studies import PUSH
from piec_envs import MissingDependencyError
from planners.sb3.algorithms import check_installed

PROCESSES = 2
NOISE = {"start_noise": (0.01, 0.05)}


def rollout_collection(sizes: Sizes) -> list[Row]:
    """Control steps per second while PPO collects rollouts: native rows against `SubprocVecEnv`.

    Counted once over the time in the environment's `step` alone, and once over the whole
    collection, in which the policy chooses actions and the buffer is filled. Updates count in
    neither; torch has one thread.
    """
    try:
        check_installed()
    except MissingDependencyError as error:
        return [
            {**row("PPO rollouts, native over SubprocVecEnv", np.nan, "times"), "note": str(error)}
        ]
    from stable_baselines3.common.vec_env import SubprocVecEnv

    from planners.sb3 import NativeVecEnv

    rows: list[Row] = []
    for repeat in sizes.action_repeats:
        kwargs: dict[str, Any] = {**NOISE, "action_repeat": repeat}
        # The prefix makes Gymnasium import the package that registers the id, in a process that has
        # nothing of ours.
        single = partial(gym.make, f"piec_envs:{PUSH}", threads=1, dtype="float32", **kwargs)
        rates = []
        for venv in (NativeVecEnv(PUSH, sizes.envs, **kwargs), SubprocVecEnv([single] * PROCESSES)):
            rates.append([repeat * rate for rate in _rates(venv, sizes.env_steps, sizes.repeats)])
            venv.close()
        label = f"PPO rollouts, {repeat} step{'s' * (repeat > 1)} an action"
        for part, native, processes in zip(
            ("environment alone", "whole collection"), *rates, strict=True
        ):
            rows += [
                row(
                    f"{label}, {part}, native",
                    native,
                    "steps/s",
                    "",
                    f"{sizes.envs} rows, all cores",
                ),
                row(
                    f"{label}, {part}, SubprocVecEnv",
                    processes,
                    "steps/s",
                    "",
                    f"{PROCESSES} processes",
                ),
                row(f"{label}, {part}, native over SubprocVecEnv", native / processes, "times"),
            ]
    return rows


def _rates(venv: Any, steps: int, repeats: int) -> tuple[float, float]:
    """Actions per second of `step` alone and of whole rollouts; medians, after one rollout that is
    not counted.
    """
    import torch
    from stable_baselines3 import PPO

    size = steps * venv.num_envs
    model = PPO("MlpPolicy", venv, n_steps=steps, batch_size=size, n_epochs=1, device="cpu", seed=0)
    alone = _timed(venv, "step")
    whole = _timed(model, "collect_rollouts")
    threads = torch.get_num_threads()
    # more would wait for each other over a network this small, and take cores from the steps
    torch.set_num_threads(1)
    try:
        model.learn((repeats + 1) * size)
    finally:
        torch.set_num_threads(threads)
    seconds = np.reshape(alone, (repeats + 1, steps)).sum(axis=1)
    return size / float(np.median(seconds[1:])), size / float(np.median(whole[1:]))


def _timed(owner: Any, name: str) -> list[float]:
    """A list that grows by the seconds of each call of this method from now on."""
    call = getattr(owner, name)
    seconds = list[float]()

    def timed(*args: Any, **kwargs: Any) -> Any:
        """Call, and note the time."""
        begin = time.perf_counter()
        result = call(*args, **kwargs)
        seconds.append(time.perf_counter() - begin)
        return result

    setattr(owner, name, timed)
    return seconds

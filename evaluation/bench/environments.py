"""Environments, single and vector, and batched rollouts."""

from __future__ import annotations

import os
import time
from collections.abc import Iterator
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.bench.base import Row, Sizes, make_started, median_seconds, row
from evaluation.studies import PUSH


def vector_steps(sizes: Sizes) -> list[Row]:
    """Steps per second of the native VectorEnv and of single environments stepped in turn."""
    rows = []
    for label, kwargs, wanted in (
        ("no field", {"escape_field": None}, "at least 50"),
        ("defaults", {}, ""),
    ):
        native = gym.make_vec(PUSH, num_envs=sizes.envs, **kwargs)
        turns = gym.make_vec(PUSH, num_envs=sizes.envs, vectorization_mode="sync", **kwargs)
        rates = [
            _env_rate(native, sizes.env_steps, sizes.repeats),
            _env_rate(turns, sizes.sync_steps, min(sizes.repeats, 3)),
        ]
        turns.close()
        rows += [
            row(
                f"native VectorEnv, {label}",
                rates[0],
                "steps/s",
                "",
                f"{sizes.envs} rows, all cores",
            ),
            row(f"SyncVectorEnv, {label}", rates[1], "steps/s", "", f"{sizes.envs} rows"),
            row(f"native over Sync, {label}", rates[0] / rates[1], "times", wanted),
        ]
    return rows


def _env_rate(envs: Any, steps: int, repeats: int) -> float:
    """Env steps per second, resets not counted."""
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, *envs.action_space.shape))

    def run() -> None:
        """Step through all actions."""
        for action in actions:
            envs.step(action)

    return steps * envs.num_envs / median_seconds(run, repeats)


def single_step(sizes: Sizes) -> list[Row]:
    """One step of a single environment as `gym.make` gives it."""
    rows = []
    for label, kwargs, wanted in (
        ("no field", {"escape_field": None}, "at most 60"),
        ("defaults", {}, ""),
    ):
        env = gym.make(PUSH, **kwargs)
        actions = np.random.default_rng(0).uniform(-1, 1, (sizes.single_steps, 4))
        times = []
        for _ in range(sizes.repeats + 1):
            env.reset(seed=0)
            begin = time.perf_counter()
            for action in actions:
                env.step(action)
            times.append((time.perf_counter() - begin) / len(actions))
        rows.append(
            row(f"single env step, {label}", 1e6 * float(np.median(times[1:])), "us", wanted)
        )
    return rows


def rollout_threads(sizes: Sizes) -> list[Row]:
    """Steps per second of the batched rollout on one thread and on two."""
    rows: list[Row] = []
    controls = np.random.default_rng(0).uniform(0.4, 0.6, (sizes.envs, sizes.env_steps, 4))
    for label, kwargs in (("no field", {"escape_field": None}), ("defaults", {})):
        for threads in _thread_counts():
            model, start = make_started(threads=threads, **kwargs)
            call = partial(model.rollout, start, controls)
            rate = sizes.envs * sizes.env_steps / median_seconds(call, sizes.repeats)
            rows.append(
                row(
                    f"rollout, {label}, threads: {threads}",
                    rate,
                    "steps/s",
                    "",
                    f"{sizes.envs} rows",
                )
            )
    return rows


def _thread_counts() -> Iterator[int]:
    """One thread, and two where there are as many cores."""
    yield 1
    if (os.cpu_count() or 1) > 1:
        yield 2

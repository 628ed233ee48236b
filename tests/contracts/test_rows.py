"""Row i of the native VectorEnv is the single environment, to the last bit."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from piec_envs.env.registry import ENVS, MOTIONS

NOISY = {"disturbance": 0.005, "adversary": 0.3, "start_noise": (0.01, 0.05), "object": "square"}
STATIC = tuple(env_id for env_id in ENVS if env_id not in MOTIONS)  # one step, no plant
MIXED = {
    "dynamics": ["quasi_dynamic", "mujoco"],
    "object": ["circle", "square"],
    "friction": [0.1, 0.9],
}
ROW_CHOICES = [
    {},
    NOISY,
    {"goal_conditioned": True, **NOISY},
    {"randomize": {"friction": [0.1, 0.9]}},
    {"dynamics": "mujoco", **NOISY},
    {"randomize": MIXED},
    {
        "dynamics": "mujoco",
        "start": "home",
        "randomize": {
            "object": ["a4_box", "a4_box_roll_1"],
            "mass": [0.5, 2.0],
            "delay": [0.0, 0.1],
        },
    },
]
EVERY_ROW = [(env_id, choice) for env_id in MOTIONS for choice in ROW_CHOICES] + [
    (env_id, choice)
    for env_id in STATIC
    for choice in ({}, {"object": "square", "dtype": "float32"})
]


def same(a, b) -> bool:
    """Equal to the last bit, through dicts."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(a, b)


def row_of(value, i):
    return (
        {k: row_of(v, i) for k, v in value.items() if not k.startswith("_")}
        if isinstance(value, dict)
        else value[i]
    )


@pytest.mark.parametrize(("env_id", "choice"), EVERY_ROW, ids=str)
def test_vector_row_equals_single_env(env_id, choice):
    envs = gym.make_vec(env_id, num_envs=3, **choice)
    singles = [gym.make(env_id, **choice) for _ in range(3)]
    observation, info = envs.reset(seed=5)
    for i, env in enumerate(singles):
        one, one_info = env.reset(seed=5 + i)
        assert same(row_of(observation, i), one) and same(row_of(info, i), one_info)
    rng = np.random.default_rng(0)
    ended = np.zeros(3, dtype=bool)
    for t in range(45):
        actions = rng.uniform(-1, 1, envs.action_space.shape)
        observation, reward, terminated, truncated, info = envs.step(actions)
        for i, env in enumerate(singles):
            if ended[i]:  # the row begins anew in this step
                one, one_info = env.reset()
                one_reward = 0.0
                one_terminated = False
                one_truncated = False
            else:
                one, one_reward, one_terminated, one_truncated, one_info = env.step(actions[i])
            assert same(row_of(observation, i), one) and same(row_of(info, i), one_info), t
            assert (reward[i], terminated[i], truncated[i]) == (
                one_reward,
                one_terminated,
                one_truncated,
            )
        ended = terminated | truncated
    assert ended.any() == (env_id in STATIC)


@pytest.mark.parametrize("env_id", ["piec_envs/PlanarArmPush-v0", *STATIC])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_autoreset_equals_sync_vector_env(env_id, mode):
    """The native VectorEnv against Gymnasium's own, episodes of 12 steps or one, infos included."""
    choice = {**NOISY, "escape_every": 5, "max_episode_steps": 12} if env_id in MOTIONS else {}
    native = gym.make_vec(env_id, num_envs=2, autoreset_mode=mode, **choice)
    plain = gym.make_vec(
        env_id,
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **choice,
    )
    assert native.metadata["autoreset_mode"] == mode
    a = native.reset(seed=3)
    b = plain.reset(seed=3)
    assert same(a[0], b[0]) and same(a[1], b[1])
    rng = np.random.default_rng(1)
    for _ in range(30):
        actions = rng.uniform(-1, 1, native.action_space.shape)
        a = native.step(actions)
        b = plain.step(actions)
        for x, y in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(x, y)
        assert a[4].keys() == b[4].keys()
        for key in a[4]:
            if key == "final_obs":
                assert all(
                    same(x, y) for x, y in zip(a[4][key], b[4][key], strict=True) if x is not None
                )
            else:
                assert same(a[4][key], b[4][key]), key
        ended = a[2] | a[3]
        if mode == AutoresetMode.DISABLED and ended.any():
            a = native.reset(options={"reset_mask": ended})
            b = plain.reset(options={"reset_mask": ended.copy()})
            assert same(a[0], b[0]) and same(a[1], b[1])


@pytest.mark.parametrize(("dynamics", "rows"), [("quasi_dynamic", 256), ("mujoco", 8)])
def test_async_vector_env_works_after_a_batched_call(dynamics, rows):
    """A forked child must not wait for the threads of its parent."""
    env_id = "piec_envs/PlanarArmPush-v0"
    choice = {"dynamics": dynamics}
    native = gym.make_vec(env_id, num_envs=rows, **choice)
    native.reset(seed=0)
    native.step(native.action_space.sample())
    how = {"context": "fork", "shared_memory": False}
    forked = gym.make_vec(
        env_id, num_envs=2, vectorization_mode="async", vector_kwargs=how, **choice
    )
    observation, _ = forked.reset(seed=0)
    assert observation.shape == (2, 23)
    stepped = forked.step(np.ones((2, 4)))[0]
    forked.close()
    here = gym.make_vec(env_id, num_envs=2, **choice)
    here.reset(seed=0)
    np.testing.assert_array_equal(stepped, here.step(np.ones((2, 4)))[0])

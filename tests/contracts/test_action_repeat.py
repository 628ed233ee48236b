"""Contracts of `action_repeat`, single and vector."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import data_equivalence

import piec_envs  # noqa: F401  registers the environments

PUSH = "piec_envs/PlanarArmPush-v0"
REPEATED = [
    (
        PUSH,
        {"disturbance": 0.005, "adversary": 0.3, "start_noise": (0.01, 0.05), "object": "square"},
    ),
    (PUSH, {"goal_conditioned": True, "escape_every": 3}),
    (PUSH, {"dynamics": "mujoco", "escape_field": None, "disturbance": 0.005}),
    ("piec_envs/MobileFrankaTrack-v0", {"geometry": "capsules", "escape_field": None}),
]


@pytest.mark.parametrize(("env_id", "choice"), REPEATED, ids=str)
def test_a_repeated_action_is_that_many_steps(env_id, choice):
    repeat = 8
    held = gym.make(env_id, action_repeat=repeat, **choice)
    plain = gym.make(env_id, **choice)
    assert data_equivalence(held.reset(seed=3)[0], plain.reset(seed=3)[0], exact=True)
    rng = np.random.default_rng(1)
    for _ in range(6):
        action = rng.uniform(-1, 1, held.action_space.shape)
        observation, reward, _, _, info = held.step(action)
        steps = [plain.step(action) for _ in range(repeat)]
        assert data_equivalence(observation, steps[-1][0], exact=True)
        assert data_equivalence(info, steps[-1][4], exact=True)
        rewards = [step[1] for step in steps]
        assert reward == pytest.approx(
            rewards[-1] if choice.get("goal_conditioned") else sum(rewards), rel=1e-12
        )


def test_repeated_actions_end_at_the_horizon():
    choice = {"action_repeat": 125, "escape_field": None}
    env = gym.make(PUSH, **choice)
    envs = gym.make_vec(PUSH, num_envs=2, **choice)
    env.reset(seed=0)
    envs.reset(seed=0)
    for action in range(1, 9):
        *_, truncated, _ = env.step(np.zeros(4))
        cut = envs.step(np.zeros((2, 4)))[3]
        assert truncated == (action == 8) and (cut == truncated).all()
    envs.set_state(envs.get_state())
    observation, _, _, cut, _ = envs.step(np.zeros((2, 4)))  # the step after the end begins anew
    assert not cut.any() and (observation[:, -1] == 0).all()

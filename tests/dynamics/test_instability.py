"""Where MuJoCo warns that its simulation is unstable: the row rests, diverged."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

PUSH = "piec_envs/PlanarArmPush-v0"


def unstable(state):
    """The same state with a velocity that the engine warns of."""
    state.memory[0] = state.memory[0].copy()
    state.memory[0][-1] = 1e12
    return state


@pytest.fixture
def away(tmp_path, monkeypatch):
    """MuJoCo leaves a log of its warnings in the working folder."""
    monkeypatch.chdir(tmp_path)


@pytest.mark.usefixtures("away")
def test_an_instability_ends_the_row():
    env = gym.make(PUSH, dynamics="mujoco", escape_field=None)
    env.reset(seed=0)
    _, _, _, truncated, info = env.step(np.ones(4))
    assert not truncated and not info["diverged"]
    before = env.unwrapped.get_state()
    env.unwrapped.set_state(unstable(before.copy()))
    observation, reward, terminated, truncated, info = env.step(np.ones(4))
    assert truncated and not terminated and info["diverged"] and not info["is_success"]
    assert observation in env.observation_space and np.isfinite(reward)
    # its last good state
    np.testing.assert_array_equal(env.unwrapped.get_state().pose, before.pose)
    assert env.step(np.ones(4))[4]["diverged"]  # it rests until reset
    assert not env.reset(seed=0)[1]["diverged"]
    assert not env.step(np.ones(4))[3]


@pytest.mark.usefixtures("away")
def test_only_the_unstable_row_ends_and_begins_anew():
    envs = gym.make_vec(PUSH, num_envs=2, dynamics="mujoco", escape_field=None)
    envs.reset(seed=0)
    envs.step(np.ones((2, 4)))
    envs.unwrapped.set_state(unstable(envs.unwrapped.get_state()))
    *_, truncated, info = envs.step(np.ones((2, 4)))
    assert truncated.tolist() == [True, False] == info["diverged"].tolist()
    *_, truncated, info = envs.step(np.ones((2, 4)))
    assert not truncated.any() and not info["diverged"].any()
    assert envs.unwrapped.get_state().step.tolist() == [0, 3]


@pytest.mark.usefixtures("away")
def test_a_rollout_holds_what_diverged():
    env = gym.make(PUSH, dynamics="mujoco", escape_field=None).unwrapped
    env.reset(seed=0)
    env.step(np.ones(4))
    bad = unstable(env.get_state())
    rollout = env.rollout(bad, controls=np.ones((2, 5, 4)))
    assert rollout.motion.diverged[:, 1:].all() and not rollout.motion.diverged[:, 0].any()
    assert rollout.final.diverged.all()
    np.testing.assert_array_equal(
        rollout.motion.pose, np.repeat(bad.pose[None], 6, axis=1).repeat(2, axis=0)
    )
    assert np.isfinite(rollout.measures).all()

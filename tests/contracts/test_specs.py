"""What a VectorEnv draws from, what specs keep, and how long an episode is."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from piec_envs.env.makers import PlanarArmCage, PlanarArmPush
from piec_envs.model.task import HORIZON
from piec_envs.wrappers import FrictionMismatch

PUSH = "piec_envs/PlanarArmPush-v0"
CAGE = "piec_envs/PlanarArmCage-v0"
WITHOUT_FIELD = {"escape_field": None}
COARSE = {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}}


def native(env_id, **choice):
    """Two rows, made at once."""
    return gym.make_vec(
        env_id, num_envs=2, **{**(COARSE if env_id == CAGE else WITHOUT_FIELD), **choice}
    )


def synchronous(env_id, **choice):
    return gym.make_vec(env_id, num_envs=2, vectorization_mode="sync", **WITHOUT_FIELD, **choice)


# --- generators and specs ----------------------------------------------------------------------


@pytest.mark.parametrize("env_id", [PUSH, CAGE])
def test_a_vector_env_has_a_generator_of_its_own_that_a_seed_decides(env_id):
    envs = native(env_id)
    for seed, number in ((3, 3), ([5, 6], -1), ([5, None], -1)):
        draws = []
        for _ in range(2):
            observation, _ = envs.reset(seed=seed)
            draws.append(envs.np_random.random(4))
            assert envs.np_random_seed == number
            if None not in np.atleast_1d(np.array(seed, dtype=object)):
                envs.np_random.random(100)  # leaves the episodes as they are
                np.testing.assert_array_equal(observation, envs.reset(seed=seed)[0])
        np.testing.assert_array_equal(*draws)
    before = envs.np_random
    envs.reset()
    assert envs.np_random is before and isinstance(before, np.random.Generator)


ARRAYS = {
    "goal": np.array([-0.2, 0.4], dtype=np.float32),
    "start": np.array([0.1, 0.2, 0.3, 0.4]),
    "start_noise": np.array([0.01, 0.05]),
    "friction": np.float32(0.25),
    "disturbance": np.array(0.001),
    "escape_every": np.int64(7),
    "action_repeat": np.int32(2),
    "threads": np.int64(1),
    "weights": {"task": np.float32(500.0), "saturation": np.inf},
    "randomize": {"friction": np.array([0.25, 0.75]), "object": np.array(["circle", "square"])},
    "dtype": np.dtype("float32"),
}


@pytest.mark.parametrize("make", [gym.make, native])
def test_arrays_among_the_arguments_are_taken_and_kept_as_json(make):
    choice = {**ARRAYS, **({} if make is native else WITHOUT_FIELD)}
    env = make(PUSH, **choice)
    text = env.spec.to_json()
    spec = gym.envs.registration.EnvSpec.from_json(text)
    again = (gym.make if make is gym.make else gym.make_vec)(spec)
    np.testing.assert_array_equal(env.reset(seed=1)[0], again.reset(seed=1)[0])
    assert again.unwrapped.config == env.unwrapped.config
    assert json.loads(text)["kwargs"]["goal"] == [pytest.approx(-0.2), pytest.approx(0.4)]


def test_arrays_enumerations_and_paths_stand_in_specs_as_json_has_them(tmp_path):
    cage = gym.make(CAGE, pose=np.array([0.2, 0.1, 0.5]))
    assert gym.envs.registration.EnvSpec.from_json(cage.spec.to_json()).kwargs["pose"] == [
        0.2,
        0.1,
        0.5,
    ]
    envs = native(PUSH, autoreset_mode=AutoresetMode.SAME_STEP)
    assert json.loads(envs.spec.to_json())["kwargs"]["autoreset_mode"] == "SameStep"
    wrapped = FrictionMismatch(gym.make(PUSH, **WITHOUT_FIELD), friction=np.float32(0.25))
    assert gym.make(gym.envs.registration.EnvSpec.from_json(wrapped.spec.to_json())).reset(seed=0)
    env = PlanarArmPush(**WITHOUT_FIELD)
    env.spec = gym.envs.registration.EnvSpec("a/B-v0", kwargs={"path": Path(tmp_path)})
    assert env.spec.kwargs == {"path": str(tmp_path)}


# --- how long an episode is --------------------------------------------------------------------


def length(env, action):
    """Actions until an episode is truncated, and the reward of the last."""
    env.reset(seed=0)
    for count in range(1, HORIZON + 2):
        _, reward, _, truncated, _ = env.step(action)
        if np.all(truncated):
            return count, np.min(reward)
    raise AssertionError("no end")


@pytest.mark.parametrize(
    ("repeat", "limit", "actions"),
    [
        (1, "none", 1000),
        (1, 2000, 1000),
        (10, "none", 100),
        (10, 1000, 100),
        (10, -1, 100),
        (10, None, 100),
        (10, 4, 4),
    ],
)
def test_an_episode_ends_at_its_horizon_or_at_a_limit_before(repeat, limit, actions):
    """Single, synchronous and native; the cost of the end falls where the episode ends, and nowhere
    else.
    """
    choice = {"action_repeat": repeat, **({} if limit == "none" else {"max_episode_steps": limit})}
    env = gym.make(PUSH, **WITHOUT_FIELD, **choice)
    envs = native(PUSH, **choice)
    plain = synchronous(PUSH, **choice)
    found = [
        length(env, np.zeros(4)),
        length(envs, np.zeros((2, 4))),
        length(plain, np.zeros((2, 4))),
    ]
    assert len(set(found)) == 1 and found[0][0] == actions
    due = found[0][1] < -20.0  # 1e-3 of w_miss d2g, and of a few hundred for each control step
    assert due == (actions * repeat == HORIZON)
    if limit in ("none", -1, None):
        assert env.spec.max_episode_steps == envs.spec.max_episode_steps == actions
        assert (
            gym.make(
                gym.envs.registration.EnvSpec.from_json(env.spec.to_json())
            ).spec.max_episode_steps
            == actions
        )


def test_an_environment_made_without_gymnasium_ends_too():
    assert length(PlanarArmPush(action_repeat=100, **WITHOUT_FIELD), np.zeros(4))[0] == 10
    assert (
        PlanarArmPush(**WITHOUT_FIELD).episode_actions == 1000
        and PlanarArmCage().episode_actions is None
    )


def test_a_state_of_a_later_step_leaves_the_steps_to_the_horizon():
    env = gym.make(PUSH, **WITHOUT_FIELD)
    envs = native(PUSH)
    for each, shape in ((env, (4,)), (envs, (2, 4))):
        each.reset(seed=0, options={"state": {"step": HORIZON - 2}})
        assert not np.any(each.step(np.zeros(shape))[3]) and np.all(each.step(np.zeros(shape))[3])

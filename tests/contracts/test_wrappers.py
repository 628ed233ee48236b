"""Wrappers, keyword arguments and reset options are one mechanism."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.wrappers import (
    MISMATCHES,
    DynamicsMismatch,
    FrictionMismatch,
    Mismatch,
    ShapeMismatch,
    VectorMismatch,
)

PUSH = "piec_envs/PlanarArmPush-v0"
VALUES = {
    "disturbance": 0.004,
    "disturbance_kind": "direction",
    "adversary": 0.5,
    "adversary_after": 1.0,
    "friction": 0.1,
    "object": "hexagon",
    "dynamics": "mujoco",
}


def outcome(env, options=None):
    observation, _ = env.reset(seed=2, options=options)
    steps = [env.step(np.ones(env.action_space.shape)) for _ in range(25)]
    return [observation, *[step[0] for step in steps]], env.unwrapped.get_params()


def drawn_params(env, seed, options=None):
    """Plant parameters in force after a reset."""
    env.reset(seed=seed, options=options)
    return env.unwrapped.get_params()


@pytest.mark.parametrize("wrapper", MISMATCHES)
def test_three_ways_are_one(wrapper):
    params = {name: VALUES[name] for name in wrapper.names}
    wrapped, seen = outcome(wrapper(gym.make(PUSH), **params))
    by_keyword, _ = outcome(gym.make(PUSH, **params))
    by_option, _ = outcome(gym.make(PUSH), {"params": params})
    np.testing.assert_array_equal(wrapped, by_keyword)
    np.testing.assert_array_equal(wrapped, by_option)
    assert {name: seen[name] for name in params} == params


@pytest.mark.parametrize("wrapper", MISMATCHES)
def test_vector_twin_changes_every_row_and_keeps_the_change(wrapper):
    params = {name: VALUES[name] for name in wrapper.names}
    envs = MISMATCHES[wrapper](gym.make_vec(PUSH, num_envs=2, max_episode_steps=3), **params)
    envs.reset(seed=2)
    for _ in range(6):  # through an autoreset
        for name, value in params.items():
            assert (envs.unwrapped.get_params()[name] == value).all()
        envs.step(np.zeros((2, 4)))


def test_wrappers_stand_in_the_spec():
    env = Mismatch(FrictionMismatch(gym.make(PUSH), friction=0.3), disturbance=0.001)
    again = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    again.reset(seed=0)
    params = again.unwrapped.get_params()
    assert (params["friction"], params["disturbance"]) == (0.3, 0.001)


def test_bad_parameters_are_refused_at_once():
    env = gym.make(PUSH, escape_field=None)
    with pytest.raises(UnknownNameError, match="friction"):
        FrictionMismatch(env, mu=0.3)
    with pytest.raises(UnknownNameError, match="plant parameter"):
        Mismatch(env, colour="red")
    with pytest.raises(InvalidParameterError, match="friction"):
        Mismatch(env, friction=-1.0)
    with pytest.raises(InvalidParameterError, match="delay must be 0"):
        Mismatch(env, delay=0.02)
    with pytest.raises(InvalidParameterError, match="loose bodies"):
        ShapeMismatch(env, object="a4_box_roll_1")
    with pytest.raises(InvalidParameterError, match="adversary"):
        VectorMismatch(gym.make_vec(PUSH, num_envs=1, escape_field=None), adversary=1.0)


@pytest.mark.parametrize("wrapper", [*MISMATCHES, Mismatch])
def test_an_env_without_a_plant_refuses_mismatches(wrapper):
    cage = "piec_envs/PlanarArmCage-v0"
    params = {name: VALUES[name] for name in wrapper.names or ("friction",)}
    with pytest.raises(InvalidParameterError, match="plant"):
        wrapper(gym.make(cage), **params)
    with pytest.raises(InvalidParameterError, match="plant"):
        MISMATCHES.get(wrapper, VectorMismatch)(gym.make_vec(cage, num_envs=1), **params)


def test_randomize_draws_from_the_seed_and_reports():
    drawn = {
        "friction": [0.2, 0.8],
        "object": ["circle", "square"],
        "dynamics": ["mujoco", "quasi_dynamic"],
    }
    envs = gym.make_vec(PUSH, num_envs=40, randomize=drawn, escape_field=None)
    first = drawn_params(envs, 1)
    second = drawn_params(envs, 1)
    np.testing.assert_array_equal(first["friction"], second["friction"])
    assert 0.2 <= first["friction"].min() < 0.3 and 0.7 < first["friction"].max() <= 0.8
    assert set(first["object"]) == {"circle", "square"}
    assert set(first["dynamics"]) == {"mujoco", "quasi_dynamic"}


REAL = {"dynamics": "mujoco", "object": "a4_box_roll_1", "mass": 1.5, "delay": 0.04}


def test_mass_and_delay_are_injected_as_all_others():
    wrapped, seen = outcome(Mismatch(gym.make(PUSH, escape_field=None), **REAL))
    by_keyword, _ = outcome(gym.make(PUSH, escape_field=None, **REAL))
    by_option, _ = outcome(gym.make(PUSH, escape_field=None), {"params": REAL})
    np.testing.assert_array_equal(wrapped, by_keyword)
    np.testing.assert_array_equal(wrapped, by_option)
    assert {name: seen[name] for name in REAL} == REAL


def test_what_is_drawn_and_what_is_injected_are_judged_together():
    """A delay that is drawn suits MuJoCo alone: as drawn with it, or injected with the same
    reset.
    """
    drawn = gym.make(
        PUSH, escape_field=None, randomize={"dynamics": ["mujoco"], "delay": [0.01, 0.09]}
    )
    delays = [drawn_params(drawn, seed)["delay"] for seed in range(5)]
    assert len(set(delays)) == 5 and all(0.01 <= delay <= 0.09 for delay in delays)
    with pytest.raises(InvalidParameterError, match="delay must be 0"):
        drawn.reset(options={"params": {"dynamics": "quasi_dynamic"}})
    delayed = gym.make(
        PUSH, escape_field=None, dynamics="mujoco", randomize={"delay": [0.01, 0.09]}
    )
    DynamicsMismatch(delayed, dynamics="quasi_dynamic")  # fits until a delay is drawn
    with pytest.raises(InvalidParameterError, match="delay must be 0"):
        delayed.reset(seed=0)
    assert drawn_params(delayed, 0, {"params": {"dynamics": "mujoco"}})["delay"] > 0

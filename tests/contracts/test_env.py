"""Contracts of every registered environment, single and vector."""

from __future__ import annotations

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from piec_envs.env.registry import ENVS, MOTIONS
from piec_envs.world.objects import OBJECTS

CHOICES = [
    {},
    {"escape_field": None},
    {"escape_field": None, "prior": "contact"},
    {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}, "escape_every": 7},
    {"solver": "osqp", "escape_field": None},
    {"prior": "proximity", "preset": "paper"},
    {"prior": None, "dtype": "float32"},
    {"disturbance": 0.005, "start_noise": (0.01, 0.05)},
    {"disturbance": 0.003, "disturbance_kind": "direction", "noise_entry": "state"},
    {"adversary": 1.0},
    {"goal_conditioned": True},
    {"goal_conditioned": "dense", "dtype": "float32"},
    {"goal": (-0.2, 0.45), "weights": {"task": 500.0}, "action_repeat": 10},
    {"friction": 0.0, "threads": 1, "inertia": "own"},
    {
        "randomize": {
            "friction": [0.2, 0.8],
            "object": ["circle", "square"],
            "disturbance": [0.0, 0.005],
        }
    },
    *({"object": name, "escape_every": 50} for name, item in OBJECTS.items() if not item.loose),
    *({"dynamics": "mujoco", "object": name, "escape_field": None} for name in OBJECTS),
    {
        "dynamics": "mujoco",
        "disturbance": 0.005,
        "adversary": 0.5,
        "start_noise": (0.01, 0.05),
        "friction": 0.0,
    },
    {
        "randomize": {"dynamics": ["quasi_dynamic", "mujoco"], "friction": [0.2, 0.8]},
        "goal_conditioned": True,
    },
    {"dynamics": "mujoco", "randomize": {"mass": [0.5, 2.0], "delay": [0.0, 0.1]}},
]
# What every id has: the planar arm takes every choice and every object, the others a set in which
# each keyword argument that could depend on the robot and, under each dynamics, some object of each
# kind has its turn.
REPRESENTATIVE = [
    {},
    {"escape_field": None, "prior": "contact"},
    {"solver": "osqp", "escape_field": None},
    {"disturbance": 0.003, "disturbance_kind": "direction", "noise_entry": "state"},
    {"adversary": 1.0},
    {"goal_conditioned": "dense", "dtype": "float32"},
    {"goal": (-0.2, 0.45), "weights": {"task": 500.0}, "action_repeat": 10},
    {
        "randomize": {
            "friction": [0.2, 0.8],
            "object": ["circle", "square"],
            "disturbance": [0.0, 0.005],
        }
    },
    {"object": "a4_box", "escape_every": 50},
    {"object": "paper_pack", "escape_every": 50, "inertia": "own"},
    {"dynamics": "mujoco", "object": "a4_box_roll_1", "start": "home", "escape_field": None},
    {
        "dynamics": "mujoco",
        "disturbance": 0.005,
        "adversary": 0.5,
        "start_noise": (0.01, 0.05),
        "friction": 0.0,
    },
    {
        "randomize": {"dynamics": ["quasi_dynamic", "mujoco"], "friction": [0.2, 0.8]},
        "goal_conditioned": True,
    },
]
FULL = "piec_envs/PlanarArmPush-v0"
NOISY = {"disturbance": 0.005, "adversary": 0.3, "start_noise": (0.01, 0.05), "object": "square"}
STATIC = tuple(env_id for env_id in ENVS if env_id not in MOTIONS)  # one step, no plant
STATIC_CHOICES = [
    {},
    {"pose": (0.2, -0.2, 1.0), "dtype": "float32"},
    {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}, "threads": 1},
    {"reduce": "max"},
    *({"object": name} for name in OBJECTS),
]
EVERY_CHOICE = [
    (env_id, choice)
    for env_id in MOTIONS
    for choice in (CHOICES if env_id == FULL else REPRESENTATIVE)
] + [(env_id, choice) for env_id in STATIC for choice in STATIC_CHOICES]


def drawn(env_id):
    """Keyword arguments with which every episode is another."""
    return NOISY if env_id in MOTIONS else {"object": "square"}


@pytest.mark.parametrize(("env_id", "choice"), EVERY_CHOICE, ids=str)
def test_check_env(env_id, choice):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", category=PendingDeprecationWarning, module="osqp")
        check_env(gym.make(env_id, **choice).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", ENVS)
def test_check_env_renders(env_id):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id, render_mode="rgb_array").unwrapped)


EVERY_PLANT = [(env_id, drawn(env_id)) for env_id in ENVS] + [
    (env_id, {"dynamics": "mujoco", **NOISY}) for env_id in MOTIONS
]


@pytest.mark.parametrize(("env_id", "choice"), EVERY_PLANT, ids=str)
def test_reset_is_reproducible(env_id, choice):
    def episode(env, seed):
        observation, _ = env.reset(seed=seed)
        steps = [env.step(action) for action in actions]
        return [observation, *(step[0] for step in steps)], [step[1] for step in steps]

    env = gym.make(env_id, **choice)
    shape = (20 if env_id in MOTIONS else 1, *env.action_space.shape)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)
    first = episode(env, 7)
    unseeded = episode(env, None)
    again = episode(env, 7)
    unseeded_again = episode(env, None)
    for one, other in ((first, again), (unseeded, unseeded_again)):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1] == other[1]
    assert not np.array_equal(first[0], unseeded[0])


@pytest.mark.parametrize("env_id", ENVS)
def test_spec_round_trip(env_id):
    given = {"goal": (-0.2, 0.4)} if env_id in MOTIONS else {"pose": (0.2, 0.1, 0.5)}
    env = gym.make(env_id, **drawn(env_id), **given)
    spec = gym.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gym.make(spec)
    np.testing.assert_array_equal(env.reset(seed=0)[0], again.reset(seed=0)[0])
    assert again.unwrapped.config == env.unwrapped.config


def test_compute_reward_is_vectorised_and_equals_the_step():
    for mode in (True, "dense"):
        env = gym.make(
            "piec_envs/PlanarArmPush-v0", goal_conditioned=mode, escape_field=None
        ).unwrapped
        env.reset(seed=0)
        observation, reward, *_ = env.step(np.ones(4))
        achieved = observation["achieved_goal"]
        desired = observation["desired_goal"]
        assert env.compute_reward(achieved, desired, {}) == reward
        many = env.compute_reward(np.stack([achieved, desired]), np.stack([desired, desired]), None)
        np.testing.assert_array_equal(many, [reward, 0.0])


def test_tracking_success_needs_the_path_and_its_end():
    env = gym.make("piec_envs/PlanarArmTrack-v0", escape_field=None).unwrapped
    goal = [*env.model.task.goal, 0.0]
    env.reset(seed=0, options={"state": {"q_r": [-1.0, 0, 0, 0], "pose": goal}})
    info = env.step(np.zeros(4))[4]
    assert info["d2g"] == 0 and not info["is_success"]  # it waits at the end instead of following
    assert info["tracking_error"] > 0.5

"""Bad input gets an exception that says what was given and what would be valid."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.errors import (
    InvalidActionError,
    InvalidParameterError,
    InvalidStateError,
    PiecError,
    UnknownNameError,
    WeightsError,
)

PUSH = "piec_envs/PlanarArmPush-v0"


@pytest.mark.parametrize(
    ("choice", "error", "message"),
    [
        ({"object": "circel"}, UnknownNameError, "circle, .*hexagon, octagon, .*square"),
        ({"dynamics": "real"}, UnknownNameError, "mujoco, quasi_dynamic"),
        ({"dynamics": "mujoco", "friction": -0.1}, InvalidParameterError, "friction"),
        ({"dynamics": "mujoco", "object": "cube"}, UnknownNameError, "square"),
        (
            {"randomize": {"dynamics": ["mujoco", "real"]}},
            UnknownNameError,
            "mujoco, quasi_dynamic",
        ),
        ({"solver": "slow"}, UnknownNameError, "fast, osqp"),
        ({"escape_field": "gird"}, UnknownNameError, "grid"),
        ({"prior": "love"}, UnknownNameError, "caging, contact, proximity"),
        ({"preset": "journal"}, UnknownNameError, "default, paper"),
        ({"weights": {"tasks": 1}}, UnknownNameError, "task"),
        ({"disturbance_kind": "uniform"}, UnknownNameError, "direction, gaussian"),
        ({"inertia": "none"}, UnknownNameError, "own, paper"),
        ({"noise_entry": "pose"}, UnknownNameError, "qp, state"),
        ({"goal_conditioned": "yes"}, UnknownNameError, "dense"),
        ({"dtype": "float16"}, UnknownNameError, "float64"),
        ({"render_mode": "ansi"}, UnknownNameError, "rgb_array"),
        ({"colour": "red"}, UnknownNameError, "object"),
        ({"goal": (1.2, 1.2)}, InvalidParameterError, "within 1.4 m"),
        (
            {"goal": (0.0, 0.05)},
            InvalidParameterError,
            r"at least 0.075 m from it.*got \(0\.0, 0\.05\)",
        ),
        ({"goal": (np.nan, 0.0)}, InvalidParameterError, "within 1.4 m"),
        ({"goal": (0.1, 0.2, 0.3)}, InvalidParameterError, "goal"),
        ({"friction": -0.1}, InvalidParameterError, "friction"),
        ({"disturbance": -0.001}, InvalidParameterError, "disturbance"),
        ({"disturbance": np.nan}, InvalidParameterError, "disturbance"),
        ({"friction": "high"}, InvalidParameterError, "friction"),
        ({"action_repeat": 3}, InvalidParameterError, "action_repeat must divide 1000, got 3"),
        ({"action_repeat": 0}, InvalidParameterError, "action_repeat"),
        ({"start_noise": (0.01,)}, InvalidParameterError, "start_noise"),
        ({"start_noise": (-0.01, 0.0)}, InvalidParameterError, "start_noise"),
        (
            {"dynamics": "mujoco", "mass": 0.0},
            InvalidParameterError,
            "mass must be from 0.01 to 100, got 0.0",
        ),
        ({"mass": -1.0}, InvalidParameterError, "mass"),
        ({"mass": np.inf}, InvalidParameterError, "mass"),
        (
            {"dynamics": "mujoco", "delay": 0.11},
            InvalidParameterError,
            "delay must be from 0 to 0.1 s, got 0.11",
        ),
        ({"dynamics": "mujoco", "delay": -0.01}, InvalidParameterError, "delay"),
        (
            {"delay": 0.02},
            InvalidParameterError,
            "delay must be 0 under dynamics='quasi_dynamic'.*mujoco",
        ),
        ({"randomize": {"delay": [0.0, 0.02]}}, InvalidParameterError, "delay must be 0 .*mujoco"),
        (
            {
                "delay": 0.02,
                "dynamics": "mujoco",
                "randomize": {"dynamics": ["mujoco", "quasi_dynamic"]},
            },
            InvalidParameterError,
            "delay must be 0 .*mujoco",
        ),
        (
            {"object": "a4_box_roll_1"},
            InvalidParameterError,
            "'a4_box_roll_1' has loose bodies.*mujoco",
        ),
        (
            {"randomize": {"object": ["a4_box", "a4_box_roll_1"]}},
            InvalidParameterError,
            "loose bodies.*mujoco",
        ),
        ({"escape_every": 0}, InvalidParameterError, "escape_every"),
        ({"escape_field": None, "prior": "caging"}, InvalidParameterError, "escape field"),
        ({"escape_field": None, "adversary": 1.0}, InvalidParameterError, "escape field"),
        ({"randomize": {"friction": [0.8, 0.2]}}, InvalidParameterError, "range"),
        ({"randomize": {"friction": 0.5}}, InvalidParameterError, "range"),
        ({"randomize": {"colour": ["red"]}}, UnknownNameError, "friction"),
        ({"randomize": {"object": ["cube"]}}, UnknownNameError, "square"),
        ({"escape_field": 3}, InvalidParameterError, "escape_field"),
        ({"escape_field": {"speed": {"leek": 1}}}, InvalidParameterError, "leek"),
        ({"escape_field": {"speed": "fast"}}, InvalidParameterError, "grid"),
        ({"escape_field": {"speed": {"leak": 0.0}}}, InvalidParameterError, "leaky wall"),
        ({"escape_field": {"speed": {"leak": 1.0}}}, InvalidParameterError, r"\[0.0, 1.0\)"),
        ({"goal": "home"}, InvalidParameterError, "goal"),
        ({"goal": ("0.2", "0.4")}, InvalidParameterError, "goal.*numbers of shape"),
        ({"goal": (0.2 + 0.1j, 0.4)}, InvalidParameterError, "goal.*numbers of shape"),
        ({"start_noise": "some"}, InvalidParameterError, "start_noise"),
        ({"randomize": "friction"}, InvalidParameterError, "randomize"),
        ({"randomize": {"friction": [None, 1]}}, InvalidParameterError, "range"),
        ({"weights": ["task"]}, InvalidParameterError, "weights"),
        ({"weights": {"task": -1}}, InvalidParameterError, "task"),
        ({"weights": {"task": np.nan}}, InvalidParameterError, "task"),
        ({"threads": 0}, InvalidParameterError, "threads"),
        ({"threads": "two"}, InvalidParameterError, "threads"),
        ({"escape_every": True}, InvalidParameterError, "escape_every"),
        ({"object": ["circle"]}, UnknownNameError, "circle"),
        ({"escape_field": {"name": "grid", "resolution": -3}}, PiecError, "resolution"),
        ({"escape_field": {"name": "grid", "size": 3}}, PiecError, "size"),
        (
            {"escape_field": {"name": "network", "weights": "nonsense"}},
            WeightsError,
            "nonsense.*piec train-field",
        ),
        ({"escape_field": {"name": "network", "weights": 3}}, InvalidParameterError, "network"),
        (
            {"escape_field": {"name": "network", "speed": {"leak": 0.1}}},
            InvalidParameterError,
            "speed",
        ),
    ],
    ids=str,
)
def test_bad_keyword_arguments(choice, error, message):
    for make in (gym.make, gym.make_vec):
        with pytest.raises(error, match=message):
            make(PUSH, **choice)


@pytest.mark.parametrize(
    "action",
    [np.full(4, np.nan), np.array([0, np.inf, 0, 0]), np.zeros(3), np.zeros((1, 4)), np.zeros(0)],
    ids=str,
)
def test_bad_actions(action):
    env = gym.make(PUSH, escape_field=None, disable_env_checker=True).unwrapped
    env.reset(seed=0)
    before = env.get_state()
    with pytest.raises(InvalidActionError):
        env.step(action)
    np.testing.assert_array_equal(env.get_state().pose, before.pose)  # nothing half-done


@pytest.mark.parametrize(
    ("state", "error", "message"),
    [
        ({"pose": [0.5, 0.0, 0.0]}, InvalidStateError, "overlaps the robot by 125.0 mm"),
        ({"pose": [0.5, 0.5]}, InvalidStateError, "shape"),
        ({"pose": [0.5, np.nan, 0.0]}, InvalidStateError, "finite"),
        ({"q_r": [0.0, 3.0, 0.0, 0.0]}, InvalidStateError, "joint limits"),
        ({"q_r": [0.0, 0.0]}, InvalidStateError, "shape"),
        ({"q_r": "straight"}, InvalidStateError, "numbers"),
        ({"step": -1}, InvalidStateError, "whole number"),
        ({"step": 2.7}, InvalidStateError, "whole number"),
        ({"step": np.nan}, InvalidStateError, "finite"),
        ({"velocity": [0.0]}, UnknownNameError, "q_r"),
    ],
)
def test_bad_states(state, error, message):
    env = gym.make(PUSH, escape_field=None).unwrapped
    with pytest.raises(error, match=message):
        env.reset(seed=0, options={"state": state})


def test_bad_reset_options():
    env = gym.make(PUSH, escape_field=None).unwrapped
    env.reset(seed=0)
    with pytest.raises(UnknownNameError, match="params, state"):
        env.reset(options={"param": {}})
    with pytest.raises(UnknownNameError, match="friction"):
        env.reset(options={"params": {"mu": 0.3}})
    with pytest.raises(InvalidParameterError, match="friction"):
        env.reset(options={"params": {"friction": -1}})
    with pytest.raises(InvalidParameterError, match="adversary"):
        env.reset(options={"params": {"adversary": 1.0}})
    with pytest.raises(InvalidParameterError, match="mapping"):
        env.reset(options={"params": ["friction"]})
    with pytest.raises(InvalidParameterError, match="delay must be 0"):
        env.reset(options={"params": {"delay": 0.02}})
    with pytest.raises(InvalidParameterError, match="loose bodies"):
        env.reset(options={"params": {"object": "a4_box_roll_1"}})
    with pytest.raises(InvalidStateError, match="mapping"):
        env.reset(options={"state": "start"})
    with pytest.raises(InvalidStateError, match="State"):
        env.set_state("state")
    with pytest.raises(InvalidStateError, match="State"):
        env.rollout("state", controls=np.zeros((1, 5, 4)))
    with pytest.raises(InvalidActionError, match="rows"):
        env.rollout(env.get_state(), controls=np.zeros((0, 5, 4)))
    with pytest.raises(InvalidParameterError, match="either path or controls"):
        env.rollout(env.get_state())


def test_a_refused_state_leaves_the_env_as_it_was():
    env = gym.make(PUSH, escape_field=None).unwrapped
    env.reset(seed=0)
    env.step(np.ones(4))
    good = env.get_state()
    for change in (
        {"pose": np.full((1, 3), np.nan)},
        {"q_r": np.zeros((1, 3))},
        {"step": np.array([-5])},
    ):
        with pytest.raises(InvalidStateError):
            env.set_state(dataclasses.replace(good, **change))
    fleeing = dataclasses.replace(good, params=[good.params[0].replace({"adversary": 1.0})])
    with pytest.raises(InvalidParameterError, match="escape field"):
        env.set_state(fleeing)
    np.testing.assert_array_equal(env.get_state().pose, good.pose)
    env.step(np.zeros(4))


def test_a_refused_reset_leaves_every_row_as_it_was():
    envs = gym.make_vec(PUSH, num_envs=2, escape_field=None)
    envs.reset(seed=0)
    envs.step(np.ones((2, 4)))
    before = envs.unwrapped.get_state()
    with pytest.raises(InvalidStateError):
        envs.reset(options={"state": {"pose": [0.5, 0.0, 0.0]}})
    np.testing.assert_array_equal(envs.unwrapped.get_state().q_r, before.q_r)


def test_tracking_cannot_begin_in_the_middle():
    env = gym.make("piec_envs/PlanarArmTrack-v0", escape_field=None).unwrapped
    with pytest.raises(InvalidStateError, match="tracking"):
        env.reset(options={"state": {"step": 900, "pose": [-0.3, 0.4, 0.0]}})
    with pytest.raises(InvalidStateError, match="whole number"):
        env.reset(options={"state": {"step": -1_000_000}})


def test_bad_vector_arguments():
    with pytest.raises(InvalidParameterError, match="num_envs"):
        gym.make_vec(PUSH, num_envs=0)
    envs = gym.make_vec(PUSH, num_envs=2, escape_field=None)
    for choice in (
        {"max_episode_steps": 0},
        {"max_episode_steps": -2},
        {"autoreset_mode": "Never"},
    ):
        with pytest.raises((InvalidParameterError, UnknownNameError), match=next(iter(choice))):
            gym.make_vec(PUSH, num_envs=2, **choice)
    for seed in ([1, 2, 3], "a", 1.5, -1):
        with pytest.raises(InvalidParameterError, match="seed"):
            envs.reset(seed=seed)
    envs.reset(seed=0)
    for mask in ([True, False], np.zeros(2, dtype=bool), np.ones(3, dtype=bool)):
        with pytest.raises(InvalidParameterError, match="reset_mask"):
            envs.reset(options={"reset_mask": mask})
    with pytest.raises(InvalidActionError, match="shape"):
        envs.step(np.zeros((3, 4)))

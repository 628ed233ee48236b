"""The static caging environment: its reward, success, draws, pictures and bad input."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.errors import InvalidActionError, InvalidParameterError, PiecError, UnknownNameError
from piec_envs.escape.field import choose_field
from planners import CagingProblem

CAGE = "piec_envs/PlanarArmCage-v0"
FRANKA = "piec_envs/FrankaCage-v0"
POSE = (-0.35, 0.02, 0.1)
ENCLOSING = np.array([-2.58, -1.32, -1.93, -1.56])


def action_of(posture) -> np.ndarray:
    """The action that takes a posture."""
    return np.asarray(posture) / np.array([np.pi, 2.6, 2.6, 2.6])


@pytest.fixture
def env():
    return gym.make(CAGE, pose=POSE).unwrapped


def test_reward_is_the_planners_value_on_the_scale_of_caging(env):
    problem = CagingProblem("planar_arm", "three_discs", POSE, choose_field("auto", "planar_arm"))
    q = np.random.default_rng(0).uniform(problem.lower, problem.upper, (20, 4))
    values = []
    taken = []
    for posture in q:
        env.reset()
        _, reward, terminated, truncated, info = env.step(action_of(posture))
        assert terminated and not truncated
        np.testing.assert_allclose(info["q_r"], posture, atol=1e-12)
        values.append(reward)
        taken.append(info["q_r"])
    np.testing.assert_allclose(values, 0.02 * problem.measure(np.array(taken)).value, rtol=1e-9)


def test_success_is_enclosed_under_the_hard_wall_without_overlap(env):
    _, info = env.reset()
    assert not info["is_success"] and not info["enclosed"]
    info = env.step(action_of(ENCLOSING))[4]
    assert (
        info["is_success"] and info["enclosed"] and info["penetration"] == 0 and info["caging"] > 1
    )
    for posture in ([0.0, 0.0, 0.0, 0.0], [-2.58, -1.32, -1.0, 0.0]):
        env.reset()
        assert not env.step(action_of(posture))[4]["is_success"]
    env.reset()
    through = env.step(action_of(ENCLOSING + np.array([0.3, 0.0, 0.0, 0.0])))[4]
    assert through["penetration"] > 0 and not through["is_success"]


def test_drawn_objects_lie_around_the_base():
    envs = gym.make_vec(CAGE, num_envs=200, threads=1)
    observation, info = envs.reset(seed=0)
    radius = np.hypot(*observation[:, :2].T)
    assert 0.16 < radius.min() < 0.2 and 0.38 < radius.max() <= 0.4
    np.testing.assert_allclose(np.hypot(*observation[:, 2:].T), 1.0)
    np.testing.assert_array_equal(observation[:, :2], info["pose"][:, :2])


def test_a_pose_may_be_given_at_reset(env):
    observation, _ = env.reset(options={"pose": (0.1, 0.2, 0.0)})
    np.testing.assert_allclose(observation, [0.1, 0.2, 1.0, 0.0])


def test_picture_follows_the_posture():
    env = gym.make(CAGE, pose=POSE, render_mode="rgb_array")
    env.reset()
    start = env.render()
    env.step(action_of(ENCLOSING))
    assert start.shape == (720, 720, 3) and not np.array_equal(start, env.render())


def test_the_franka_has_its_geometry_field_and_limits():
    env = gym.make(FRANKA, geometry="capsules", pose=(0.05, 0.2, 0.0)).unwrapped
    assert env.config.robot == "franka_capsules" and env.config.object == "water_jug"
    assert env.field.name == env.config.escape_field == "table"
    problem = CagingProblem("franka_capsules", "water_jug", (0.05, 0.2, 0.0), env.field)
    for sign in (-1.0, 1.0):
        env.reset(seed=0)
        _, reward, _, _, info = env.step(np.full(3, sign))
        np.testing.assert_array_equal(info["q_r"], problem.lower if sign < 0 else problem.upper)
        np.testing.assert_allclose(reward, 0.02 * problem.measure(info["q_r"][None]).value[0])
    for make in (gym.make, gym.make_vec):
        with pytest.raises(UnknownNameError, match="capsules, meshes"):
            make(FRANKA, geometry="boxes")
        with pytest.raises(UnknownNameError, match="unexpected keyword argument 'robot'"):
            make(FRANKA, geometry="capsules", robot="planar_arm")


@pytest.mark.parametrize(
    ("choice", "error", "message"),
    [
        ({"object": "cube"}, UnknownNameError, "three_discs"),
        ({"colour": "red"}, UnknownNameError, "object"),
        ({"robot": "franka"}, UnknownNameError, "object"),
        ({"pose": (2.0, 0.0, 0.0)}, InvalidParameterError, "workspace disc"),
        ({"pose": (np.nan, 0.0, 0.0)}, InvalidParameterError, "finite"),
        ({"pose": (0.1, 0.2)}, InvalidParameterError, "shape"),
        ({"escape_field": "gird"}, UnknownNameError, "grid"),
        ({"escape_field": None}, InvalidParameterError, "escape_field"),
        ({"escape_field": {"speed": {"leak": 0.0}}}, InvalidParameterError, "leaky wall"),
        ({"escape_field": {"size": 3}}, PiecError, "size"),
        ({"reduce": "least"}, UnknownNameError, "max, mean"),
        ({"threads": 0}, InvalidParameterError, "threads"),
        ({"dtype": "float16"}, UnknownNameError, "float64"),
        ({"render_mode": "ansi"}, UnknownNameError, "rgb_array"),
    ],
    ids=str,
)
def test_bad_keyword_arguments(choice, error, message):
    for make in (gym.make, gym.make_vec):
        with pytest.raises(error, match=message):
            make(CAGE, **choice)


def test_bad_calls(env):
    env.reset(seed=0)
    for action in (np.full(4, np.nan), np.zeros(3), np.zeros((1, 4))):
        with pytest.raises(InvalidActionError):
            env.step(action)
    env.step(np.zeros(4))
    with pytest.raises(InvalidActionError, match="reset"):
        env.step(np.zeros(4))
    with pytest.raises(UnknownNameError, match="pose"):
        env.reset(options={"state": {}})
    with pytest.raises(InvalidParameterError, match="workspace disc"):
        env.reset(options={"pose": (1.39, 0.0, 0.0)})


def test_motion_planners_and_evaluation_name_what_they_take():
    from evaluation import evaluate
    from planners import CmaEsPlanner

    with pytest.raises(UnknownNameError, match="PlanarArmPush"):
        CmaEsPlanner().plan(CAGE)
    with pytest.raises(UnknownNameError, match="PlanarArmPush"):
        evaluate(lambda observation: observation, CAGE)

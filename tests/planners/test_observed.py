"""Policies take the observations of their own environment, and no others."""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import (
    FlattenObservation,
    FrameStackObservation,
    NormalizeObservation,
    RescaleObservation,
    TimeAwareObservation,
)

from piec_envs.env.registry import MOTIONS
from piec_envs.errors import InvalidObservationError
from planners import Plan

PUSH = "piec_envs/PlanarArmPush-v0"
BARE = {"escape_field": None}
AWAY = {"pose": [0.3, -0.9, 0.0]}  # of the object, where no arm touches it


def options(env_id: str) -> dict:
    """Keyword arguments that need no extra."""
    return {**BARE, **({} if "Planar" in env_id else {"geometry": "capsules"})}


def plan_for(env_id: str) -> Plan:
    """A plan that moves every joint a little."""
    env = gym.make(env_id, **options(env_id)).unwrapped
    robot = env.model.robot
    start = env.model.setup.posture
    path = start + np.linspace(0, 0.4, 1001)[:, None]
    return Plan(
        env_id=env_id,
        robot=robot.name,
        joints=tuple(joint.name for joint in robot.joints),
        horizon=1000,
        env_kwargs=options(env_id),
        path=path,
        via_points=path[-1:],
        objective="contact",
        preset="default",
        seed=0,
        cost=0.0,
        nominal={},
    )


def observations(env_id: str, **choice) -> list:
    """What an environment returns at the start and after 40 steps of random actions."""
    env = gym.make(env_id, **options(env_id), **choice)
    first, _ = env.reset(seed=0)
    env.action_space.seed(0)
    action = env.action_space.sample()
    for _ in range(40):
        last, *_ = env.step(action)
    return [first, last]


@pytest.mark.parametrize("env_id", MOTIONS)
@pytest.mark.parametrize("choice", [{}, {"dtype": "float32"}, {"goal_conditioned": True}], ids=str)
def test_an_environments_own_are_taken(env_id, choice):
    policy = pickle.loads(pickle.dumps(plan_for(env_id).policy()))
    for observation in observations(env_id, **choice):
        action, _ = policy.predict(observation)
        assert action.shape == policy.plan.path[0].shape and (np.abs(action) <= 1).all()


@pytest.mark.parametrize("env_id", MOTIONS)
def test_those_of_every_other_environment_are_refused(env_id):
    policy = plan_for(env_id).policy()
    kinds = {(env.rpartition("/")[2]): observations(env) for env in MOTIONS}
    same = policy.predict(kinds.pop(env_id.rpartition("/")[2])[1])
    assert same is not None
    for other, seen in kinds.items():
        with pytest.raises(InvalidObservationError):
            policy.predict(seen[1])
            pytest.fail(other)


WRAPPERS = {
    "time aware": TimeAwareObservation,
    "normalised": NormalizeObservation,
    "rescaled": lambda env: RescaleObservation(env, np.float64(-0.5), np.float64(0.5)),
    "stacked and flat": lambda env: FlattenObservation(FrameStackObservation(env, 2)),
}


@pytest.mark.parametrize("wrap", WRAPPERS.values(), ids=WRAPPERS)
def test_wrapped_ones_are_refused_before_the_arm_has_moved_far(wrap):
    """Executed on 24 entries, whose last is another time, a plan once ended 0.3 m away without a
    word.
    """
    env = wrap(gym.make(PUSH, **BARE))
    policy = plan_for(PUSH).policy()
    observation, _ = env.reset(seed=0)
    with pytest.raises(InvalidObservationError, match="PlanarArmPush"):
        for _ in range(20):
            observation, *_ = env.step(policy.predict(observation)[0])


def spoilt(**entries) -> np.ndarray:
    """A good observation with some entries changed."""
    observation = observations(PUSH)[1].copy()
    for name, value in entries.items():
        observation[int(name.removeprefix("at"))] = value
    return observation


@pytest.mark.parametrize(
    ("observation", "message"),
    [
        (np.zeros(7), "23 entries, got 7"),
        (np.zeros((5, 24)), "23 entries, got 24"),
        (np.zeros(0), "23 entries, got 0"),
        (np.float64(1.0), "single number"),
        ("observation", "float32 or float64"),
        (["0.5"] * 23, "float32 or float64"),
        (None, "float32 or float64"),
        ([[1.0], [1.0, 2.0]], "array of floats"),
        (np.zeros(23, dtype=int), "got int64"),
        (np.zeros(23, dtype=bool), "got bool"),
        (np.zeros(23, dtype=complex), "got complex128"),
        (np.zeros(23, dtype=np.float16), "got float16"),
        (np.zeros(23), "do not fit together"),
        (spoilt(at16=np.nan), "entry 16 .*nan"),
        (spoilt(at22=np.inf), "entry 22 .*inf"),
        (spoilt(at8=3.2), "entry 8 .*at most 1.5, got 3.2"),
        (spoilt(at22=0.0405), "a step over 1000"),
        (spoilt(at22=-0.5), "a step over 1000"),
        (spoilt(at22=1.5), "a step over 1000"),
        (spoilt(at0=0.0), "do not fit together"),
        ({"observation": observations(PUSH)[0]}, "goal-conditioned"),
        ({"state": np.zeros(23)}, "got state"),
        (
            {
                "observation": np.zeros(23),
                "achieved_goal": np.zeros(2),
                "desired_goal": np.zeros(3),
            },
            "2 entries, got 3",
        ),
    ],
)
def test_what_cannot_be_an_observation_is_refused(observation, message):
    with pytest.raises(InvalidObservationError, match=message):
        plan_for(PUSH).policy().predict(observation)


def test_one_bad_row_is_enough():
    rows = np.stack([observations(PUSH)[1]] * 3)
    policy = plan_for(PUSH).policy()
    assert policy.predict(rows)[0].shape == (3, 4)
    rows[2, 5] = np.nan
    with pytest.raises(InvalidObservationError, match="entry 5"):
        policy.predict(rows)

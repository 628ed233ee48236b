"""A package of somebody else's: one row for each table, then the contracts; test_outside.py runs it
alone.
"""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env

from piec_envs import (
    DYNAMICS,
    OBJECTS,
    ROBOTS,
    TERMS,
    Backend,
    Object,
    QuasiDynamics,
    Task,
    Term,
    disc,
    get_robot,
    register_task,
)
from planners import PLANNERS, OpenLoopPolicy, RigidCarry
from planners.table import Row, planner_class

ENV_ID = "outside/SlowArmPush-v0"


def slow_arm():
    """A robot: the planar arm at half its speed."""
    arm = get_robot("planar_arm")
    joints = tuple(
        dataclasses.replace(joint, speed_limit=joint.speed_limit / 2) for joint in arm.joints
    )
    return dataclasses.replace(arm, name="slow_arm", joints=joints)


class Sticky(QuasiDynamics):
    """A contact dynamics: the quasi-dynamic one under another name."""

    name = "sticky"


@dataclasses.dataclass(frozen=True)
class Waiting(RigidCarry):
    """A planner: the arm stays where it is."""

    def plan(self, env_id, seed=0, progress=True, **env_kwargs):
        from planners.base import nominal_start, realised_plan

        nominal = {"escape_field": None, **env_kwargs}
        model, start, _ = nominal_start(env_id, nominal, seed)
        path = np.repeat(start.q_r, model.task.horizon, axis=0)
        about = {
            "env_id": env_id,
            "env_kwargs": nominal,
            "objective": "wait",
            "preset": "default",
            "seed": seed,
        }
        return realised_plan(model, start, path, via_points=path[-1:], **about)


ROBOTS["slow_arm"] = slow_arm
OBJECTS["coin"] = Object("coin", (disc(0.06),), np.zeros((1, 2)))
TERMS.append(
    Term(
        "speed_limit",
        lambda robot, task: robot.dof,
        lambda robot: 1.0,
        "rad/s",
        "largest joint speeds",
        write=lambda state, task, robot: np.tile(robot.speed_limit, (state.rows, 1)),
    )
)
DYNAMICS["sticky"] = Backend("quasi-dynamic by another name", f"{__name__}:make_sticky")
PLANNERS["wait"] = Row(f"{__name__}:Waiting", "the arm stays where it is")


def make_sticky(options):
    return Sticky(*options)


register_task(
    Task(
        "slow_push",
        "slow_arm",
        "coin",
        np.array([0.55, 0.25, 0.0]),
        np.array([0.5, 0.4]),
        env_id=ENV_ID,
        summary="Push a coin slowly.",
    )
)


def check():
    """The contracts of an environment, its rows, its dynamics and its plans."""
    options = {"escape_field": None, "dynamics": "sticky"}
    env = gym.make(ENV_ID, **options)
    check_env(env.unwrapped, skip_render_check=True)
    layout = env.unwrapped.observation_layout
    assert layout["time"] == slice(22, 23) and layout["speed_limit"] == slice(23, 27)
    observation, _ = env.reset(seed=4)
    np.testing.assert_allclose(observation[layout["speed_limit"]], 0.025)
    envs = gym.make_vec(ENV_ID, num_envs=3, **options)
    rows, _ = envs.reset(seed=4)
    np.testing.assert_array_equal(rows[0], observation)
    for action in np.random.default_rng(0).uniform(-1, 1, (20, 3, 4)):
        rows, rewards, *_ = envs.step(action)
        observation, reward, *_ = env.step(action[0])
        np.testing.assert_array_equal(rows[0], observation)
        assert rewards[0] == reward
    same = gym.make(ENV_ID, escape_field=None)
    same.reset(seed=4)
    for action in np.random.default_rng(0).uniform(-1, 1, (20, 3, 4)):
        other = same.step(action[0])[0]
    np.testing.assert_array_equal(other, observation)
    plan = planner_class("wait")().plan(ENV_ID, **options)
    env.reset(seed=0)
    first = env.step(OpenLoopPolicy(plan).predict(env.reset(seed=0)[0])[0])[0]
    np.testing.assert_allclose(first[layout["q_r"]], 0.0, atol=1e-12)
    print("all contracts hold")


if __name__ == "__main__":
    check()

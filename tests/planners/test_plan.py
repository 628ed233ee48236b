"""Plan files and the policy that executes them."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

import piec_envs  # noqa: F401
from piec_envs.errors import PlanError
from planners import OpenLoopPolicy, Plan

PUSH = "piec_envs/PlanarArmPush-v0"


@pytest.fixture
def plan() -> Plan:
    steps = np.linspace(0, 1, 1001)[:, None]
    return Plan(
        env_id=PUSH,
        robot="planar_arm",
        joints=("q1", "q2", "q3", "q4"),
        horizon=1000,
        env_kwargs={"escape_field": None},
        path=steps * [1.5, 1.0, 0.8, 0.5],
        via_points=np.zeros((5, 4)),
        objective="contact",
        preset="default",
        seed=0,
        cost=1.0,
        nominal={"d2g": 0.1},
    )


def test_file_round_trip(plan, tmp_path):
    again = Plan.load(plan.save(tmp_path / "folder" / "plan.npz"))
    for name, value in vars(plan).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    # no temporary file is left
    assert [file.name for file in (tmp_path / "folder").iterdir()] == ["plan.npz"]


def test_broken_and_foreign_files_are_refused(plan, tmp_path):
    whole = plan.save(tmp_path / "plan.npz").read_bytes()
    (tmp_path / "half.npz").write_bytes(whole[: len(whole) // 2])
    (tmp_path / "text.npz").write_text("no plan")
    np.savez(tmp_path / "foreign.npz", weights=np.zeros(3))
    np.savez(tmp_path / "pickled.npz", format=np.array([{}], dtype=object))
    np.savez(tmp_path / "future.npz", format="piec-plan-99", meta="{}", path=np.zeros((2, 4)))
    for name in ("half", "text", "foreign", "pickled", "future", "missing"):
        with pytest.raises(PlanError, match=name):
            Plan.load(tmp_path / f"{name}.npz")


def test_plan_for_another_env_robot_or_joints_is_refused(plan):
    plan.check_fits(PUSH, "planar_arm", plan.path[0])
    with pytest.raises(PlanError, match="PlanarArmTrack"):
        plan.check_fits("piec_envs/PlanarArmTrack-v0", "planar_arm", plan.path[0])
    with pytest.raises(PlanError, match="joints"):
        dataclasses.replace(plan, joints=("a", "b", "c", "d")).check_fits(
            PUSH, "planar_arm", plan.path[0]
        )
    with pytest.raises(PlanError, match="arm_9"):
        OpenLoopPolicy(dataclasses.replace(plan, robot="arm_9"))


@pytest.mark.parametrize(
    "choice", [{}, {"goal_conditioned": True}, {"disturbance": 0.005}], ids=str
)
def test_policy_equals_following_the_path(plan, choice):
    """Open loop in the object, absolute in the joints: the same motion as `rollout(path=...)`."""
    env = gym.make(PUSH, escape_field=None, **choice).unwrapped
    observation, _ = env.reset(seed=0)
    expected = env.rollout(env.get_state(), path=plan.path[None, 1:]).motion
    policy = OpenLoopPolicy(plan)
    for t in range(300):
        action, _ = policy.predict(observation)
        observation, *_ = env.step(action)
        np.testing.assert_allclose(env.get_state().q_r[0], expected.q_r[0, t + 1], atol=1e-9)
    np.testing.assert_allclose(env.get_state().pose[0], expected.pose[0, 300], atol=1e-6)


def test_policy_works_on_batches_and_either_task(plan):
    for env_id in (PUSH, "piec_envs/PlanarArmTrack-v0"):
        envs = gym.make_vec(env_id, num_envs=3, escape_field=None)
        observation, _ = envs.reset(seed=0)
        policy = dataclasses.replace(plan, env_id=env_id).policy()
        actions, state = policy.predict(observation, state="kept")
        assert actions.shape == (3, 4) and state == "kept"
        single, _ = policy.predict(observation[1])
        np.testing.assert_array_equal(single, actions[1])


def test_policy_catches_up_after_a_stall(plan):
    env = gym.make(PUSH, escape_field=None).unwrapped
    observation, _ = env.reset(seed=0, options={"state": {"step": 200, "pose": [0.0, -0.8, 0.0]}})
    policy = OpenLoopPolicy(plan)
    action, _ = policy.predict(observation)
    np.testing.assert_array_equal(action, 1.0)  # the path is far ahead
    for _ in range(700):
        observation, *_ = env.step(policy.predict(observation)[0])
    np.testing.assert_allclose(env.get_state().q_r[0], plan.path[900], atol=1e-9)


def test_what_is_no_plan_has_no_policy(plan, tmp_path):
    for given in (tmp_path / "plan.npz", plan.path, None):
        with pytest.raises(PlanError, match=r"Plan\.load"):
            OpenLoopPolicy(given)
    with pytest.raises(PlanError, match=r"no environment .*PlanarArmPush"):
        OpenLoopPolicy(dataclasses.replace(plan, env_id="piec_envs/PlanarLegPush-v0"))
    with pytest.raises(PlanError, match="static caging"):
        OpenLoopPolicy(dataclasses.replace(plan, env_id="piec_envs/PlanarArmCage-v0"))
    with pytest.raises(PlanError, match=r"no environment .*contact"):
        OpenLoopPolicy(dataclasses.replace(plan, env_kwargs={"contact": "link"}))


def test_a_missing_file_is_called_missing(plan, tmp_path):
    plan.save(tmp_path / "caging.npz")
    with pytest.raises(
        PlanError, match=r"there is no file .*cagin\.npz; did you mean .*caging\.npz\?"
    ) as caught:
        Plan.load(tmp_path / "cagin.npz")
    assert "broken" not in str(caught.value)
    with pytest.raises(PlanError, match="no folder"):
        Plan.load(tmp_path / "nowhere" / "caging.npz")
    with pytest.raises(PlanError, match="is a folder"):
        Plan.load(tmp_path)

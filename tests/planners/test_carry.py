"""Carrying: the base moves in a straight line or along the reference, and the arm keeps its
posture.
"""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError, PlanError
from piec_envs.model.task import MOBILE, mobile_franka_track
from planners import OpenLoopPolicy, Plan, RigidCarry

PUSH = "piec_envs/MobileFrankaPush-v0"
TRACK = "piec_envs/MobileFrankaTrack-v0"
CAPSULES = {"geometry": "capsules"}
# out of reach of the object, so that nothing presses on the arm
CLEAR = [-1.0, 1.0, 0.5, -1.5, 1.5]
LINE = MOBILE.goal - MOBILE.start[:2]


@pytest.mark.parametrize("arrive", [0.6, 1.0])
def test_the_base_moves_in_a_straight_line_and_the_arm_stays(arrive):
    plan = RigidCarry(arrive=arrive).plan(PUSH, start=CLEAR, **CAPSULES)
    share = np.minimum(np.arange(1001) / (1000 * arrive), 1.0)
    np.testing.assert_allclose(plan.path[:, :2], CLEAR[:2] + share[:, None] * LINE, atol=1e-9)
    np.testing.assert_allclose(plan.path[:, 2:], np.tile(CLEAR[2:], (1001, 1)), atol=1e-9)


@pytest.mark.parametrize("side", ["right", "left"])
def test_the_base_follows_a_reference_in_time(side):
    plan = RigidCarry().plan(TRACK, start=CLEAR, reference=side, **CAPSULES)
    reference = mobile_franka_track(side).reference
    np.testing.assert_allclose(plan.path[:, :2] - CLEAR[:2], reference - reference[0], atol=1e-9)
    np.testing.assert_allclose(plan.path[:, 2:], np.tile(CLEAR[2:], (1001, 1)), atol=1e-9)


def test_a_caged_object_arrives_and_the_plan_says_what_happens():
    plan = RigidCarry().plan(PUSH, **CAPSULES)
    assert (
        plan.nominal["d2g"] == 0
        and plan.objective == "carry"
        and plan.robot == "mobile_franka_capsules"
    )
    env = gym.make(PUSH, escape_field=None, **CAPSULES).unwrapped
    env.reset(seed=0)
    pose = env.rollout(env.get_state(), path=plan.path[None, 1:]).motion.pose[0, -1]
    assert np.hypot(*(pose[:2] - MOBILE.goal)) == pytest.approx(
        plan.nominal["goal_distance"], abs=1e-9
    )
    # it is pressed a little
    np.testing.assert_allclose(plan.path[-1] - plan.path[0], [*LINE, 0, 0, 0], atol=0.02)


def test_a_plan_of_a_mobile_robot_round_trips_through_a_file(tmp_path):
    plan = RigidCarry().plan(PUSH, seed=3, contact="link", start="cage", **CAPSULES)
    again = Plan.load(plan.save(tmp_path / "plan.npz"))
    for name, value in vars(plan).items():
        np.testing.assert_array_equal(getattr(again, name), value)
    assert again.env_kwargs == {
        "escape_field": None,
        "contact": "link",
        "start": "cage",
        **CAPSULES,
    }


def test_a_robot_that_stands_still_carries_nothing():
    for env_id, options in (
        ("piec_envs/FrankaPush-v0", CAPSULES),
        ("piec_envs/PlanarArmPush-v0", {}),
    ):
        with pytest.raises(InvalidParameterError, match="no base that slides"):
            RigidCarry().plan(env_id, **options)


@pytest.mark.parametrize("arrive", [0.0, 1.1, np.nan])
def test_a_bad_arrival_is_refused(arrive):
    with pytest.raises(InvalidParameterError, match="arrive"):
        RigidCarry(arrive=arrive)


@pytest.fixture(scope="module")
def plan() -> Plan:
    return RigidCarry().plan(PUSH, start=CLEAR, **CAPSULES)


def test_the_policy_catches_up_exactly_after_a_stall(plan):
    """All five joints are behind the path: base and arm reach it, and then follow it."""
    path = plan.path + np.linspace(0, 1, 1001)[:, None] * [0.0, 0.0, 0.4, -0.3, 0.5]
    policy = OpenLoopPolicy(dataclasses.replace(plan, path=path))
    env = gym.make(PUSH, escape_field=None, start=CLEAR, **CAPSULES).unwrapped
    observation, _ = env.reset(seed=0, options={"state": {"step": 300}})
    action, _ = policy.predict(observation)
    np.testing.assert_array_equal(action, np.sign(path[301] - path[0]))  # the path is far ahead
    for t in range(301, 800):
        observation, *_ = env.step(policy.predict(observation)[0])
        if t > 450:
            np.testing.assert_allclose(env.get_state().q_r[0], path[t], atol=1e-9)


def test_a_plan_fits_its_own_start_and_contact_alone(plan):
    plan.check_fits(PUSH, "mobile_franka_capsules", np.array(CLEAR))
    with pytest.raises(
        PlanError,
        match=r"starts at \[-1\.0, 1\.0, 0\.5.*but the arm at \[-1\.0, 1\.0, 0\.6.*`start`",
    ):
        plan.check_fits(PUSH, "mobile_franka_capsules", np.add(CLEAR, [0, 0, 0.1, 0, 0]))
    for other in ("mobile_franka_link_capsules", "mobile_franka_point_capsules", "mobile_franka"):
        with pytest.raises(PlanError, match=f"of 'mobile_franka_capsules', not .* of '{other}'"):
            plan.check_fits(PUSH, other, np.array(CLEAR))

"""What a sliding base changes: observations from the base, goals in the world, references along
arcs.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.model.task import ARC, ARRIVAL, HORIZON, MOBILE, get_task, mobile_franka_track
from piec_envs.model.terms import observation_layout
from piec_envs.world.robots import get_robot

PUSH = "piec_envs/MobileFrankaPush-v0"
TRACK = "piec_envs/MobileFrankaTrack-v0"
CAPSULES = {"geometry": "capsules", "escape_field": None}
Q = np.array([-0.4, 0.3, 0.5, -1.2, 1.9])
POSE = np.array([0.6, 0.5, 0.7])
GOAL = np.array([-0.3, 0.2])
SHIFT = np.array([0.25, -0.35])
ROBOT = get_robot("mobile_franka_capsules")


def seen(q=Q, pose=POSE, goal=GOAL, env_id=PUSH, **options):
    """First observation of an episode."""
    env = gym.make(env_id, goal=tuple(goal), **CAPSULES, **options).unwrapped
    return env.reset(seed=0, options={"state": {"q_r": q, "pose": pose}})[0]


def moved(array, shift):
    return np.concatenate([array[:2] + shift, array[2:]])


def entries(*names, tracking=False):
    layout = observation_layout(
        ROBOT, get_task("mobile_franka_track_left" if tracking else "mobile_franka_push")
    )
    return np.concatenate([np.arange(layout.size)[layout.slices[name]] for name in names])


def changed(a, b):
    return set(np.flatnonzero(np.abs(a - b) > 1e-9).tolist())


BASE = {*entries("q_r")[:2].tolist(), *entries("q_cmd")[:2].tolist()}


def test_moving_everything_changes_the_base_alone():
    before = seen()
    after = seen(moved(Q, SHIFT), moved(POSE, SHIFT), GOAL + SHIFT)
    assert changed(before, after) == BASE
    for name in ("q_r", "q_cmd"):
        # over the limits
        np.testing.assert_allclose((after - before)[entries(name)[:2]], SHIFT / 2.0, atol=1e-12)


@pytest.mark.parametrize("env_id", [PUSH, TRACK])
def test_the_object_is_seen_from_the_base(env_id):
    tracking = env_id == TRACK
    before = seen(env_id=env_id)
    after = seen(moved(Q, SHIFT), env_id=env_id)
    place = entries("object", tracking=tracking)
    assert changed(before, after) == BASE | set(place[:2].tolist())
    np.testing.assert_allclose(
        before[place], [*(POSE[:2] - Q[:2]), np.cos(0.7), np.sin(0.7)], atol=1e-12
    )
    np.testing.assert_allclose((after - before)[place[:2]], -SHIFT, atol=1e-12)
    np.testing.assert_allclose(
        before[entries("goal", tracking=tracking)], GOAL - POSE[:2], atol=1e-12
    )


def test_cosine_and_sine_are_of_turning_joints_alone():
    observation = seen()
    np.testing.assert_allclose(
        observation[entries("cos_q", "sin_q")], [*np.cos(Q[2:]), *np.sin(Q[2:])], atol=1e-12
    )


def test_goals_stay_in_the_world():
    for shift in (np.zeros(2), SHIFT):
        observation = seen(moved(Q, shift), goal_conditioned=True)
        np.testing.assert_array_equal(observation["achieved_goal"], POSE[:2])
        np.testing.assert_array_equal(observation["desired_goal"], GOAL)


# --- references --------------------------------------------------------------------------------

START = MOBILE.start[:2]
SIDES = {side: mobile_franka_track(side).reference for side in ("right", "left")}


@pytest.mark.parametrize("side", SIDES)
def test_a_reference_begins_and_ends_right_at_constant_speed(side):
    reference = SIDES[side]
    assert reference.shape == (HORIZON + 1, 2)
    np.testing.assert_allclose(reference[0], START, atol=1e-12)
    np.testing.assert_allclose(
        reference[ARRIVAL:], np.tile(MOBILE.goal, (HORIZON + 1 - ARRIVAL, 1)), atol=1e-12
    )
    steps = np.hypot(*np.diff(reference[: ARRIVAL + 1], axis=0).T)
    np.testing.assert_allclose(steps, steps[0], rtol=1e-9)
    radius = np.hypot(*(MOBILE.goal - START)) / 2 / np.sin(ARC / 2)
    assert steps.sum() == pytest.approx(ARC * radius, rel=1e-5)
    assert steps[0] < 0.1 * ROBOT.speed_limit[:2].min()  # the base can follow


def test_the_references_are_mirror_images_across_the_straight_line():
    along = (MOBILE.goal - START) / np.hypot(*(MOBILE.goal - START))
    right = SIDES["right"] - START
    left = SIDES["left"] - START
    np.testing.assert_allclose(2 * np.outer(right @ along, along) - right, left, atol=1e-12)
    assert (SIDES["right"] - SIDES["left"])[1:ARRIVAL, 0].min() > 0  # right is towards +x
    bulge = np.hypot(*(SIDES["right"][ARRIVAL // 2] - (START + MOBILE.goal) / 2))
    assert bulge == pytest.approx(np.hypot(*(MOBILE.goal - START)) / 2 * np.tan(ARC / 4))


@pytest.mark.parametrize("side", SIDES)
def test_the_keyword_chooses_the_reference(side):
    env = gym.make(TRACK, reference=side, **CAPSULES).unwrapped
    np.testing.assert_array_equal(env.model.task.reference, SIDES[side])

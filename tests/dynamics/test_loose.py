"""Loose bodies beside an object: where they start, that they push and are pushed, and what is
remembered.
"""

from __future__ import annotations

import gymnasium as gym
import mujoco
import numpy as np
import pytest

from piec_envs.dynamics.free_bodies import SUNK, places_in, places_of, poses_at_start, rest_state
from piec_envs.dynamics.mjcf import OBJECT_FRICTION, TABLE_FRICTION, mujoco_model
from piec_envs.dynamics.mujoco_ import MujocoDynamics
from piec_envs.dynamics.protocol import Commands, Plant
from piec_envs.world.objects import OBJECTS, get_object

PUSH = "piec_envs/PlanarArmPush-v0"
LOOSE = [name for name, item in OBJECTS.items() if item.loose]
BETWEEN = "a4_box_roll_2"  # its roll stands between an arm along x and a box above it
ABOVE = np.array([[0.6, 0.265, 0.0]])  # of the box: 105 mm from the arm, its roll 4 mm
START = np.zeros((1, 4))


def plant_of(*names) -> Plant:
    return Plant("planar_arm", names, np.full(len(names), 0.5))


def sweep(name, steps=25, pose=ABOVE, speed=1.0):
    actions = np.zeros((1, steps, 4))
    actions[:, :, 0] = speed
    return MujocoDynamics().rollout(START, START, pose, Commands(actions), plant_of(name))


def roll_of(state) -> np.ndarray:
    """Position of the roll in a row's memory, shape (3,)."""
    return places_in(state, 4, 2)[1, :3]


@pytest.mark.parametrize("name", LOOSE)
def test_they_start_beside_the_object_and_rest(name):
    item = get_object(name)
    pose = np.array([-0.5, 0.6, 0.7])
    env = gym.make(PUSH, object=name, dynamics="mujoco", escape_field=None).unwrapped
    env.reset(seed=0, options={"state": {"pose": pose}})
    x, y, angle = item.loose[0].pose
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    start = np.array([pose[0] + c * x - s * y, pose[1] + s * x + c * y])
    np.testing.assert_allclose(
        roll_of(env.get_state().memory[0]), [*start, 0.11 - SUNK], atol=1e-12
    )
    np.testing.assert_allclose(poses_at_start(item, pose)[1], [*start, pose[2] + angle], atol=1e-12)
    for _ in range(20):
        env.step(np.zeros(4))
    np.testing.assert_allclose(roll_of(env.get_state().memory[0])[:2], start, atol=1e-6)
    np.testing.assert_allclose(env.get_state().pose[0], pose, atol=1e-6)


@pytest.mark.parametrize("name", LOOSE)
def test_the_state_is_the_engines(name):
    model = mujoco_model("planar_arm", name, 0.5)
    item = get_object(name)
    pose = np.array([-0.5, 0.6, 0.7])
    state = rest_state(item, np.zeros(4), poses_at_start(item, pose))
    assert len(state) == mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    data = mujoco.MjData(model)
    mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
    mujoco.mj_kinematics(model, data)
    np.testing.assert_allclose(data.body("object").xpos, [*pose[:2], 0.11 - SUNK])
    np.testing.assert_allclose(data.body("loose 1").xpos, roll_of(state))


def test_each_pair_has_its_own_friction():
    model = mujoco_model("planar_arm", BETWEEN, 0.15)
    pairs = {model.pair(k).name: model.pair_friction[k, 0] for k in range(model.npair)}
    wanted = {
        f"link {k} shape 0 on {body} shape 0": 0.15
        for k in (1, 2, 3, 4)
        for body in ("object", "loose 1")
    }
    wanted |= {f"table on {body} shape 0": TABLE_FRICTION for body in ("object", "loose 1")}
    assert pairs == {**wanted, "object shape 0 on loose 1 shape 0": OBJECT_FRICTION}
    assert model.body("loose 1").mass[0] == pytest.approx(0.1)


def test_the_arm_moves_the_object_through_the_roll():
    pushed = sweep(BETWEEN)
    alone = sweep("a4_box")
    assert pushed.link_distance.min() > 0.03 and not pushed.contact.any()  # by the roll alone
    assert np.linalg.norm(roll_of(pushed.memory[0])[:2] - [0.6, ABOVE[0, 1] - 0.161]) > 0.02
    assert pushed.pose[0, -1, 1] - ABOVE[0, 1] > 0.02
    np.testing.assert_allclose(alone.pose[0, -1], ABOVE[0], atol=1e-6)
    np.testing.assert_array_equal(places_in(pushed.memory[0], 4, 2)[0, :2], pushed.pose[0, -1, :2])


def test_a_roll_behind_the_object_is_pushed_and_pushes_back():
    """Carried along, it weighs on the arm and the box, so that the box's path is another one."""
    near = np.array([[0.6, 0.162, 0.0]])
    behind, alone = (sweep(name, pose=near, steps=40) for name in ("a4_box_roll_1", "a4_box"))
    roll = roll_of(behind.memory[0])
    assert roll[1] - (near[0, 1] + 0.161) > 0.02 and behind.contact.any()
    assert 1e-3 < np.abs(behind.pose[0, -1] - alone.pose[0, -1]).max() < 0.1
    x, y, angle = behind.pose[0, -1]
    above = (roll[:2] - (x, y)) @ (-np.sin(angle), np.cos(angle))  # along the box's short side
    # neither inside nor toppled
    assert 0.16 - 5e-4 < above < 0.17 and roll[2] == pytest.approx(0.11, abs=1e-3)


def test_rows_do_not_depend_on_their_neighbours():
    names = [BETWEEN, "a4_box", "a4_box_roll_1", BETWEEN]
    actions = np.zeros((4, 15, 4))
    actions[:, :, 0] = [[1.0], [1.0], [1.0], [0.6]]
    q = np.zeros((4, 4))
    together = MujocoDynamics().rollout(
        q, q, np.repeat(ABOVE, 4, axis=0), Commands(actions), plant_of(*names)
    )
    for i, name in enumerate(names):
        alone = sweep(name, steps=15, speed=actions[i, 0, 0])
        np.testing.assert_array_equal(together.memory[i], alone.memory[0])
        np.testing.assert_array_equal(together.pose[i], alone.pose[0])


def test_overlaps_of_the_roll_are_relaxed():
    """Of a roll with the arm by 6 mm, which pushes it against the box; the box itself is clear of
    the arm.
    """
    pose = ABOVE - [[0.0, 0.01, 0.0]]
    dynamics = MujocoDynamics()
    (settled,), (memory,) = dynamics.settle(START, pose, plant_of(BETWEEN))
    roll = roll_of(memory)
    angle = settled[2]
    # in the box's frame
    below = np.sin(angle) * (roll[0] - settled[0]) - np.cos(angle) * (roll[1] - settled[1])
    assert roll[1] - 0.05 - 0.05 >= -1.1e-4 and below - 0.05 - 0.11 >= -1.1e-4
    assert 1e-3 < settled[1] - pose[0, 1] < 0.01 and abs(settled[0] - pose[0, 0]) < 2e-3
    assert -0.05 < angle < -1e-3  # the roll stands left of the middle and turns the box clockwise
    hold = Commands(np.zeros((1, 20, 4)))
    calm = dynamics.rollout(START, START, settled[None], hold, plant_of(BETWEEN), [memory])
    assert np.abs(calm.pose[0, -1] - settled).max() < 2e-3
    assert np.abs(roll_of(calm.memory[0]) - roll).max() < 2e-3
    thrown = dynamics.rollout(START, START, pose, hold, plant_of(BETWEEN))
    assert np.abs(roll_of(thrown.memory[0]) - roll).max() > 2e-3  # what is avoided


def test_places_follow_the_memory_that_fits():
    item = get_object(BETWEEN)
    moved = sweep(BETWEEN)
    q = moved.q_r[0, -1]
    pose = moved.pose[0, -1]
    memory = moved.memory[0]
    np.testing.assert_array_equal(places_of(item, q, pose, memory), places_in(memory, 4, 2))
    elsewhere = places_of(item, q, pose + 0.1, memory)
    np.testing.assert_allclose(elsewhere[:, :2], poses_at_start(item, pose + 0.1)[:, :2])


PLANTS = [
    {"object": BETWEEN, "mass": 2.0, "delay": 0.03, "disturbance": 0.003},
    {"object": "a4_box_roll_1", "mass": 0.5, "delay": 0.1, "friction": 0.2},
]


@pytest.mark.parametrize(
    ("choice", "pose"), [(PLANTS[0], ABOVE[0]), (PLANTS[1], [0.6, 0.162, 0.0])], ids=str
)
def test_stepping_rollouts_and_restored_states_agree(choice, pose):
    env = gym.make(PUSH, dynamics="mujoco", escape_field=None, **choice).unwrapped
    other = gym.make(PUSH, dynamics="mujoco", escape_field=None, **choice).unwrapped
    env.reset(seed=3, options={"state": {"pose": pose}})
    other.reset(seed=8)
    begin = env.get_state()
    push = np.array([0.9, 0.1, 0.1, 0.0])
    for _ in range(15):
        env.step(push)
    middle = env.get_state()
    actions = push + np.random.default_rng(0).uniform(-0.1, 0.1, (20, 4))
    rollout = env.rollout(middle, controls=actions[None])
    other.set_state(middle)
    for t, action in enumerate(actions):
        env.step(action)
        other.step(action)
        for one in (env.get_state(), other.get_state()):
            np.testing.assert_array_equal(one.pose[0], rollout.motion.pose[0, t + 1])
            np.testing.assert_array_equal(one.q_r[0], rollout.motion.q_r[0, t + 1])
    end = env.get_state()
    for one in (other.get_state(), rollout.final):
        np.testing.assert_array_equal(one.memory[0], end.memory[0])
    assert np.abs(roll_of(end.memory[0]) - roll_of(begin.memory[0])).max() > 0.02
    assert np.abs(end.pose - begin.pose).max() > 0.02

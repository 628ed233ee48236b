"""States: saved, restored, rolled out from, and given to reset."""

from __future__ import annotations

import dataclasses

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.dynamics.by_row import DYNAMICS
from piec_envs.dynamics.plant import PlantParams
from piec_envs.env.makers import make_setup
from piec_envs.env.registry import MOTIONS
from piec_envs.geometry.body import scene_distances
from piec_envs.model.start import StartSampler
from piec_envs.world.packed import pack_scene

NOISY = {"disturbance": 0.005, "adversary": 0.3, "start_noise": (0.01, 0.05), "object": "square"}


def same(a, b) -> bool:
    """Equal to the last bit, through dicts."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(a, b)


TOUCHING = {"state": {"pose": [0.6, 0.1255, 0.0]}}  # a square at the planar arm's side


def touching(env):
    """Options of `reset` that put the square beside the arm of any environment, straight and along
    x.
    """
    home = env.model.robot.home
    scene = pack_scene(env.model.robot.name, "square")
    distances = np.empty(scene.robot.links)
    for y in np.arange(0.1, 0.4, 0.0005):
        scene_distances(scene, home, np.array([0.6, y, 0.0]), distances)
        if distances.min() > 0:
            return {"state": {"q_r": home, "pose": [0.6, y, 0.0]}}
    raise AssertionError("no place beside the arm")


@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize("env_id", MOTIONS)
def test_state_restores_everything(env_id, dynamics):
    choice = {**NOISY, "dynamics": dynamics}
    env = gym.make(env_id, **choice).unwrapped
    env.reset(seed=1, options=touching(env))
    actions = np.random.default_rng(2).uniform(-1, 1, (60, *env.action_space.shape))
    for action in actions[:25]:
        env.step(action)
    state = env.get_state()
    expected = [env.step(action) for action in actions[25:]]
    other = gym.make(env_id, **choice).unwrapped
    other.reset(seed=99)
    for restore in (env.set_state, other.set_state, lambda s: other.reset(options={"state": s})):
        restore(state)
        continued = [
            (env if restore == env.set_state else other).step(action) for action in actions[25:]
        ]
        for a, b in zip(expected, continued, strict=True):
            assert same(a[0], b[0]) and a[1] == b[1] and same(a[4], b[4])


@pytest.mark.parametrize("env_id", MOTIONS)
@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize("choice", [NOISY, {"escape_field": None, "object": "square"}], ids=str)
def test_rollout_equals_stepping(env_id, choice, dynamics):
    env = gym.make(env_id, dynamics=dynamics, **choice).unwrapped
    env.reset(seed=3, options=touching(env))
    (n,) = env.action_space.shape
    for _ in range(13):  # a rollout may begin between two refreshes of the field
        env.step(np.full(n, 0.5))
    state = env.get_state()
    controls = np.random.default_rng(0).uniform(-1, 1, (2, 40, n))
    rollout = env.rollout(state, controls=controls)
    path = env.rollout(
        state, path=state.q_r[:, None] + np.linspace(0, 0.3, 40)[None, :, None] * np.ones(n)
    )
    followed = env.rollout(state, controls=path.motion.actions)
    np.testing.assert_array_equal(followed.motion.pose, path.motion.pose)
    for i in range(2):
        env.set_state(state)
        for t in range(40):
            _, reward, _, _, info = env.step(controls[i, t])
            now = env.get_state()
            np.testing.assert_array_equal(now.pose[0], rollout.motion.pose[i, t + 1])
            np.testing.assert_array_equal(now.q_r[0], rollout.motion.q_r[i, t + 1])
            assert now.escape_time[0] == rollout.escape_time[i, t + 1]
            assert reward == -1e-3 * rollout.column("cost")[i, t + 1]
            assert info["goal_distance"] == rollout.column("goal_distance")[i, t + 1]


@pytest.mark.parametrize("env_id", MOTIONS)
def test_the_last_step_alone_charges_the_distance_to_the_goal_region(env_id):
    """What planners minimise and agents are rewarded for is one sum, and the way of counting does
    not matter.
    """
    choice = {"escape_field": None, "prior": "contact"}
    env = gym.make(env_id, **choice).unwrapped
    held = gym.make(env_id, action_repeat=4, **choice).unwrapped
    env.reset(seed=0)
    state = env.get_state()
    weights = env.model.weights
    (n,) = env.action_space.shape
    state.step[:] = env.model.task.horizon - 4
    rollout = env.rollout(state, controls=np.zeros((1, 4, n)))
    env.set_state(state)
    rewards = []
    for left in (3, 2, 1, 0):
        _, reward, _, _, info = env.step(np.zeros(n))
        stage = weights.task * info["cost_task"] + weights.command * info["cost_command"]
        stage += weights.prior * info["cost_prior"] + (
            weights.miss * info["d2g"] if left == 0 else 0.0
        )
        assert info["d2g"] > 0.1 and -1e3 * reward == pytest.approx(stage, rel=1e-12)
        rewards.append(reward)
    held.reset(seed=0)
    held.set_state(state)
    assert held.step(np.zeros(n))[1] == pytest.approx(sum(rewards), rel=1e-12)
    assert rollout.cost[0] == pytest.approx(-1e3 * sum(rewards), rel=1e-12)


def test_a_state_may_go_on_under_another_dynamics():
    """The new one begins at rest where the old one left joints and object."""
    env = gym.make("piec_envs/PlanarArmPush-v0", escape_field=None, object="square").unwrapped
    env.reset(seed=0, options=TOUCHING)
    for dynamics in (*reversed(DYNAMICS), *DYNAMICS):
        for _ in range(5):
            env.step(np.full(4, 0.5))
        before = env.get_state()
        env.reset(options={"state": before, "params": {"dynamics": dynamics}})
        assert env.get_params()["dynamics"] == dynamics
        np.testing.assert_array_equal(env.get_state().pose, before.pose)
    assert env.get_state().pose[0, 1] > 0.126


def test_shape_mismatch_moves_an_overlapping_start():
    """The true object is larger than the planned one: the start gives way by at most 20 mm."""
    setup = make_setup("piec_envs/PlanarArmPush-v0", escape_field=None)
    # free for the circle alone
    task = dataclasses.replace(setup.task, start=np.array([0.6, 0.13, 0.4]))
    sampler = StartSampler(dataclasses.replace(setup, task=task))
    circle, square = (
        sampler.draw(PlantParams(object=name), 0, np.random.default_rng(0))
        for name in ("circle", "square")
    )
    np.testing.assert_array_equal(circle.pose[0], task.start)
    moved = square.pose[0] - task.start
    assert 0 < np.hypot(moved[0], moved[1]) <= 0.02 + 1e-12 and abs(moved[2]) <= 0.3 + 1e-12
    distances = np.empty(4)
    scene_distances(pack_scene("planar_arm", "square"), square.q_r[0], square.pose[0], distances)
    assert distances.min() >= 0
    np.testing.assert_array_equal(square.start, square.pose)


def test_reset_with_a_state_takes_each_row_its_own():
    envs = gym.make_vec("piec_envs/PlanarArmPush-v0", num_envs=3, **NOISY)
    envs.reset(seed=0)
    for _ in range(7):
        envs.step(np.random.default_rng(0).uniform(-1, 1, (3, 4)))
    state = envs.unwrapped.get_state()
    for _ in range(5):
        envs.step(np.ones((3, 4)))
    envs.reset(options={"state": state, "reset_mask": np.array([False, True, True])})
    now = envs.unwrapped.get_state()
    np.testing.assert_array_equal(now.pose[1:], state.pose[1:])
    assert now.step.tolist() == [12, 7, 7]


def test_rollout_of_rows_at_different_steps_equals_stepping():
    envs = gym.make_vec("piec_envs/PlanarArmPush-v0", num_envs=2, **NOISY)
    envs.reset(seed=0)
    for _ in range(3):
        envs.step(np.ones((2, 4)))
    envs.reset(options={"reset_mask": np.array([False, True])})
    controls = np.random.default_rng(1).uniform(-1, 1, (2, 30, 4))
    rollout = envs.unwrapped.rollout(envs.unwrapped.get_state(), controls=controls)
    for t in range(30):
        envs.step(controls[:, t])
        now = envs.unwrapped.get_state()
        np.testing.assert_array_equal(now.pose, rollout.motion.pose[:, t + 1])
        np.testing.assert_array_equal(now.escape_time, rollout.escape_time[:, t + 1])


def test_any_state_of_an_episode_can_be_restored():
    """Displaced poses overlap the arm for a moment; they are states all the same."""
    env = gym.make(
        "piec_envs/PlanarArmPush-v0", escape_field=None, disturbance=0.005, noise_entry="state"
    ).unwrapped
    env.reset(seed=0, options={"state": {"pose": [0.6, 0.13, 0.0]}})
    for _ in range(60):
        env.step(np.array([1.0, 0.0, 0.0, 0.0]))
        state = env.get_state()
        env.reset(options={"state": state})
        np.testing.assert_array_equal(env.get_state().pose, state.pose)


def test_an_object_that_fled_stays_when_it_no_longer_flees():
    env = gym.make("piec_envs/PlanarArmPush-v0", adversary=1.0).unwrapped
    env.reset(seed=0, options={"state": {"pose": [-0.5, -0.5, 0.0]}})
    env.step(np.zeros(4))
    calm = {"adversary": 0.0, "disturbance": 1e-9}
    env.reset(options={"state": env.get_state(), "params": calm})
    before = env.get_state().pose
    for _ in range(50):
        env.step(np.zeros(4))
    np.testing.assert_allclose(env.get_state().pose, before, atol=1e-6)


def test_one_row_begins_anew_without_touching_the_others_noise():
    envs = gym.make_vec(
        "piec_envs/PlanarArmPush-v0", num_envs=2, escape_field=None, disturbance=0.005
    )
    other = gym.make_vec(
        "piec_envs/PlanarArmPush-v0", num_envs=2, escape_field=None, disturbance=0.005
    )
    for each in (envs, other):
        each.reset(seed=0)
        each.step(np.zeros((2, 4)))
    envs.reset(options={"reset_mask": np.array([False, True])})
    for _ in range(20):
        envs.step(np.zeros((2, 4)))
        other.step(np.zeros((2, 4)))
    a = envs.unwrapped.get_state()
    b = other.unwrapped.get_state()
    np.testing.assert_array_equal(a.pose[0], b.pose[0])
    assert (a.pose[1] != b.pose[1]).any()

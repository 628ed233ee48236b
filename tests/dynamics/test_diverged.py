"""Rows whose step has no answer, or none that can be believed, rest in their last good state and
say so.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.dynamics.by_row import DYNAMICS, DynamicsOptions
from piec_envs.dynamics.contact_model import PAPER_MODEL
from piec_envs.dynamics.mujoco_ import LARGEST_MOVE, MujocoDynamics
from piec_envs.dynamics.protocol import POSITION_LIMIT, Commands, Plant, blank_motion
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.errors import InvalidParameterError

STEPS = 8
PUSH = "piec_envs/PlanarArmPush-v0"
INSIDE = [0.6, 0.02, 0.1]  # of three discs on the arm's axis: links on both sides, no way out
PAPER = {"object": "three_discs", "preset": "paper", "escape_field": None, "prior": "contact"}
every_solver = pytest.mark.parametrize("solver", ["fast", "osqp"])


def moving(rows):
    """A motion in which every number is another one."""
    rng = np.random.default_rng(0)
    motion = blank_motion(*(rng.normal(size=(rows, k)) for k in (4, 4, 3)), STEPS, 4)
    for array in (motion.q_r, motion.q_cmd, motion.pose, motion.actions, motion.link_distance):
        array[:] = rng.normal(size=array.shape)
    motion.contact[:] = True
    motion.active[:] = 2
    return motion


@pytest.mark.parametrize("k", [1, 3, STEPS])
def test_a_row_is_held_from_the_step_before(k):
    motion = moving(3)
    before = moving(3)
    failed = np.zeros((3, STEPS + 1), dtype=bool)
    failed[1, k] = True  # what follows was never computed
    motion.hold_diverged(failed)
    for field in ("q_r", "q_cmd", "pose", "link_distance", "contact"):
        found = getattr(motion, field)
        true = getattr(before, field)
        np.testing.assert_array_equal(found[1, :k], true[1, :k])
        np.testing.assert_array_equal(
            found[1, k:], np.repeat(true[1, k - 1 : k], STEPS + 1 - k, axis=0)
        )
        np.testing.assert_array_equal(found[[0, 2]], true[[0, 2]])  # the others are as they were
    assert motion.diverged[1].tolist() == [t >= k for t in range(STEPS + 1)]
    assert not motion.diverged[[0, 2]].any()
    assert (motion.active[1, k:] == 0).all() and (motion.actions[1, k - 1 :] == 0).all()
    np.testing.assert_array_equal(motion.actions[1, : k - 1], before.actions[1, : k - 1])


def test_a_sound_motion_stays_as_it_is():
    motion = moving(2)
    before = moving(2)
    motion.hold_diverged(np.zeros((2, STEPS + 1), dtype=bool))
    for name, value in vars(before).items():
        np.testing.assert_array_equal(getattr(motion, name), value)


def inside(state):
    """The same state with the object on the arm, which no user's state could begin with."""
    state.q_r[:] = 0.0
    state.q_cmd[:] = 0.0
    state.pose[:] = INSIDE
    return state


@every_solver
def test_a_step_without_solution_is_held_and_cut_short(solver):
    env = gym.make(PUSH, solver=solver, **PAPER).unwrapped
    env.reset(seed=0)
    env.set_state(inside(env.get_state()))
    observation, reward, terminated, truncated, info = env.step(np.zeros(4))
    np.testing.assert_array_equal(env.get_state().pose[0], INSIDE)
    assert info["diverged"] and truncated and not terminated and not info["is_success"]
    assert np.isfinite(reward) and observation in env.observation_space
    assert env.step(np.ones(4))[4]["diverged"]  # it rests until reset


@every_solver
def test_only_the_row_without_solution_is_held(solver):
    envs = gym.make_vec(PUSH, num_envs=3, solver=solver, **PAPER)
    envs.reset(seed=0)
    state = envs.unwrapped.get_state()
    state.pose[1] = INSIDE
    state.q_r[1] = 0.0
    state.q_cmd[1] = 0.0
    envs.unwrapped.set_state(state)
    _, reward, _, truncated, info = envs.step(np.ones((3, 4)))
    assert truncated.tolist() == info["diverged"].tolist() == [False, True, False]
    assert np.isfinite(reward).all()
    np.testing.assert_array_equal(envs.unwrapped.get_state().pose[1], INSIDE)


@every_solver
def test_a_rollout_holds_what_has_no_solution(solver):
    env = gym.make(PUSH, solver=solver, **PAPER).unwrapped
    env.reset(seed=0)
    good = env.get_state()
    both = inside(good.copy().take([0, 0]))
    both.pose[1] = good.pose[0]
    both.q_r[1] = good.q_r[0]
    both.q_cmd[1] = good.q_cmd[0]
    rollout = env.rollout(both, controls=np.ones((2, 5, 4)))
    assert rollout.motion.diverged[0, 1:].all() and not rollout.motion.diverged[1].any()
    np.testing.assert_array_equal(rollout.motion.pose[0], np.repeat([INSIDE], 6, axis=0))
    alone = env.rollout(good, controls=np.ones((1, 5, 4)))
    np.testing.assert_array_equal(rollout.motion.q_r[1], alone.motion.q_r[0])
    assert np.isfinite(rollout.measures).all()


@pytest.mark.parametrize("options", [{}, {"solver": "osqp"}], ids=["fast", "osqp"])
@pytest.mark.parametrize("model", [None, PAPER_MODEL], ids=["default", "paper"])
def test_a_jam_no_lead_can_open_moves_nothing_far(model, options):
    """Objects anywhere on and in the arm: what is not held moves as lead and push-out allow."""
    rng = np.random.default_rng(0)
    rows = 40
    q = rng.uniform([-3, -2.5, -2.5, -2.5], [3, 2.5, 2.5, 2.5], (rows, 4))
    pose = rng.uniform([-0.6, -0.6, -3], [0.6, 0.6, 3], (rows, 3))
    dynamics = QuasiDynamics(model=model, **options)
    plant = Plant("planar_arm", ["three_discs"] * rows, np.full(rows, 0.5))
    motion = dynamics.rollout(q, q, pose, Commands(np.ones((rows, 4, 4))), plant)
    assert np.abs(np.diff(motion.pose[..., :2], axis=1)).max() < 0.5
    assert np.abs(np.diff(motion.q_r, axis=1)).max() < 0.5
    for array in (motion.q_r, motion.pose, motion.link_distance):
        assert np.isfinite(array).all()


@pytest.mark.parametrize("name", DYNAMICS)
def test_an_object_beyond_its_bound_has_diverged(name):
    pose = np.array([[0.0, POSITION_LIMIT - 0.01, 0.0]])
    w = np.repeat([[[0.0, 0.004]]], 5, axis=1)
    commands = Commands(np.zeros((1, 5, 4)), displacement=w)
    plant = Plant("planar_arm", ["circle"], np.array([0.5]))
    q = np.zeros((1, 4))
    motion = DYNAMICS[name].made(DynamicsOptions()).rollout(q, q, pose, commands, plant)
    assert motion.diverged[0].tolist() == [False] * 3 + [True] * 3
    np.testing.assert_allclose(
        motion.pose[0, :, 1], pose[0, 1] + np.array([0, 0.004, 0.008, 0.008, 0.008, 0.008])
    )


def test_an_object_thrown_under_mujoco_has_diverged():
    """The engine simulates it without a warning; nothing in the scene could have done it."""
    dynamics = MujocoDynamics()
    q = np.zeros((1, 4))
    pose = np.array([[0.6, 0.4, 0.0]])
    plant = Plant("planar_arm", ["circle"], np.array([0.5]))
    commands = Commands(np.zeros((1, 2, 4)))
    memory = dynamics.rollout(q, q, pose, commands, plant).memory
    start = memory[0][1:5][None], q, np.array([[*memory[0][5:7], 0.0]])
    for speed, thrown in ((0.5 * LARGEST_MOVE / 0.1, False), (2 * LARGEST_MOVE / 0.1, True)):
        state = memory[0].copy()
        state[1 + 4 + 7 + 4] = speed  # along x
        motion = dynamics.rollout(*start, commands, plant, [state])
        assert motion.diverged[0].tolist() == [False, thrown, thrown]
        assert (motion.pose[0, -1] != start[2][0]).any() != thrown


@pytest.mark.parametrize("dynamics", DYNAMICS)
def test_a_posture_that_overlaps_the_object_is_refused(dynamics):
    with pytest.raises(
        InvalidParameterError, match=r"start=.*overlaps the object 'three_discs'.* mm; at most 1 mm"
    ):
        gym.make(PUSH, start=(0.35, 0.1, 0.1, 0.1), dynamics=dynamics, **PAPER)
    gym.make(PUSH, start=(-0.35, 0.1, 0.1, 0.1), dynamics=dynamics, **PAPER)

"""Contracts of every contact dynamics in the table, called as the episodes call it."""

from __future__ import annotations

import inspect

import numpy as np
import pytest

from piec_envs.dynamics.by_row import DYNAMICS, DynamicsByRow, DynamicsOptions
from piec_envs.dynamics.contact_model import PAPER_MODEL, ContactModel
from piec_envs.dynamics.protocol import Commands, Dynamics, Plant
from piec_envs.errors import InvalidStateError, UnknownNameError
from piec_envs.geometry.body import scene_distances
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import get_robot

ROBOT = get_robot("planar_arm")
LENGTHS = np.array([0.4, 0.4, 0.4, 0.2])
ARRAYS = ("q_r", "q_cmd", "pose", "actions", "link_distance", "contact", "active", "diverged")
every_dynamics = pytest.mark.parametrize("name", DYNAMICS)


def make(name, threads=None) -> Dynamics:
    return DYNAMICS[name].made(DynamicsOptions(threads=threads))


def plant_of(names, friction=0.5, dynamics=()) -> Plant:
    return Plant("planar_arm", names, np.broadcast_to(friction, len(names)).astype(float), dynamics)


def start_of(motion):
    return motion.q_r[:, 0], motion.q_cmd[:, 0], motion.pose[:, 0]


def assert_same(a, b, rows=slice(None)):
    for name in ARRAYS:
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name)[rows], err_msg=name)


@every_dynamics
def test_signatures_are_those_of_the_protocol(name):
    for method in ("rollout", "settle"):
        wanted = inspect.signature(getattr(Dynamics, method)).parameters
        for kind in (type(make(name)), DynamicsByRow):
            assert list(inspect.signature(getattr(kind, method)).parameters) == list(wanted)


@every_dynamics
def test_rows_threads_and_repetition_change_nothing(random_motion, name):
    motion = random_motion(
        "square", rows=6, steps=60, seed=3, sigma=0.003, dynamics=make(name, threads=1)
    )
    again = random_motion(
        "square", rows=6, steps=60, seed=3, sigma=0.003, dynamics=make(name, threads=2)
    )
    assert motion.contact.any()
    assert_same(motion, again)
    start = start_of(motion)
    rows = len(motion.q_r)
    together = make(name).rollout(*start, Commands(motion.actions), plant_of(["square"] * rows))
    for i in range(2):
        one = [array[i : i + 1] for array in start]
        alone = make(name).rollout(*one, Commands(motion.actions[i : i + 1]), plant_of(["square"]))
        assert_same(alone, together, slice(i, i + 1))


@every_dynamics
def test_two_halves_make_a_whole(random_motion, name):
    dynamics = make(name)
    motion = random_motion("hexagon", rows=4, steps=40, seed=4, dynamics=dynamics)
    plant = plant_of(["hexagon"] * len(motion.q_r))
    first = dynamics.rollout(*start_of(motion), Commands(motion.actions[:, :20]), plant)
    np.testing.assert_array_equal(first.pose, motion.pose[:, :21])
    rest = dynamics.rollout(
        first.q_r[:, -1],
        first.q_cmd[:, -1],
        first.pose[:, -1],
        Commands(motion.actions[:, 20:]),
        plant,
        first.memory,
    )
    np.testing.assert_array_equal(rest.pose, motion.pose[:, 20:])
    np.testing.assert_array_equal(rest.q_r, motion.q_r[:, 20:])


@every_dynamics
def test_without_contact_the_object_rests_and_the_arm_follows(name):
    rng = np.random.default_rng(0)
    rows = 5
    q = np.tile(ROBOT.home, (rows, 1))
    pose = np.tile([-1.1, -0.4, 0.3], (rows, 1))
    actions = np.repeat(rng.uniform(-1, 1, (rows, 4, 4)), 40, axis=1)  # (rows, 160, 4)
    motion = make(name).rollout(q, q, pose, Commands(actions), plant_of(["square"] * rows))
    assert motion.link_distance.min() > 0.01
    np.testing.assert_allclose(motion.pose, np.repeat(pose[:, None], 161, axis=1), atol=1e-9)
    wanted = q[:, None] + np.cumsum(0.1 * actions * ROBOT.speed_limit, axis=1)
    np.testing.assert_allclose(motion.q_cmd[:, 1:], wanted, atol=1e-12)  # no lead was cut
    np.testing.assert_allclose(motion.q_r[:, 1:], wanted, atol=0.01)
    assert not motion.contact.any() and not motion.active.any() and not motion.diverged.any()


@every_dynamics
@pytest.mark.parametrize("model", [ContactModel(), PAPER_MODEL], ids=["default", "paper"])
def test_the_lead_of_the_command_follows_the_settings(name, model):
    """A command far ahead of its joint is cut to the robot's lead, or kept."""
    dynamics = DYNAMICS[name].made(DynamicsOptions(model=model))
    far = np.array([[-1.1, -0.4, 0.3]])
    q = ROBOT.home[None]
    ahead = ROBOT.home[None] + 0.2
    motion = dynamics.rollout(q, ahead, far, Commands(np.zeros((1, 1, 4))), plant_of(["circle"]))
    lead = ahead - q if model.unlimited_lead else ROBOT.joint_array("max_lead")[None]
    np.testing.assert_allclose(motion.q_cmd[:, 1] - q, lead, atol=1e-12)


@every_dynamics
def test_distances_are_those_of_the_geometry(random_motion, name):
    motion = random_motion(
        "three_discs", rows=6, steps=30, seed=6, sigma=0.003, dynamics=make(name)
    )
    scene = pack_scene("planar_arm", "three_discs")
    distances = np.empty(4)
    for i, t in np.ndindex(motion.q_r.shape[:2]):
        scene_distances(scene, motion.q_r[i, t], motion.pose[i, t], distances)
        np.testing.assert_allclose(motion.link_distance[i, t], distances, atol=1e-12)
    assert motion.contact[motion.link_distance <= 1e-3].all()


def forward(q) -> np.ndarray:
    """Middle of the last link and its heading, shape (3,)."""
    heading = np.cumsum(q)
    reach = LENGTHS * [1, 1, 1, 0.5]
    return np.array([reach @ np.cos(heading), reach @ np.sin(heading), heading[-1]])


def follow(q, poses) -> np.ndarray:
    """Joint path along which the last link takes these poses, by Newton's method."""
    path = []
    for wanted in poses:
        for _ in range(20):
            steps = 1e-6 * np.eye(4)
            slope = np.array([(forward(q + e) - forward(q - e)) / 2e-6 for e in steps]).T
            q = q + np.linalg.pinv(slope) @ (wanted - forward(q))
        path.append(q)
    return np.array(path)


def test_slow_straight_push_by_a_links_side():
    """All dynamics push disc and square alike: the object goes with the link, straight, by
    0.2 m.
    """
    x = np.linspace(0.3, 0.5, 401)  # 0.005 m/s
    poses = np.column_stack([x, np.full(401, 0.1), np.full(401, np.pi / 2)])
    path = follow(np.array([-1.2, 1.0, 1.2, 0.5]), poses)
    np.testing.assert_allclose([forward(q) for q in path], poses, atol=1e-9)
    names = [name for name in ("circle", "square") for _ in DYNAMICS]
    pose = np.tile([0.3 + 0.05 + 0.075 + 1e-4, 0.1, 0.0], (len(names), 1))
    start = np.repeat(path[:1], len(names), axis=0)
    commands = Commands(np.repeat(path[None, 1:], len(names), axis=0), absolute=True)
    motion = DynamicsByRow().rollout(
        start, start, pose, commands, plant_of(names, dynamics=list(DYNAMICS) * 2)
    )
    moved = motion.pose[:, -1, :2] - pose[:, :2]
    np.testing.assert_allclose(np.linalg.norm(moved - [0.2, 0.0], axis=1), 0.0, atol=5e-3)
    assert motion.contact[:, 10:].any(axis=2).all()


def test_rows_of_a_batch_may_differ_in_their_dynamics(random_motion):
    whole = random_motion("square", rows=8, steps=30, seed=8)
    count = len(whole.q_r)
    commands = Commands(whole.actions)
    names = [list(DYNAMICS)[i % 2] for i in range(count)]
    mixed = DynamicsByRow().rollout(
        *start_of(whole), commands, plant_of(["square"] * count, dynamics=names)
    )
    for name in DYNAMICS:
        rows = [i for i in range(count) if names[i] == name]
        alone = make(name).rollout(*start_of(whole), commands, plant_of(["square"] * count))
        for array in ARRAYS:
            np.testing.assert_array_equal(getattr(mixed, array)[rows], getattr(alone, array)[rows])
        assert [len(mixed.memory[i]) for i in rows] == [len(alone.memory[i]) for i in rows]


@every_dynamics
def test_arrays_that_do_not_fit_are_refused(name):
    q = np.zeros((2, 4))
    pose = np.tile([0.0, 0.9, 0.0], (2, 1))
    good = Commands(np.zeros((2, 3, 4)))
    for arrays in (
        (q[:1], q, pose, good, plant_of(["circle"] * 2)),
        (q, q, pose[:, :2], good, plant_of(["circle"] * 2)),
        (q, q, pose, good, plant_of(["circle"])),
        (
            q,
            q,
            pose,
            Commands(good.values, displacement=np.zeros((2, 2, 2))),
            plant_of(["circle"] * 2),
        ),
    ):
        with pytest.raises(InvalidStateError):
            make(name).rollout(*arrays)


def test_unknown_dynamics_are_refused():
    q = np.zeros((1, 4))
    pose = np.array([[0.0, 0.9, 0.0]])
    with pytest.raises(UnknownNameError, match="mujoco, quasi_dynamic"):
        DynamicsByRow().rollout(
            q, q, pose, Commands(np.zeros((1, 1, 4))), plant_of(["circle"], dynamics=["magic"])
        )

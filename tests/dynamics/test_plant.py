"""Friction, mass and delay of a plant under MuJoCo, and what the quasi-dynamic model makes
of them.
"""

from __future__ import annotations

import dataclasses

import mujoco
import numpy as np
import pytest

from piec_envs.dynamics.by_row import DynamicsByRow
from piec_envs.dynamics.mjcf import build_spec, mujoco_model
from piec_envs.dynamics.mujoco_ import ENGINE_STEPS, MujocoDynamics
from piec_envs.dynamics.protocol import Commands, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.errors import InvalidParameterError, InvalidStateError
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot

AWAY = np.array([[-0.9, -0.6, 0.3]])
# (1, 12, 4)
FREE = np.repeat(np.array([[0.3, -0.2, 0.25, -0.3], [-0.1, 0.3, -0.2, 0.1]]), 6, axis=0)[None]


def plant_of(object_name="circle", mass=(1.0,), delay=(0.0,)) -> Plant:
    """A row for each mass and delay, of which one alone holds for all."""
    mass, delay = np.broadcast_arrays(np.asarray(mass, dtype=float), np.asarray(delay, dtype=float))
    return Plant("planar_arm", [object_name] * len(mass), np.full(len(mass), 0.5), (), mass, delay)


def arrays(model) -> dict[str, np.ndarray]:
    """Everything that a model says in numbers."""
    found = {}
    for part, prefix in ((model, ""), (model.stat, "stat."), (model.opt, "opt.")):
        values = {name: getattr(part, name) for name in dir(part) if not name.startswith("_")}
        found |= {
            prefix + name: np.asarray(v)
            for name, v in values.items()
            if isinstance(v, int | float | np.ndarray)
        }
    return found


@pytest.mark.parametrize("mass", [1.0, 2.5])
@pytest.mark.parametrize(
    ("robot", "object_name"),
    [("planar_arm", "paper_pack"), ("planar_arm", "a4_box_roll_1"), ("franka", "box")],
)
def test_a_changed_copy_is_the_compiled_model(robot, object_name, mass):
    item = get_object(object_name)
    heavy = dataclasses.replace(item, mass=mass * item.mass)
    compiled = arrays(build_spec(get_robot(robot), heavy, friction=0.35).compile())
    copied = arrays(mujoco_model(robot, object_name, 0.35, mass))
    assert compiled.keys() == copied.keys() and len(compiled) > 300
    for name, value in compiled.items():
        if mass == 1.0:
            np.testing.assert_array_equal(copied[name], value, err_msg=name)
        else:
            np.testing.assert_allclose(copied[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


@pytest.mark.parametrize("mass", [1.0, 2.5])
def test_a_changed_copy_moves_as_the_compiled_model(mass):
    """The arm sweeps a pack aside, the contacts having the friction asked for."""
    item = get_object("paper_pack")
    ends = []
    seen = 0
    heavy = dataclasses.replace(item, mass=mass * item.mass)
    fresh = build_spec(get_robot("planar_arm"), heavy, friction=0.35).compile()
    for model in (fresh, mujoco_model("planar_arm", "paper_pack", 0.35, mass)):
        data = mujoco.MjData(model)
        data.qpos[4:] = (0.6, 0.152, item.height / 2, 1, 0, 0, 0)
        data.ctrl[:] = (0.3, 0, 0, 0)
        for _ in range(150):
            mujoco.mj_step(model, data)
            arm = (model.geom_bodyid[data.contact.geom] > 0).all(axis=1)
            np.testing.assert_array_equal(data.contact.friction[arm, :2], 0.35)
            seen += arm.sum()
        ends.append(data.qpos.copy())
    # to the solver's tolerance
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-6 if mass != 1.0 else 0)
    assert seen > 100 and ends[0][5] > 0.2


def test_variants_do_not_touch_each_other():
    light = mujoco_model("planar_arm", "square", 0.2, 0.5)
    heavy = mujoco_model("planar_arm", "square", 0.7, 2.0)
    for model, friction, mass in ((light, 0.2, 0.5), (heavy, 0.7, 2.0)):
        pairs = {model.pair(k).name: model.pair_friction[k, 0] for k in range(model.npair)}
        assert (
            pairs["link 2 shape 0 on object shape 0"] == friction
            and pairs["table on object shape 0"] == 0.3
        )
        assert model.body("object").mass[0] == pytest.approx(0.5 * mass)


def sweep(mass, x, speed, steps):
    """The arm's side pushes a square ahead that stands at x, for each mass as a factor."""
    rows = len(mass)
    q = np.zeros((len(mass), 4))
    pose = np.tile([x, 0.05 + 0.075 + 1e-3, 0.0], (rows, 1))
    actions = np.zeros((rows, steps, 4))
    actions[:, :, 0] = speed
    return MujocoDynamics().rollout(q, q, pose, Commands(actions), plant_of("square", mass=mass))


def test_a_heavier_object_takes_the_same_way_and_more_torque():
    """Slowly pushed, it slides under Coulomb's friction alone: the drive lags in proportion to its
    weight.
    """
    motion = sweep([1.0, 2.0, 3.0], x=0.5, speed=0.2, steps=150)
    moved = motion.pose[:, -1] - motion.pose[:, 0]
    assert (moved[:, 1] > 0.05).all()
    np.testing.assert_allclose(moved, moved[[0, 0, 0]], atol=5e-3)
    lag = (motion.q_cmd - motion.q_r)[:, -40:, 0].mean(axis=1)  # (3,)
    assert lag[1] - lag[0] > 1e-3
    assert lag[2] - lag[1] == pytest.approx(lag[1] - lag[0], rel=0.02)


def test_a_heavier_object_is_moved_less_far_and_one_too_heavy_stays():
    motion = sweep([0.3, 1.0, 10.0], x=0.9, speed=1.0, steps=8)
    far = (motion.pose[:, -1] - motion.pose[:, 0])[:, 1]
    assert (np.diff(far) < -1e-3).all() and far[2] < 1e-3 < 0.02 < far[1]


def test_rows_without_mass_and_delay_are_nominal():
    q = np.zeros((1, 4))
    commands = Commands(FREE)
    plain = MujocoDynamics().rollout(
        q, q, AWAY, commands, Plant("planar_arm", ["circle"], np.array([0.5]))
    )
    named = MujocoDynamics().rollout(q, q, AWAY, commands, plant_of())
    np.testing.assert_array_equal(plain.memory[0], named.memory[0])


@pytest.mark.parametrize("late", [0, 1, 7, 49, 50])
def test_a_delay_holds_the_command_before(late):
    """The engine, given by hand in each of its steps what the drives should get."""
    q = np.zeros((1, 4))
    motion = MujocoDynamics().rollout(q, q, AWAY, Commands(FREE), plant_of(delay=[0.002 * late]))
    model = mujoco_model("planar_arm", "circle", 0.5)
    data = mujoco.MjData(model)
    data.qpos[4:] = motion.memory[0][5:12]
    # each before its step, from the first on
    commands = np.repeat(motion.q_cmd[0], ENGINE_STEPS, axis=0)
    for t in range(FREE.shape[1]):
        for m in range(ENGINE_STEPS):
            data.ctrl[:] = commands[ENGINE_STEPS * (t + 1) + m - late]
            mujoco.mj_step(model, data)
        np.testing.assert_allclose(data.qpos[:4], motion.q_r[0, t + 1], atol=1e-9)


def test_a_delay_of_a_step_shifts_the_motion_by_a_step():
    q = np.zeros((3, 4))
    motion = MujocoDynamics().rollout(
        q,
        q,
        np.repeat(AWAY, 3, axis=0),
        Commands(np.repeat(FREE, 3, axis=0)),
        plant_of(delay=[0.0, 0.1, 0.0301]),
    )
    np.testing.assert_array_equal(motion.q_cmd, motion.q_cmd[[0, 0, 0]])
    np.testing.assert_allclose(motion.q_r[1, 1:], motion.q_r[0, :-1], atol=1e-9)
    assert np.abs(motion.q_r[0] - motion.q_r[1]).max() > 1e-3
    rounded = MujocoDynamics().rollout(q[:1], q[:1], AWAY, Commands(FREE), plant_of(delay=[0.03]))
    np.testing.assert_array_equal(motion.q_r[2], rounded.q_r[0])  # to 2 ms


def test_rows_keep_their_mass_and_delay_beside_other_dynamics():
    mass = np.array([1.0, 3.0, 3.0])
    delay = np.array([0.0, 0.1, 0.0])
    names = ["quasi_dynamic", "mujoco", "mujoco"]
    q = np.zeros((3, 4))
    pose = np.tile([0.5, 0.126, 0.0], (3, 1))
    commands = Commands(np.repeat(FREE, 3, axis=0))
    mixed = DynamicsByRow().rollout(
        q,
        q,
        pose,
        commands,
        Plant("planar_arm", ["circle"] * 3, np.full(3, 0.5), names, mass, delay),
    )
    alone = MujocoDynamics().rollout(
        q[1:],
        q[1:],
        pose[1:],
        Commands(commands.values[1:]),
        plant_of(mass=[3.0] * 2, delay=[0.1, 0.0]),
    )
    np.testing.assert_array_equal(mixed.q_r[1:], alone.q_r)
    np.testing.assert_array_equal(mixed.pose[1:], alone.pose)
    light = MujocoDynamics().rollout(q[:1], q[:1], pose[:1], Commands(FREE), plant_of())
    assert np.abs(mixed.pose[2] - light.pose[0]).max() > 1e-5


def test_the_quasi_dynamic_model_knows_no_mass_and_refuses_a_delay():
    q = np.zeros((2, 4))
    pose = np.tile([0.6, 0.2, 0.0], (2, 1))
    commands = Commands(np.repeat(FREE, 2, axis=0))
    motion = QuasiDynamics().rollout(q, q, pose, commands, plant_of(mass=[1.0, 3.0]))
    np.testing.assert_array_equal(motion.pose[0], motion.pose[1])
    for plant, message in (
        (plant_of(delay=[0.0, 0.02]), "delay must be 0 .*mujoco"),
        (plant_of("a4_box_roll_1", mass=[1.0, 1.0]), "loose bodies.*mujoco"),
    ):
        with pytest.raises(InvalidParameterError, match=message):
            QuasiDynamics().rollout(q, q, pose, commands, plant)


@pytest.mark.parametrize("name", ["mass", "delay"])
def test_arrays_of_another_length_are_refused(name):
    q = np.zeros((1, 4))
    plant = dataclasses.replace(plant_of(), **{name: np.ones(2)})
    with pytest.raises(InvalidStateError, match=name):
        MujocoDynamics().rollout(q, q, AWAY, Commands(FREE), plant)

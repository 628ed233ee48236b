"""Copies: of environments, fields, planners and policies, pickled for another process or copied in
this one.
"""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.dynamics.by_row import DYNAMICS, DynamicsOptions
from piec_envs.env.registry import ENVS, MOTIONS
from piec_envs.escape import FIELDS, ObstacleField, SpeedModel, make_field
from piec_envs.escape.table import TableField, can_tabulate
from piec_envs.escape.weights import has_weights
from piec_envs.kernels import batch_kernel
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot
from planners import (
    CmaEsConfiguration,
    CmaEsPlanner,
    ExhaustiveConfiguration,
    OpenLoopPolicy,
    Plan,
    RigidCarry,
    SqpConfiguration,
)

ROOT = Path(__file__).resolve().parents[2]
LARGEST = 150_000  # bytes; a table of the Franka has 100 MB
PUSH = "piec_envs/PlanarArmPush-v0"
MAKERS = {
    "single": gym.make,
    "native": lambda *args, **kwargs: gym.make_vec(*args, num_envs=2, **kwargs),
}
CHOICES = [(env_id, {}) for env_id in ENVS] + [
    (env_id, choice)
    for env_id in MOTIONS
    for choice in (
        {"solver": "osqp", "escape_field": None},
        {"dynamics": "mujoco", "object": "a4_box_roll_1", "escape_field": None},
        {"adversary": 0.5, "escape_field": {"name": "grid", "resolution": 48}},
        {"goal_conditioned": True, "escape_field": "network" if env_id == PUSH else None},
    )
]


def assert_same(a, b):
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for name in a:
            assert_same(a[name], b[name])
    else:
        np.testing.assert_array_equal(a, b)


def through_pickle(item):
    return pickle.loads(pickle.dumps(item))


def begun(maker, env_id, choice):
    env = MAKERS[maker](env_id, **choice)
    env.action_space.seed(0)
    env.reset(seed=0)
    if env_id in MOTIONS:
        env.step(env.action_space.sample())
    return env


@pytest.mark.parametrize("maker", MAKERS)
@pytest.mark.parametrize(("env_id", "choice"), CHOICES, ids=str)
def test_a_copy_of_an_env_is_small_and_goes_on_as_the_env_does(env_id, choice, maker, carried):
    env = begun(maker, env_id, choice)
    compiled, size = carried(env)
    assert not compiled and size < LARGEST
    copies = through_pickle(env), copy.deepcopy(env)
    action = env.action_space.sample()
    taken = env.step(action)
    for copied in copies:
        for a, b in zip(taken, copied.step(action), strict=True):
            assert_same(a, b)
        copied.close()
    env.close()


FIELD_CHOICES = [
    {"name": name, "robot_name": robot, **options}
    for robot in ("planar_arm", "franka_capsules", "mobile_franka_capsules", "franka")
    for name, options in (
        ("grid", {"resolution": 24, "threads": 1, "speed": SpeedModel(leak=0.1)}),
        ("network", {}),
        ("pinn", {}),
        ("table", {"resolution": 16, "spacing": 0.5, "speed": SpeedModel(leak=0.125, u_bar=0.1)}),
    )
    if (
        name in ("grid",)
        or (name == "table" and can_tabulate(get_robot(robot)))
        or has_weights(robot, name)
    )
]


@pytest.mark.parametrize("options", FIELD_CHOICES, ids=str)
def test_a_field_is_made_again_from_its_spec(options, carried):
    field = make_field(**options)
    compiled, size = carried(field)
    assert not compiled and size < 2_000
    rng = np.random.default_rng(0)
    q = rng.uniform(-0.5, 0.5, (3, get_robot(field.robot_name).dof))
    points = rng.uniform(-0.5, 0.5, (3, 4, 2))
    made = through_pickle(field)
    assert made is not field and made.spec() == field.spec() and made.threads == field.threads
    assert copy.deepcopy(field) is field and copy.copy(field) is field
    for a, b in zip(field.gradients(points, q), made.gradients(points, q), strict=True):
        assert (a == b).all()


def test_every_kind_of_field_is_among_them():
    assert {options["name"] for options in FIELD_CHOICES} == set(FIELDS)


def test_a_field_of_weights_that_are_elsewhere_takes_them_along(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    weights = make_field("network").weights
    weights.save("mine.npz")
    from_file = make_field("network", weights="mine.npz")
    given = make_field("network", weights=weights)
    kept = [pickle.dumps(field) for field in (from_file, given)]
    for file in tmp_path.iterdir():
        file.unlink()
    points = np.full((1, 1, 2), 0.3)
    q = np.zeros((1, 4))
    for field, copied in zip((from_file, given), map(pickle.loads, kept), strict=True):
        assert (copied.query(points, q) == field.query(points, q)).all()
    assert pickle.loads(kept[0]).spec() == from_file.spec()


def test_copies_of_a_table_share_its_memory():
    field = TableField("franka_capsules", resolution=16, spacing=0.5)
    assert np.shares_memory(through_pickle(field)._table.excess, field._table.excess)


def _obstacles():
    return ObstacleField(list(get_object("square").shapes), 1.0, resolution=24)


def _planners():
    yield from (CmaEsPlanner(), RigidCarry())
    yield from (CmaEsConfiguration(), ExhaustiveConfiguration(), SqpConfiguration())


@pytest.mark.parametrize("item", [*_planners(), _obstacles()], ids=lambda item: type(item).__name__)
def test_planners_and_what_they_ask_carry_nothing_compiled(item, carried):
    compiled, size = carried(item)
    assert not compiled and size < LARGEST
    assert type(through_pickle(item)) is type(item)


@pytest.mark.parametrize("name", DYNAMICS)
def test_dynamics_carry_nothing_compiled(name, carried):
    for solver in ("fast", "osqp"):
        assert not carried(DYNAMICS[name].made(DynamicsOptions(solver=solver)))[0]


def test_a_policy_carries_nothing_compiled(carried):
    robot = get_robot("planar_arm")
    plan = Plan(
        env_id=PUSH,
        robot=robot.name,
        joints=tuple(joint.name for joint in robot.joints),
        horizon=1000,
        env_kwargs={},
        path=np.zeros((1001, 4)),
        via_points=np.zeros((1, 4)),
        objective="contact",
        preset="default",
        seed=0,
        cost=0.0,
        nominal={},
    )
    assert not carried(OpenLoopPolicy(plan))[0]


@batch_kernel
def _some_kernel(lo, hi):
    return lo + hi


def test_what_looks_finds_a_compiled_function_wherever_it_is(carried):
    assert carried({"somewhere": [(_some_kernel,)]})[0] == ["_some_kernel"]


ELSEWHERE = """
import pickle, sys
env = pickle.load(sys.stdin.buffer)
from numba.core import event
compiled = []
class Listener(event.Listener):
    def on_start(self, event): compiled.append(str(event.data['dispatcher']))
    def on_end(self, event): pass
event.register('numba:compile', Listener())
env.reset(seed=0); print(env.step([0.5, 0.5, 0.5, 0.5])[1], compiled)
"""


def test_in_another_process_a_pickled_env_compiles_nothing():
    env = gym.make(PUSH)
    env.reset(seed=0)
    reward = env.step(np.full(4, 0.5))[1]
    result = subprocess.run(
        [sys.executable, "-c", ELSEWHERE],
        input=pickle.dumps(env),
        capture_output=True,
        check=True,
        cwd=ROOT,
    )
    assert result.stdout.decode().split(maxsplit=1) == [str(reward), "[]\n"]

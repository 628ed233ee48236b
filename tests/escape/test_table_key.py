"""What a kept table is found by: everything that decides its numbers, and nothing else."""

from __future__ import annotations

import ast
import dataclasses
import sys
from pathlib import Path

import numpy as np
import pytest

import piec_envs
from piec_envs.escape import SpeedModel, table, table_key
from piec_envs.escape.table import TableField
from piec_envs.world import packed
from piec_envs.world.robots import ROBOTS, get_robot

TINY = {"robot_name": "franka_capsules", "resolution": 16, "spacing": 0.5}
ROOT = Path(piec_envs.__file__).parent


@pytest.fixture
def keys(monkeypatch):
    """The keys that fields ask for; nothing is solved."""
    asked: list[str] = []

    def note(name, key, shape, make):
        asked.append(key)
        return np.zeros(shape, dtype=np.float32)

    monkeypatch.setattr(table, "kept_table", note)
    return asked


def shifted_joint(robot):
    joint = dataclasses.replace(robot.joints[1], origin=(*robot.joints[1].origin[:2], 1e-6))
    return dataclasses.replace(robot, joints=(robot.joints[0], joint, *robot.joints[2:]))


def thicker_link(robot):
    link = robot.links[-1]
    shapes = tuple(dataclasses.replace(shape, radius=shape.radius + 1e-6) for shape in link.shapes)
    return dataclasses.replace(robot, links=(*robot.links[:-1], dataclasses.replace(link, shapes=shapes)))


def narrower_limit(robot):
    joint = dataclasses.replace(robot.joints[2], upper=robot.joints[2].upper - 1e-6)
    return dataclasses.replace(robot, joints=(*robot.joints[:2], joint))


def larger_workspace(robot):
    return dataclasses.replace(robot, workspace_radius=robot.workspace_radius + 1e-6)


@pytest.mark.parametrize("change", [shifted_joint, thicker_link, narrower_limit, larger_workspace])
def test_another_world_has_another_key(keys, monkeypatch, change):
    TableField(**TINY)
    changed = dataclasses.replace(change(get_robot(TINY["robot_name"])), name="changed")
    monkeypatch.setitem(ROBOTS, "changed", lambda: changed)
    TableField(**{**TINY, "robot_name": "changed"})
    assert len(set(keys)) == 2


@pytest.mark.parametrize("number", [field.name for field in dataclasses.fields(SpeedModel)])
def test_every_number_of_the_speed_counts(keys, number):
    value = getattr(SpeedModel(), number)
    for changed in (value, value * (1 + 1e-12)):
        TableField(**TINY, speed=SpeedModel(**{number: changed}))
    assert len(set(keys)) == 2


def test_a_change_in_how_robots_are_packed_counts(keys, monkeypatch):
    TableField(**TINY)
    robot = packed.pack_robot(TINY["robot_name"])
    moved = robot._replace(shapes=robot.shapes._replace(centre=robot.shapes.centre + 1e-6))
    monkeypatch.setattr(table, "pack_robot", lambda _: moved)
    TableField(**TINY)
    assert len(set(keys)) == 2


def kernels_reached(function, found):
    """Names of the modules whose compiled functions a compiled function calls, itself included."""
    if function.py_func.__module__ + function.py_func.__name__ not in found:
        found[function.py_func.__module__ + function.py_func.__name__] = function.py_func.__module__
        for name in function.py_func.__code__.co_names:
            called = function.py_func.__globals__.get(name)
            if hasattr(called, "py_func"):
                kernels_reached(called, found)
    return set(found.values())


def test_the_code_of_every_kernel_that_makes_a_table_counts(monkeypatch):
    read = []
    parsed = table_key._parsed
    monkeypatch.setattr(table_key, "_parsed", lambda module: read.append(module) or parsed(module))
    table_key.code_digest.__wrapped__()
    needed = kernels_reached(sys.modules["piec_envs.escape.tabulation"]._tabulate, {})
    assert {"piec_envs.geometry.kinematics", "piec_envs.geometry.polygon"} < needed  # the walk finds what is known
    assert needed | {"piec_envs.kernels"} <= set(read)
    assert not {"piec_envs.compilation", "piec_envs.console"} & set(read)  # what is said to users decides no number


@pytest.mark.parametrize("module", ["piec_envs.geometry.polygon", "piec_envs.escape.marching", "piec_envs.kernels"])
def test_a_change_of_code_makes_tables_anew_and_a_comment_does_not(monkeypatch, module):
    before, parsed = table_key.code_digest(), table_key._parsed
    text = ROOT.parent.joinpath(*module.split(".")).with_suffix(".py").read_text()

    def digest_with(changed):
        monkeypatch.setattr(table_key, "_parsed", lambda name: ast.parse(changed) if name == module else parsed(name))
        return table_key.code_digest.__wrapped__()

    assert digest_with(text) == before
    assert digest_with('"""Other words."""\n# a comment\n\n' + text[text.index('"""', 3) + 3 :]) == before
    assert digest_with(text + "\nOTHER = 1\n") != before

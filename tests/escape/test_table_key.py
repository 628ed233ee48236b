"""What a kept table is found by: everything that decides its numbers, and nothing else."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import numpy as np
import pytest

from piec_envs.escape import SpeedModel, table, table_key
from piec_envs.escape.table import TableField
from piec_envs.world import packed
from piec_envs.world.robots import ROBOTS, get_robot

TINY = {"robot_name": "franka_capsules", "resolution": 16, "spacing": 0.5}
KEPT = Path(__file__).with_name("table_version.json")


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
    return dataclasses.replace(
        robot, links=(*robot.links[:-1], dataclasses.replace(link, shapes=shapes))
    )


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


def test_another_version_has_another_key(keys, monkeypatch):
    TableField(**TINY)
    monkeypatch.setattr(table_key, "VERSION", table_key.VERSION + 1)
    TableField(**TINY)
    assert len(set(keys)) == 2


def test_the_version_stands_for_the_numbers(tmp_path, monkeypatch):
    """A change that moves a table's numbers needs another version, or users would go on with the
    ones they keep.
    """
    monkeypatch.setenv("PIEC_CACHE", str(tmp_path))
    excess = TableField(**TINY)._table.excess.astype(float)  # (A, B, N, N)
    means = excess.mean(axis=(2, 3)).ravel()
    kept = json.loads(KEPT.read_text())
    same = len(kept["means"]) == len(means) and np.allclose(means, kept["means"], rtol=1e-6)
    assert (kept["version"], same) == (table_key.VERSION, True), (
        f"tables have other numbers than those of version {kept['version']}: raise VERSION, and "
        f"write it with the "
        f"means {np.round(means, 9).tolist()} into {KEPT.name}"
    )

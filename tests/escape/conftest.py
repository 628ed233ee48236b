"""Learned fields with random weights, and robots whose base slides."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

from piec_envs.escape import SpeedModel
from piec_envs.escape.weights import FieldWeights, input_count
from piec_envs.world.robots import ROBOTS, Joint, get_robot


def random_weights_of(
    inputs="skeleton", width=8, depth=2, robot="planar_arm", seed=0, rise=1.0, **changes
):
    """Weights of a network that nobody trained; T / T_0 varies with `rise`."""
    rng = np.random.default_rng(seed)
    seen = input_count(robot, inputs)
    arrays = {
        "mean": 0.2 * rng.standard_normal(seen),
        "scale": rng.uniform(0.3, 1.0, seen),
        "w_in": rng.standard_normal((width, seen)) / np.sqrt(seen),
        "b_in": 0.3 * rng.standard_normal(width),
        "w": rng.standard_normal((depth - 1, width, width)) / np.sqrt(width),
        "b": 0.3 * rng.standard_normal((depth - 1, width)),
        "w_out": rise * rng.standard_normal(width) / np.sqrt(width),
        "b_out": np.array([2.0]),
    }
    given = {
        "robot": robot,
        "inputs": inputs,
        "arrays": arrays,
        "recipe": {"method": "none"},
        "seed": seed,
    }
    return FieldWeights(**{"speed": SpeedModel(), **given, **changes})


@pytest.fixture(scope="session")
def random_weights():
    """The function `random_weights_of`."""
    return random_weights_of


SLIDING = {
    "sliding_arm": "planar_arm",
    "sliding_capsules": "franka_capsules",
    "turned_capsules": "franka_capsules",
}


def _sliding(name):
    """One of the SLIDING robots: the arm that it names on a base that slides along x and y.

    With "turned" the second slide and the first turning joint stand at an angle, and that joint
    turns clockwise.
    """
    arm = get_robot(SLIDING[name])
    turned = name.startswith("turned")
    base = tuple(
        Joint(
            f"base {name}",
            (0.0, 0.0, 0.3 * turned * axis[1]),
            axis,
            -2.0,
            2.0,
            0.05,
            0.01,
            500.0,
            60.0,
            0.1,
            20.0,
        )
        for name, axis in (("x", (1.0, 0.0, 0.0)), ("y", (0.0, 1.0, 0.0)))
    )
    links = tuple(dataclasses.replace(link, frame=link.frame + 2) for link in arm.links)
    home = np.concatenate([np.zeros(2), arm.home])
    joints = arm.joints
    if turned:
        first = dataclasses.replace(joints[0], origin=(0.0, 0.0, 0.4), axis=(0.0, 0.0, -1.0))
        joints = (first, *joints[1:])
    return dataclasses.replace(arm, name=name, joints=base + joints, links=links, home=home)


@pytest.fixture
def any_robot(request, monkeypatch):
    """The name of a robot: a row of the table, or one of SLIDING, which is added for the test."""
    if request.param not in ROBOTS:
        monkeypatch.setitem(ROBOTS, request.param, lambda: _sliding(request.param))
    return request.param

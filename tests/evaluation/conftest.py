from __future__ import annotations

import numpy as np
import pytest

from piec_envs.world.robots import get_robot
from planners import Plan

PUSH = "piec_envs/PlanarArmPush-v0"


@pytest.fixture
def sweep_plan() -> Plan:
    """A plan that turns the first joint as far as its speed goes, and so pushes the object."""
    robot = get_robot("planar_arm")
    end = np.array([1.5, 0.0, 0.0, 0.0])
    path = np.linspace(np.zeros(4), end, 1001)
    return Plan(
        env_id=PUSH,
        robot=robot.name,
        joints=tuple(joint.name for joint in robot.joints),
        horizon=1000,
        env_kwargs={},
        path=path,
        via_points=path[200::200],
        objective="contact",
        preset="default",
        seed=0,
        cost=0.0,
        nominal={"goal_distance": 0.5, "d2g": 0.45},
    )

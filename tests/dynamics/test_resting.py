"""Objects that nothing touches stay where they are: how they stand on the table under MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from piec_envs.dynamics.free_bodies import SUNK, poses_at_start, rest_state
from piec_envs.dynamics.geoms import RAISED
from piec_envs.dynamics.mjcf import mujoco_model
from piec_envs.dynamics.mujoco_ import MujocoDynamics
from piec_envs.dynamics.protocol import Commands, Plant
from piec_envs.world.objects import OBJECTS, get_object

# what creeps does so evenly
STEPS = 250
EPISODE = 1000
POSE = np.array([-0.5, 0.6, 0.7])


def test_no_object_turns_or_moves_by_itself():
    """At most 0.1 mrad and 10 um in an episode."""
    rows = len(OBJECTS)
    q = np.zeros((rows, 4))
    pose = np.tile(POSE, (rows, 1))
    plant = Plant("planar_arm", list(OBJECTS), np.full(rows, 0.5))
    motion = MujocoDynamics().rollout(q, q, pose, Commands(np.zeros((rows, STEPS, 4))), plant)
    moved = np.abs(motion.pose - POSE).max(axis=1) * EPISODE / STEPS  # (rows, 3)
    assert dict(zip(OBJECTS, moved[:, 2] < 1e-4, strict=True)) == dict.fromkeys(OBJECTS, True)
    assert dict(zip(OBJECTS, moved[:, :2].max(axis=1) < 1e-5, strict=True)) == dict.fromkeys(
        OBJECTS, True
    )


@pytest.mark.parametrize("name", OBJECTS)
def test_an_object_begins_in_contact_with_the_table(name):
    """By as much as it will rest, and on points around its middle, whatever its angle."""
    item = get_object(name)
    model = mujoco_model("planar_arm", name, 0.5)
    for angle in (0.0, 0.7, -2.0):
        data = mujoco.MjData(model)
        state = rest_state(item, np.zeros(4), poses_at_start(item, np.array([*POSE[:2], angle])))
        mujoco.mj_setState(model, data, state, mujoco.mjtState.mjSTATE_FULLPHYSICS)
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(data.contact.dist, -SUNK, atol=1e-8)
        assert RAISED > 3 * SUNK
        below = data.contact.pos[
            (model.geom_bodyid[data.contact.geom] == model.body("object").id).any(axis=1), :2
        ]
        np.testing.assert_allclose(below.mean(axis=0), POSE[:2], atol=5e-3)
        assert len(below) >= 3 and np.linalg.norm(below - POSE[:2], axis=1).min() > 0.02

"""The rows of the table of Pandas: which parts they have, which of them touch, and what the base
carries.
"""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.dynamics.by_row import DYNAMICS
from piec_envs.errors import UnknownNameError
from piec_envs.geometry.body import scene_distances
from piec_envs.geometry.kinematics import link_frames
from piec_envs.world.packed import pack_robot, pack_scene
from piec_envs.world.robots import get_robot
from piec_envs.world.robots.franka import (
    FRANKA_BASES,
    FRANKA_CONTACTS,
    FRANKA_GEOMETRIES,
    FRANKAS,
    LINKS,
    franka_name,
)

PAIRS = [(base, geometry) for base in FRANKA_BASES for geometry in FRANKA_GEOMETRIES]


def parts(robot):
    """Frame and corners of every part of a robot, by name."""
    return {
        link.name: (link.frame, [s.vertices.tolist() for s in link.shapes])
        for link in robot.links + robot.scenery
    }


def distances(robot_name, object_name, q, pose):
    """Distance of each link to the object, m."""
    scene = pack_scene(robot_name, object_name)
    found = np.empty(scene.robot.links)
    scene_distances(scene, np.asarray(q, dtype=float), np.asarray(pose, dtype=float), found)
    return found


def test_there_is_a_row_for_each_combination():
    assert len(FRANKAS) == len(FRANKA_BASES) * len(FRANKA_CONTACTS) * len(FRANKA_GEOMETRIES) == 12
    for word in ("flying", "elbow", "spheres"):
        words = ["fixed", "whole_arm", "meshes"]
        words[("flying", "elbow", "spheres").index(word)] = word
        with pytest.raises(UnknownNameError, match=word):
            franka_name(*words)


@pytest.mark.parametrize(("base", "geometry"), PAIRS)
def test_links_and_scenery_together_are_all_parts(base, geometry):
    whole = get_robot(franka_name(base, "whole_arm", geometry))
    touching = {link.name for link in whole.links}
    assert {link.name for link in whole.scenery} == ({"link 0"} if geometry == "meshes" else set())
    assert touching == (set(LINKS) if geometry == "meshes" else set(LINKS) - {"link 1", "fingers"})
    for contact in ("link", "point"):
        robot = get_robot(franka_name(base, contact, geometry))
        names = [link.name for link in robot.links + robot.scenery]
        assert len(set(names)) == len(names) and robot.whole_name == whole.name
        assert {link.name for link in robot.links} == (
            {"point"} if contact == "point" else {*FRANKA_CONTACTS["link"]} & touching
        )
        assert {name: part for name, part in parts(robot).items() if name != "point"} == parts(
            whole
        )


@pytest.mark.parametrize("name", FRANKAS)
def test_every_part_but_the_foot_turns_and_all_move_with_the_base(name):
    robot = get_robot(name)
    base = robot.base_dof
    assert base == (2 if name.startswith("mobile") else 0) and robot.dof == 3 + base
    fixed = get_robot(name.removeprefix("mobile_"))
    assert parts(robot) == {
        part: (frame + base, corners) for part, (frame, corners) in parts(fixed).items()
    }
    for part, (frame, _) in parts(robot).items():
        assert frame == base if part == "link 0" else frame > base
    if base:
        moved = np.array([0.3, -0.2])
        frames = np.empty((2, robot.dof + 1, 4))
        for k, place in enumerate((np.zeros(2), moved)):
            link_frames(pack_robot(name), np.append(place, [0.4, -1.0, 2.0]), frames[k])
        np.testing.assert_allclose(
            frames[1, 2:, :2] - frames[0, 2:, :2], np.tile(moved, (4, 1)), atol=1e-12
        )
        np.testing.assert_array_equal(frames[1, 2:, 2:], frames[0, 2:, 2:])


@pytest.mark.parametrize("dynamics", DYNAMICS)
@pytest.mark.parametrize(("base", "joint", "steps"), [("fixed", 0, 60), ("mobile", 1, 25)])
def test_parts_that_touch_nothing_pass_through_the_object(base, joint, steps, dynamics):
    """The upper arm sweeps over a circle: with `link` and `point` it goes through, with the whole
    arm it pushes.
    """
    env_id = f"piec_envs/{'Mobile' if base == 'mobile' else ''}FrankaPush-v0"
    whole = get_robot(franka_name(base, "whole_arm", "capsules"))
    beside = next(
        y
        for y in np.arange(0.05, 0.3, 1e-3)
        if distances(whole.name, "circle", whole.home, (0.2, y, 0)).min() > 0
    )
    moved = {}
    for contact in FRANKA_CONTACTS:
        options = {
            "contact": contact,
            "geometry": "capsules",
            "object": "circle",
            "dynamics": dynamics,
        }
        env = gym.make(env_id, escape_field=None, **options).unwrapped
        env.reset(seed=0, options={"state": {"q_r": whole.home, "pose": [0.2, beside, 0.0]}})
        motion = env.rollout(
            env.get_state(), controls=np.tile(np.eye(whole.dof)[joint], (1, steps, 1))
        ).motion
        assert motion.q_r[0, -1, joint] == pytest.approx(0.005 * steps, rel=0.05)
        moved[contact] = np.hypot(*(motion.pose[0, -1, :2] - motion.pose[0, 0, :2]))
        overlap = -distances(whole.name, "circle", motion.q_r[0, -1], motion.pose[0, -1]).min()
        assert overlap < 1e-3 if contact == "whole_arm" else overlap > 0.04
        assert motion.contact.any() == (contact == "whole_arm")
    assert moved["link"] < 1e-9 and moved["point"] < 1e-9 and moved["whole_arm"] > 0.04

"""What is MuJoCo's alone: the model beside our geometry, friction, displacements, overlaps."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from piec_envs.dynamics.mjcf import TABLE_FRICTION, mujoco_model
from piec_envs.dynamics.mujoco_ import ENGINE_STEPS, MujocoDynamics
from piec_envs.dynamics.protocol import Commands, Plant
from piec_envs.geometry.body import scene_distances
from piec_envs.world.objects import OBJECTS, get_object
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import get_robot

PUSH = "piec_envs/PlanarArmPush-v0"
RIGID = [name for name, item in OBJECTS.items() if not item.loose]  # every dynamics moves them
every_object = pytest.mark.parametrize("object_name", RIGID)


def plant_of(object_name, rows=1) -> Plant:
    return Plant("planar_arm", [object_name] * rows, np.full(rows, 0.5))


def placed(model, q, pose, height):
    """MuJoCo's data of one state."""
    data = mujoco.MjData(model)
    data.qpos[: len(q)] = q
    data.qpos[len(q) :] = (*pose[:2], height / 2, np.cos(pose[2] / 2), 0, 0, np.sin(pose[2] / 2))
    mujoco.mj_kinematics(model, data)
    return data


def geoms(model, body) -> list[int]:
    return [g for g in range(model.ngeom) if model.geom(g).name.startswith(body)]


@every_object
def test_distances_and_normals_agree_with_mujoco(object_name):
    """1,000 random states: each link's distance, and the direction of the nearest one's closest
    points.
    """
    rng = np.random.default_rng(0)
    model = mujoco_model("planar_arm", object_name, 0.5)
    scene = pack_scene("planar_arm", object_name)
    height = get_object(object_name).height
    ours = np.empty(4)
    ends = np.empty(6)
    parts = geoms(model, "object")
    checked = 0
    for _ in range(1000):
        q = rng.uniform([-3, -2.5, -2.5, -2.5], [3, 2.5, 2.5, 2.5])
        pose = rng.uniform([-0.9, -0.9, -3], [0.9, 0.9, 3])
        data = placed(model, q, pose, height)
        scene_distances(scene, q, pose, ours)
        for link in np.flatnonzero(ours > 1e-3):
            geom = model.geom(f"link {link + 1} shape 0").id
            theirs = [mujoco.mj_geomDistance(model, data, geom, part, 10.0, None) for part in parts]
            assert abs(min(theirs) - ours[link]) < 1e-4
            if link == ours.argmin():
                mujoco.mj_geomDistance(model, data, geom, parts[int(np.argmin(theirs))], 10.0, ends)
                away = (ends[3:5] - ends[:2]) / np.linalg.norm(ends[3:] - ends[:3])
                assert angle_between(away, outward(scene, q, pose, link)) < 0.5
                checked += 1
    assert checked > 300


@pytest.mark.parametrize("object_name", ["water_jug", "box"])
def test_the_panda_is_its_meshes(object_name):
    """1,000 random states of the Panda beside an object, where the closest points are level with
    it.
    """
    model = mujoco_model("franka", object_name, 0.5)
    robot = get_robot("franka")
    item = get_object(object_name)
    rng = np.random.default_rng(0)
    scene = pack_scene("franka", object_name)
    ours = np.empty(9)
    ends = np.empty(6)
    (part,) = geoms(model, "object")
    checked = 0
    worst = 0.0
    while checked < 1000:
        q = rng.uniform(robot.joint_array("lower"), robot.joint_array("upper"))
        pose = rng.uniform([-0.9, -0.9, -3], [0.9, 0.9, 3])
        data = placed(model, q, pose, item.height)
        scene_distances(scene, q, pose, ours)
        nearest = int(ours.argmin())
        if ours[nearest] < 1e-3:
            continue
        theirs = []
        for geom in geoms(model, f"{robot.links[nearest].name} solid"):
            theirs.append((mujoco.mj_geomDistance(model, data, geom, part, 10.0, ends), *ends))
        distance, *ends[:] = min(theirs)
        if 1e-3 < ends[2] < item.height - 1e-3:
            worst = max(worst, abs(distance - ours[nearest]))
            checked = checked + 1
    assert worst < 2e-3


def outward(scene, q, pose, link) -> np.ndarray:
    """Our unit normal from a link to the object: the slope of its distance as the object moves."""
    step = 1e-6
    slope = []
    for axis in np.eye(3)[:2]:
        values = []
        for sign in (1, -1):
            distances = np.empty(4)
            scene_distances(scene, q, pose + sign * step * axis, distances)
            values.append(distances[link])
        slope.append((values[0] - values[1]) / (2 * step))
    return np.array(slope)


def angle_between(a, b) -> float:
    """Degrees."""
    return float(
        np.degrees(np.arccos(np.clip(a @ b / np.linalg.norm(a) / np.linalg.norm(b), -1, 1)))
    )


@every_object
def test_contacts_have_our_depth_normal_and_the_scenes_friction(object_name):
    """Objects that overlap a link by half a millimetre, turned by every angle.

    Where a link lies within six degrees along a mesh's face, MuJoCo makes two contacts with that
    face's normal.
    """
    model = mujoco_model("planar_arm", object_name, 0.35)
    scene = pack_scene("planar_arm", object_name)
    height = get_object(object_name).height
    distances = np.empty(4)
    seen = 0
    for angle in np.linspace(-np.pi, np.pi, 24):
        q = np.zeros(4)
        pose = np.array([0.6, 0.4, angle])
        scene_distances(scene, q, pose, distances)
        pose[1] -= distances.min() + 5e-4
        scene_distances(scene, q, pose, distances)
        data = placed(model, q, pose, height)
        mujoco.mj_forward(model, data)
        depths = []
        tilts = []
        for contact in data.contact:
            names = [model.geom(g).name for g in contact.geom]
            if "table" in names:
                np.testing.assert_allclose(contact.friction[:2], TABLE_FRICTION)
                continue
            np.testing.assert_allclose(contact.friction[:2], 0.35)
            tilts.append(angle_between(np.abs(contact.frame[:2]), np.array([0.0, 1.0])))
            depths.append(contact.dist)
        assert max(tilts) < (0.5 if len(tilts) == 1 else 6.0)
        assert min(depths) == pytest.approx(distances.min(), abs=1e-4)
        seen += len(depths)
    assert seen >= 24


def test_model_is_the_scene():
    model = mujoco_model("planar_arm", "square", 0.5)
    robot = get_robot("planar_arm")
    item = get_object("square")
    assert [model.joint(j).name for j in range(4)] == [joint.name for joint in robot.joints]
    np.testing.assert_allclose(model.actuator_gainprm[:, 0], robot.joint_array("stiffness"))
    np.testing.assert_allclose(model.actuator_forcerange[:, 1], robot.joint_array("effort"))
    np.testing.assert_allclose(model.body("object").mass, item.mass)
    np.testing.assert_allclose(model.body("object").inertia[2], item.mass * 0.15**2 / 6, rtol=1e-9)
    assert model.opt.timestep * ENGINE_STEPS == pytest.approx(0.1)


@pytest.mark.parametrize(("sigma", "rows"), [(0.0, 24), (0.005, 8)])
def test_random_actions_hold_the_penetration(random_motion, sigma, rows):
    """Random actions held for 50 to 200 steps: 10,000 control steps without displacements, and some
    with them.
    """
    steps = 0
    contact = 0
    depth = 0.0
    for seed, object_name in enumerate(RIGID):
        motion = random_motion(
            object_name, rows=rows, steps=120, seed=seed, sigma=sigma, dynamics=MujocoDynamics()
        )
        assert not motion.diverged.any()
        steps = steps + motion.actions[..., 0].size
        contact = contact + motion.contact[:, 1:].any(axis=2).sum()
        depth = max(depth, float(-motion.link_distance.min()))
    print(
        f"\n{steps} control steps, in contact {contact / steps:.1%}, penetration at most "
        f"{1e3 * depth:.3f} mm"
    )
    assert steps >= 420 * rows and contact / steps >= 0.25 and depth < 3e-3


def test_a_displacement_is_cut_at_the_first_contact():
    rows = 16
    angle = np.linspace(0, 2 * np.pi, rows, endpoint=False)
    w = 0.02 * np.column_stack([np.cos(angle), np.sin(angle)])[:, None]  # (rows, 1, 2)
    q = np.zeros((rows, 4))
    pose = np.tile([0.6, 0.05 + 0.075 + 0.005, 0.0], (rows, 1))
    commands = Commands(np.zeros((rows, 1, 4)), displacement=w)
    motion = MujocoDynamics().rollout(q, q, pose, commands, plant_of("circle", rows))
    moved = motion.pose[:, 1, :2] - pose[:, :2]
    wanted = w[:, 0] * np.minimum(1.0, 0.005 / np.maximum(-w[:, 0, 1], 1e-12))[:, None]
    wanted[w[:, 0, 1] >= 0] = w[w[:, 0, 1] >= 0, 0]
    np.testing.assert_allclose(moved, wanted, atol=2e-4)
    assert motion.link_distance.min() > -1e-6
    touching = np.tile([0.6, 0.05 + 0.075, 0.0], (rows, 1))
    motion = MujocoDynamics().rollout(q, q, touching, commands, plant_of("circle", rows))
    assert motion.link_distance.min() > -1e-4  # never pressed in, free to leave
    np.testing.assert_allclose((motion.pose[:, 1, :2] - touching[:, :2])[1:8], w[1:8, 0], atol=2e-4)


@every_object
def test_an_overlap_is_relaxed_before_the_clock_starts(object_name):
    below = max(
        float((shape.radius - shape.vertices[:, 1]).max())
        for shape in get_object(object_name).shapes
    )
    reach = 0.05 + below - 0.01
    q = np.zeros((2, 4))
    pose = np.array([[0.6, reach, 0.0], [0.6, 0.5, 0.0]])
    plant = plant_of(object_name, 2)
    dynamics = MujocoDynamics()
    settled, memory = dynamics.settle(q, pose, plant)
    assert [len(row) for row in memory] == [0, 0]  # a state of rest says everything
    depth = (
        -dynamics.rollout(q, q, settled, Commands(np.zeros((2, 0, 4))), plant)
        .link_distance[0]
        .min()
    )
    assert depth <= 1e-4 and np.hypot(*(settled - pose)[0, :2]) < 0.03
    np.testing.assert_array_equal(settled[1], pose[1])
    calm = dynamics.rollout(q, q, settled, Commands(np.zeros((2, 20, 4))), plant)
    assert np.abs(calm.pose[:, -1] - settled)[:, :2].max() < 2e-3  # it was not thrown


def test_memory_that_does_not_fit_begins_at_rest():
    """A user may move the object of a saved state; its old velocity would belong elsewhere."""
    dynamics = MujocoDynamics()
    commands = Commands(np.zeros((1, 5, 4)))
    q = np.zeros((1, 4))
    pose = np.array([[0.6, 0.4, 0.2]])
    fresh = dynamics.rollout(q, q, pose, commands, plant_of("circle"))
    for memory in (np.zeros(3), fresh.memory[0] + 0.01):
        again = dynamics.rollout(q, q, pose, commands, plant_of("circle"), [memory])
        np.testing.assert_array_equal(again.pose, fresh.pose)

"""The Panda as a planar robot: kinematics, cross-sections of its meshes, and what happens without
them.
"""

from __future__ import annotations

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from piec_envs.errors import InvalidShapeError, MeshError, UnknownNameError
from piec_envs.geometry.kinematics import link_frames
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot, panda
from piec_envs.world.robots.franka import LINKS, PLANE, POSTURE, REACH_UP, all_joints, planar_frames
from piec_envs.world.sections import TOLERANCE, cross_section

ROBOTS = ("franka", "franka_capsules")
rng = np.random.default_rng(0)


def outside(corners, points):
    """Largest distance of a point beyond an edge of a convex outline, m; negative inside."""
    edges = np.roll(corners, -1, axis=0) - corners
    normals = np.column_stack([edges[:, 1], -edges[:, 0]]) / np.linalg.norm(
        edges, axis=1, keepdims=True
    )
    return ((points[:, None] - corners) * normals).sum(-1).max()


def edge_distance(corners, point):
    """Distance of a point to the boundary of a polygon, m."""
    edges = np.roll(corners, -1, axis=0) - corners
    t = np.clip(((point - corners) * edges).sum(1) / (edges**2).sum(1), 0, 1)
    return np.linalg.norm(point - corners - t[:, None] * edges, axis=1).min()


# --- kinematics --------------------------------------------------------------------------------


def test_known_poses_of_the_maker():
    flange = panda.body_frames(np.zeros(7))[panda.BODIES.index("hand")]
    np.testing.assert_allclose(
        flange[:3, 3], [0.088, 0.0, 0.333 + 0.316 + 0.384 - 0.107], atol=1e-12
    )
    assert flange[2, 2] == pytest.approx(-1.0)  # the hand points down
    ready = panda.body_frames(np.array([0, -np.pi / 4, 0, -3 * np.pi / 4, 0, np.pi / 2, np.pi / 4]))
    np.testing.assert_allclose(
        ready[panda.BODIES.index("hand"), :3, 3], [0.3069, 0.0, 0.5902], atol=1e-3
    )


def test_frames_are_rigid_and_batched():
    q = rng.uniform(panda.LOWER, panda.UPPER, (5, 7))
    frames = panda.body_frames(q)
    turn = frames[..., :3, :3]
    np.testing.assert_allclose(
        turn @ np.swapaxes(turn, -1, -2), np.broadcast_to(np.eye(3), turn.shape), atol=1e-12
    )
    np.testing.assert_array_equal(frames[3], panda.body_frames(q[3]))


@pytest.mark.parametrize("name", ROBOTS)
def test_planar_frames_are_those_in_space(name):
    robot = get_robot(name)
    packed = pack_robot(name)
    for q in rng.uniform(robot.joint_array("lower"), robot.joint_array("upper"), (20, 3)):
        frames = np.empty((4, 4))
        space = panda.body_frames(all_joints(q))
        link_frames(packed, q, frames)
        for frame, body in ((1, 1), (2, 4), (3, 6)):
            np.testing.assert_allclose(frames[frame, :2], space[body, :2, 3], atol=1e-8)
            np.testing.assert_allclose(frames[frame, 2:], space[body, :2, 0], atol=1e-8)
            assert space[body, 2, 3] == pytest.approx(PLANE)


def test_straight_and_curled():
    robot = get_robot("franka_capsules")
    assert robot.curl_sides(0.6) == (-1.0,) and robot.curl_sides(0.1) == (-1.0, 1.0)
    points = [np.zeros(2)]
    frames = np.empty((4, 4))
    link_frames(pack_robot(robot.name), np.r_[0.0, robot.straight[1:]], frames)
    points += [frames[2, :2], frames[3, :2]]
    c, s = frames[3, 2:]
    points.append(frames[3, :2] + np.array([[c, -s], [s, c]]) @ robot.tip)
    angles = np.arctan2(*np.diff(points, axis=0).T[::-1])
    np.testing.assert_allclose(angles, angles[0], atol=1e-9)


# --- cross-sections ----------------------------------------------------------------------------


@pytest.mark.parametrize("link", LINKS)
def test_sections_contain_the_meshes_and_exceed_them_by_a_millimetre(link):
    bodies, frame = LINKS[link]
    found = next(item for item in get_robot("franka").links if item.name == link)
    space = panda.body_frames(POSTURE)
    pose = np.linalg.inv(planar_frames()[frame])
    points = np.concatenate(
        [
            panda.mesh_vertices(body) @ (pose @ space[panda.BODIES.index(body)])[:3, :3].T
            + (pose @ space[panda.BODIES.index(body)])[:3, 3]
            for body in bodies
        ]
    )
    level = points[np.abs(points[:, 2]) <= REACH_UP]
    (shape,) = found.shapes
    assert found.frame == frame and shape.radius == 0
    assert outside(shape.vertices, level[:, :2]) <= 0
    fine = cross_section(points, -REACH_UP, REACH_UP, tolerance=2e-5)  # the hull itself, nearly
    assert max(edge_distance(fine, corner) for corner in shape.vertices) <= TOLERANCE
    # The part in the range, by the corners in it and by points along all lines between two corners.
    t = np.linspace(0, 1, 1001)[:, None, None]
    hull = ConvexHull(points)
    a, b = (
        points[np.concatenate([hull.simplices[:, i] for i in order])]
        for order in ((0, 1, 2), (1, 2, 0))
    )
    dense = (a + t * (b - a)).reshape(-1, 3)
    dense = np.concatenate([dense[np.abs(dense[:, 2]) <= REACH_UP], level])[:, :2]
    assert outside(shape.vertices, dense) <= 0
    near = dense[ConvexHull(dense).vertices]
    assert max(edge_distance(near, corner) for corner in fine) <= 3e-4  # half a step along an edge


@settings(max_examples=60, deadline=None)
@given(
    seed=st.integers(0, 10_000),
    low=st.floats(-0.8, 0.3),
    span=st.floats(0.05, 0.5),
    aspect=st.sampled_from([1, 10, 50]),
)
def test_section_of_any_body(seed, low, span, aspect):
    body = np.random.default_rng(seed).normal(size=(40, 3)) * [0.1, 0.1 / aspect, 0.1] + [
        0,
        0,
        low + span / 2,
    ]
    corners = cross_section(body, low, low + span, tolerance=0.002)
    share = np.random.default_rng(seed + 1).dirichlet(np.full(40, 0.05), 3000) @ body
    level = share[(share[:, 2] >= low) & (share[:, 2] <= low + span)]
    assert outside(corners, level[:, :2]) <= 1e-6
    fine = cross_section(body, low, low + span, tolerance=1e-4)
    assert len(corners) <= len(fine)
    assert all(
        outside(fine, corner[None]) <= 0 or edge_distance(fine, corner) <= 0.002
        for corner in corners
    )


@pytest.mark.parametrize("low", [2.0, np.nan])
@pytest.mark.parametrize("scale", [1.0, [1.0, 1.0, 0.0], np.nan])
def test_a_body_outside_the_range_or_without_volume_is_refused(low, scale):
    with pytest.raises(InvalidShapeError, match="no part"):
        cross_section(scale * np.random.default_rng(0).uniform(size=(20, 3)), low, 3.0)


# --- meshes that are missing or wrong ----------------------------------------------------------


def test_an_unknown_body_is_refused():
    with pytest.raises(UnknownNameError, match="link7"):
        panda.mesh_vertices("link8")


def test_a_mesh_with_a_wrong_hash_is_refused_by_name(tmp_path, monkeypatch):
    monkeypatch.setattr(panda, "mesh_folder", lambda: tmp_path)
    panda.mesh_vertices.cache_clear()
    try:
        with pytest.raises(MeshError, match="'link3' cannot be read"):
            panda.mesh_vertices("link3")
        (tmp_path / "link3.stl").write_bytes(b"another mesh")
        with pytest.raises(MeshError, match=r"'link3'.*SHA-256.*0a8d638b9349c6c0"):
            panda.mesh_vertices("link3")
    finally:
        panda.mesh_vertices.cache_clear()


BARE = """
import sys
sys.modules["gymnasium_robotics"] = None  # as if it were not installed
import gymnasium as gym, piec_envs
from piec_envs.errors import MissingDependencyError
from piec_envs.versions import install_command
for make in (gym.make, gym.make_vec):
    try:
        make("piec_envs/FrankaCage-v0")
    except MissingDependencyError as error:
        assert install_command("franka") in str(error) and "capsules" in str(error), error
    else:
        raise SystemExit("no error")
env = gym.make("piec_envs/FrankaCage-v0", geometry="capsules", escape_field="grid")
env.reset(seed=0)
env.step(env.action_space.sample())
gym.make("piec_envs/PlanarArmPush-v0").reset(seed=0)
from evaluation.cli import main
main(["list"])
"""
MESHES = (
    "import sys, piec_envs.world.robots as r; r.get_robot('franka'); "
    "print('gymnasium_robotics' in sys.modules)"
)


def test_without_the_extra_all_else_works_and_the_error_names_it():
    done = subprocess.run([sys.executable, "-c", BARE], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "FrankaCage" in done.stdout and "needs the extra 'franka'" in done.stdout


def test_the_package_of_the_meshes_is_not_imported():
    get_robot("franka")  # skipped without it
    done = subprocess.run([sys.executable, "-c", MESHES], capture_output=True, text=True)
    assert done.returncode == 0 and done.stdout.strip() == "False", done.stderr

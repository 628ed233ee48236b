"""Kinematics and distances of many states, against those of one and against points on the
surfaces.
"""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs import (
    InvalidStateError,
    UnknownNameError,
    get_object,
    get_robot,
    object_distances,
    robot_frames,
    robot_vertices,
    self_distances,
)
from piec_envs.geometry.body import scene_distances
from piec_envs.world.packed import pack_scene

ROBOT = "planar_arm"
ITEM = "square"


@pytest.fixture(scope="module")
def states():
    robot = get_robot(ROBOT)
    rng = np.random.default_rng(0)
    q = rng.uniform(robot.joint_array("lower"), robot.joint_array("upper"), (6, 5, robot.dof))
    return q, rng.uniform([-0.5, -0.5, -3.0], [0.5, 0.5, 3.0], (6, 5, 3))


def test_every_row_is_that_of_its_state(states):
    q, pose = states
    scene = pack_scene(ROBOT, ITEM)
    alone = self_distances(ROBOT, q)
    around = object_distances(ROBOT, ITEM, q, pose)
    for index in np.ndindex(q.shape[:2]):
        distances = np.empty(scene.robot.links)
        assert alone[index] == scene_distances(scene, q[index], pose[index], distances)
        np.testing.assert_array_equal(around[index], distances)
        assert self_distances(ROBOT, q[index]) == alone[index]
        for function, shape in (
            (robot_frames, (5, 4)),
            (robot_vertices, scene.robot.shapes.vertices.shape),
        ):
            assert function(ROBOT, q[index]).shape == shape
            np.testing.assert_array_equal(function(ROBOT, q)[index], function(ROBOT, q[index]))


@pytest.mark.parametrize("threads", [2, 3])
def test_threads_change_nothing(states, threads):
    q, pose = states
    np.testing.assert_array_equal(self_distances(ROBOT, q, threads), self_distances(ROBOT, q, 1))
    found = object_distances(ROBOT, ITEM, q, pose, threads)
    np.testing.assert_array_equal(found, object_distances(ROBOT, ITEM, q, pose, 1))


def test_frames_are_a_chain_of_the_joints(states):
    robot = get_robot(ROBOT)
    q = states[0][0]
    frames = robot_frames(ROBOT, q)
    assert np.all(frames[:, 0] == [0.0, 0.0, 1.0, 0.0])
    np.testing.assert_allclose(
        np.arctan2(frames[..., -1, 3], frames[..., -1, 2]), np.angle(np.exp(1j * q.sum(axis=1)))
    )
    # between joints, in any posture
    gaps = np.linalg.norm(np.diff(frames[:, 1:, :2], axis=1), axis=-1)
    lengths = [np.hypot(*joint.origin[:2]) for joint in robot.joints[1:]]
    np.testing.assert_allclose(gaps, np.broadcast_to(lengths, gaps.shape))


def test_an_object_far_away_is_as_far_as_it_is(states):
    q = states[0][0]
    away = np.broadcast_to([10.0, 0.0, 0.0], (len(q), 3))
    least = object_distances(ROBOT, ITEM, q, away).min(axis=1)
    reach = get_robot(ROBOT).workspace_radius + get_object(ITEM).bounding_radius
    assert np.all((least > 10.0 - 2 * reach) & (least < 10.0 + reach))


def test_what_does_not_fit_is_refused(states):
    q, pose = states
    for given in (q[..., :-1], 1.0):
        for function in (robot_frames, robot_vertices, self_distances):
            with pytest.raises(InvalidStateError, match=r"q_r must have shape \(\.\.\., 4\)"):
                function(ROBOT, given)
    with pytest.raises(InvalidStateError, match="the same rows"):
        object_distances(ROBOT, ITEM, q, pose[:2])
    with pytest.raises(InvalidStateError, match="pose must have shape"):
        object_distances(ROBOT, ITEM, q, pose[..., :2])
    with pytest.raises(UnknownNameError):
        object_distances(ROBOT, "cirle", q, pose)

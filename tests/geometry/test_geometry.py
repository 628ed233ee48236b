"""Distances and Jacobians against plain geometry and finite differences."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piec_envs.dynamics.contacts import contact_rows, find_contacts, make_contacts
from piec_envs.geometry.body import (
    least_distance,
    make_placed,
    place_scene,
    point_distance,
    scene_distances,
)
from piec_envs.geometry.kinematics import link_frames, place_shapes, point_velocity
from piec_envs.geometry.polygon import core_distance
from piec_envs.world.objects import OBJECTS
from piec_envs.world.packed import pack_robot, pack_scene
from piec_envs.world.shapes import regular_polygon

angles = st.floats(-2.5, 2.5)
configurations = st.tuples(angles, angles, angles, angles).map(np.array)
poses = st.tuples(st.floats(-0.9, 0.9), st.floats(-0.9, 0.9), st.floats(-3, 3)).map(np.array)


def placed(scene, q, pose):
    """The scene at a state."""
    made = make_placed(scene)
    place_scene(scene, q, pose, made, np.empty(scene.robot.links))
    return made


def contacts_within(scene, made, margin):
    """Contacts of a placed scene nearer than a margin."""
    contacts = make_contacts()
    find_contacts(scene, made, margin, contacts)
    return contacts


def link_ends(q):
    """Joint and tip positions of the planar arm by complex numbers, shape (5,)."""
    return np.concatenate(
        [[0], np.cumsum(np.array([0.4, 0.4, 0.4, 0.2]) * np.exp(1j * np.cumsum(q)))]
    )


@given(q=configurations)
def test_frames_equal_the_complex_product(q):
    scene = pack_scene("planar_arm", "circle")
    vertices = placed(scene, q, np.zeros(3)).robot_vertices
    ends = link_ends(q)
    np.testing.assert_allclose(vertices[::2] @ [1, 1j], ends[:-1], atol=1e-14)
    np.testing.assert_allclose(vertices[1::2] @ [1, 1j], ends[1:], atol=1e-14)


@given(q=configurations, x=st.floats(-1.5, 1.5), y=st.floats(-1.5, 1.5))
def test_point_distance_equals_sampled_capsules(q, x, y):
    scene = pack_scene("planar_arm", "circle")
    vertices = placed(scene, q, np.zeros(3)).robot_vertices
    ends = link_ends(q)
    samples = ends[:-1, None] + (ends[1:] - ends[:-1])[:, None] * np.linspace(0, 1, 2001)
    expected = np.abs(samples - (x + 1j * y)).min() - 0.05
    distance, _, c_x, c_y, n_x, n_y = point_distance(scene.robot.shapes, vertices, x, y)
    assert abs(distance - expected) < 2e-4
    np.testing.assert_allclose([c_x + distance * n_x, c_y + distance * n_y], [x, y], atol=1e-8)


@given(
    q=st.tuples(st.floats(-2.8, 2.8), st.floats(-3.0, -0.1), st.floats(0.0, 3.7)),
    x=st.floats(-1, 1),
    y=st.floats(-1, 1),
)
def test_least_distance_is_point_distance(q, x, y):
    robot = pack_robot("franka_capsules")
    shapes = robot.shapes
    frames = np.empty((4, 4))
    vertices = np.empty_like(shapes.vertices)
    centres = np.empty_like(shapes.centre)
    link_frames(robot, np.array(q), frames)
    place_shapes(shapes, frames, vertices, centres)
    assert (
        least_distance(shapes, vertices, centres, x, y) == point_distance(shapes, vertices, x, y)[0]
    )


@given(
    q=configurations,
    pose=poses,
    name=st.sampled_from(list(OBJECTS)),
    step=st.tuples(*[st.floats(-1, 1)] * 3),
)
def test_link_distance_is_lipschitz(q, pose, name, step):
    """Moving the object by at most s changes no distance by more than s."""
    scene = pack_scene("planar_arm", name)
    move = 0.01 * np.array(step) * [1, 1, 0]
    before = np.empty(4)
    after = np.empty(4)
    scene_distances(scene, q, pose, before)
    scene_distances(scene, q, pose + move, after)
    assert (np.abs(after - before) <= np.hypot(move[0], move[1]) + 1e-12).all()


@given(q=configurations, pose=poses, name=st.sampled_from(list(OBJECTS)), turn=st.floats(-3, 3))
def test_distances_turn_with_the_scene(q, pose, name, turn):
    scene = pack_scene("planar_arm", name)
    c = np.cos(turn)
    s = np.sin(turn)
    turned = np.array([c * pose[0] - s * pose[1], s * pose[0] + c * pose[1], pose[2] + turn])
    before = np.empty(4)
    after = np.empty(4)
    scene_distances(scene, q, pose, before)
    scene_distances(scene, q + turn * np.eye(4)[0], turned, after)
    np.testing.assert_allclose(before, after, atol=1e-12)


@given(gap=st.floats(-0.05, 0.2), shift=st.floats(-0.02, 0.02))
def test_core_distance_of_two_squares(gap, shift):
    square = regular_polygon(4, 0.1).vertices
    other = square + np.array([0.2 + gap, shift])
    distance, n_x, n_y = core_distance(square, 0, 4, other, 0, 4)
    assert distance == pytest.approx(gap, abs=1e-12)
    np.testing.assert_allclose([n_x, n_y], [1, 0], atol=1e-6)
    back, b_x, b_y = core_distance(other, 0, 4, square, 0, 4)
    assert back == pytest.approx(distance, abs=1e-12)
    np.testing.assert_allclose([b_x, b_y], [-n_x, -n_y], atol=1e-6)


@given(q=configurations, j=st.integers(0, 3), x=st.floats(-1, 1), y=st.floats(-1, 1))
def test_point_velocity_against_finite_differences(q, j, x, y):
    """A point fixed to the frame after joint j, moved by that joint."""
    scene = pack_scene("planar_arm", "circle")
    frames = placed(scene, q, np.zeros(3)).frames
    local = np.exp(-1j * np.angle(frames[j + 1, 2] + 1j * frames[j + 1, 3])) * (
        x + 1j * y - (frames[j + 1, 0] + 1j * frames[j + 1, 1])
    )
    h = 1e-6
    moved = []
    for sign in (-1, 1):
        turned = q.copy()
        turned[j] += sign * h
        f = placed(scene, turned, np.zeros(3)).frames
        moved.append(f[j + 1, 0] + 1j * f[j + 1, 1] + (f[j + 1, 2] + 1j * f[j + 1, 3]) * local)
    slope = (moved[1] - moved[0]) / (2 * h)
    np.testing.assert_allclose(
        point_velocity(scene.robot, frames, j, x, y), [slope.real, slope.imag], atol=1e-8
    )


@settings(max_examples=60)
@given(q=configurations, pose=poses, name=st.sampled_from(list(OBJECTS)))
def test_contact_rows_are_the_slopes_of_the_gap(q, pose, name):
    """With friction 0 each row is the derivative of the nearest contact's gap."""
    scene = pack_scene("planar_arm", name)
    made = placed(scene, q, pose)
    contacts = contacts_within(scene, made, 0.5)
    distances = np.empty(4)
    scene_distances(scene, q, pose, distances)
    number = contacts.number[0]
    if number == 0 or distances.min() < 1e-3:
        return
    gaps = contacts.gap[:number]
    assert gaps.min() == pytest.approx(distances.min(), abs=1e-12)
    order = np.argsort(gaps)
    if number > 1 and gaps[order[1]] - gaps[order[0]] < 1e-4:
        return  # two contacts equally near: the least distance has a kink
    rows = np.empty((64, 7))
    contact_rows(scene, made.frames, pose, contacts, 0.0, rows)
    slope = np.empty(7)
    h = 1e-6
    for j in range(7):
        values = []
        for sign in (-1, 1):
            moved = np.concatenate([q, pose])
            moved[j] += sign * h
            scene_distances(scene, moved[:4], moved[4:], distances)
            values.append(distances.min())
        slope[j] = (values[1] - values[0]) / (2 * h)
    np.testing.assert_allclose(rows[2 * order[0]], slope, atol=1e-5)


def test_face_on_face_gives_two_contacts():
    scene = pack_scene("planar_arm", "square")
    made = placed(scene, np.zeros(4), np.array([0.6, 0.126, 0.0]))
    contacts = contacts_within(scene, made, 0.01)
    near = contacts.gap[: contacts.number[0]]
    assert contacts.number[0] == 2
    np.testing.assert_allclose(near, 0.001, atol=1e-12)

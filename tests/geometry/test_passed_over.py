"""Object shapes that the link distances pass over change neither a distance nor a contact."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piec_envs.dynamics.contacts import find_contacts, make_contacts
from piec_envs.geometry.body import link_distances, make_placed, measure_pair, place_scene
from piec_envs.geometry.polygon import core_distance
from piec_envs.world.packed import Scene, pack_robot, pack_scene, pack_shapes
from piec_envs.world.shapes import RoundedPolygon, capsule, disc, regular_polygon


def _pieces():
    """An object of unlike shapes, some of which overlap."""
    square = regular_polygon(4, 0.05).vertices
    rounded = RoundedPolygon(square + np.array([0.1, 0.02]), 0.03)
    hexagon = RoundedPolygon(regular_polygon(6, 0.04).vertices - np.array([0.08, 0.05]))
    parts = [disc(0.05), hexagon, rounded, capsule((0.0, 0.05), (0.0, 0.2), 0.01)]
    return pack_scene("planar_arm", "circle").object._replace(
        shapes=pack_shapes([(s, 0, 0) for s in parts])
    )


SCENES = {
    "planar arm, three discs": pack_scene("planar_arm", "three_discs"),
    "planar arm, pieces": Scene(pack_robot("planar_arm"), _pieces()),
    "capsules, paper pack": pack_scene("franka_capsules", "paper_pack"),
    "meshes, paper pack": pack_scene("mobile_franka", "paper_pack"),
    "meshes, pieces": Scene(pack_robot("mobile_franka"), _pieces()),
}


def near_the_robot(scene, data):
    """Joints, and a pose of the object near one of the robot's corners."""
    robot = scene.robot
    shares = data.draw(st.tuples(*[st.floats(0, 1)] * len(robot.lower)))
    low = np.maximum(robot.lower, -3.0)
    high = np.minimum(robot.upper, 3.0)
    q = low + np.array(shares) * (high - low)
    placed = make_placed(scene)
    place_scene(scene, q, np.zeros(3), placed, np.empty(robot.links))
    corner = placed.robot_vertices[data.draw(st.integers(0, len(placed.robot_vertices) - 1))]
    shift = data.draw(st.tuples(*[st.floats(-0.25, 0.25)] * 2))
    return q, np.array([*(corner + shift), data.draw(st.floats(-3, 3))])


def exact_pairs(scene, placed):
    """`core_distance` of each robot shape and object shape, shape (S, K, 3)."""
    arm = scene.robot.shapes
    item = scene.object.shapes
    return np.array(
        [
            [
                core_distance(
                    placed.robot_vertices,
                    arm.first[i],
                    arm.first[i + 1],
                    placed.object_vertices,
                    item.first[k],
                    item.first[k + 1],
                )
                for k in range(len(item.radius))
            ]
            for i in range(len(arm.radius))
        ]
    )


def found(scene, placed, margin):
    """Contacts within a margin, as arrays."""
    contacts = make_contacts()
    find_contacts(scene, placed, margin, contacts)
    return [array[: contacts.number[0]].tolist() for array in contacts[1:]]


@pytest.mark.parametrize("name", SCENES)
@given(data=st.data())
def test_distances_and_contacts_are_those_of_all_pairs(name, data):
    scene = SCENES[name]
    arm = scene.robot.shapes
    item = scene.object.shapes
    q, pose = near_the_robot(scene, data)
    placed = make_placed(scene)
    distances = np.empty(scene.robot.links)
    first = st.integers(0, len(item.radius) - 1)
    placed.nearest[:] = data.draw(
        st.lists(first, min_size=len(arm.radius), max_size=len(arm.radius))
    )
    place_scene(scene, q, pose, placed, distances)
    pairs = exact_pairs(scene, placed)
    gaps = pairs[:, :, 0] - arm.radius[:, None] - item.radius
    least = np.full(scene.robot.links, np.inf)
    np.minimum.at(least, arm.link, gaps.min(axis=1))
    assert distances.tolist() == least.tolist()
    passed_over = ~placed.pairs[:, :, 1:].any(axis=2)
    assert (placed.pairs[~passed_over] == pairs[~passed_over]).all()
    assert (placed.pairs[passed_over, 0] <= pairs[passed_over, 0]).all()
    margin = data.draw(st.floats(0.0, 0.2))
    quick = found(scene, placed, margin)
    placed.pairs[:] = pairs
    assert quick == found(scene, placed, margin)


def test_most_pairs_of_an_arm_and_many_discs_are_passed_over():
    scene = SCENES["meshes, paper pack"]
    placed = make_placed(scene)
    distances = np.empty(scene.robot.links)
    place_scene(scene, np.zeros(5), np.array([0.6, 0.3, 0.0]), placed, distances)
    link_distances(scene, placed, distances)  # from the nearest
    passed_over = ~placed.pairs[:, :, 1:].any(axis=2)
    assert passed_over.mean() > 0.5
    i, k = np.argwhere(passed_over)[0]
    measure_pair(scene, i, k, placed)
    assert placed.pairs[i, k, 1:].any()

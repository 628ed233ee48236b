"""Shapes, objects and robots: what the tables accept and refuse."""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.errors import InvalidShapeError, UnknownNameError
from piec_envs.world.objects import OBJECTS, Object, get_object
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import ROBOTS, get_robot
from piec_envs.world.shapes import RoundedPolygon, box, capsule, disc, regular_polygon


@pytest.mark.parametrize(
    ("vertices", "radius"),
    [
        ([], 0.1),
        ([(0, 0)], 0.0),
        ([(0, 0), (1, 0)], 0.0),
        ([(0, 0), (0, 1), (1, 0)], 0.0),  # clockwise
        ([(0, 0), (1, 0), (2, 0), (1, 1)], 0.0),  # collinear corner
        ([(0, 0), (2, 0), (0.5, 0.5), (0, 2)], 0.0),  # not convex
        ([(0, np.nan)], 0.1),
        ([(0, 0)], -0.1),
        ([(0, 0)], np.inf),
    ],
)
def test_bad_shapes_are_refused(vertices, radius):
    with pytest.raises(InvalidShapeError):
        RoundedPolygon(np.array(vertices, dtype=float), radius)


@pytest.mark.parametrize(
    "shape", [disc(0.1), capsule((0, 0), (0.3, 0), 0.05), box(0.3, 0.2), regular_polygon(6, 0.1)]
)
def test_outline_lies_at_the_radius_and_turns_counter_clockwise(shape):
    outline = shape.outline()
    gaps = [
        np.abs(np.linalg.norm(outline - v, axis=1) - shape.radius).min() for v in shape.vertices
    ]
    assert max(gaps) < 1e-12
    x, y = outline.T
    assert np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) > 0
    centre, bound = shape.bounding_circle
    assert (np.linalg.norm(outline - centre, axis=1) <= bound + 1e-12).all()


def test_polygons_contain_the_circle_by_the_stated_excess():
    for name, excess in (("octagon", 6.2), ("hexagon", 11.6), ("square", 31.1)):
        assert 1e3 * (get_object(name).bounding_radius - 0.075) == pytest.approx(excess, abs=0.05)


def test_gyration_is_that_of_even_solids():
    box_gyration = np.hypot(0.3, 0.2) / np.sqrt(12)
    disc_gyration = 0.119 / np.sqrt(2)
    assert get_object("box").gyration == pytest.approx(box_gyration, rel=1e-9)
    assert get_object("circle_119").gyration == pytest.approx(disc_gyration, rel=1e-4)
    # discs of radius 0.05
    rolls = np.array([shape.vertices[0] for shape in get_object("paper_pack").shapes])
    assert get_object("paper_pack").gyration == pytest.approx(
        np.sqrt(0.05**2 / 2 + (rolls**2).sum(axis=1).mean()), rel=1e-4
    )


def test_shallow_key_points_are_refused():
    with pytest.raises(InvalidShapeError, match="key point"):
        Object("thin", (box(0.3, 0.06),), key_points=np.zeros((1, 2)))


PACKS = ("paper_pack", "paper_pack_wrapped", "a4_box", *(f"a4_box_roll_{k}" for k in range(1, 5)))


@pytest.mark.parametrize("name", PACKS)
def test_packs_have_the_same_key_points_and_height(name):
    planned = get_object("paper_pack")
    item = get_object(name)
    np.testing.assert_array_equal(item.key_points, planned.key_points)
    np.testing.assert_array_equal(item.key_points, [shape.vertices[0] for shape in planned.shapes])
    assert item.height == planned.height and item.mass == (0.5 if name.startswith("paper") else 0.6)


def test_a_wrapped_pack_is_the_outline_of_the_rolls_and_the_box_contains_it():
    (wrapped,) = get_object("paper_pack_wrapped").shapes
    (sharp,) = get_object("a4_box").shapes
    rim = np.concatenate([shape.outline() for shape in get_object("paper_pack").shapes])  # (m, 2)
    inner = np.maximum(np.abs(rim) - (0.1, 0.05), 0.0)  # beyond the rounded rectangle's core
    assert np.linalg.norm(inner, axis=1).max() == pytest.approx(wrapped.radius)
    np.testing.assert_allclose(np.ptp(wrapped.outline(), axis=0), (0.3, 0.2))
    np.testing.assert_allclose(np.ptp(sharp.outline(), axis=0), (0.31, 0.22))


def test_each_loose_roll_stands_a_millimetre_beside_the_box():
    rolls = [get_object(name).loose for name in PACKS[3:]]
    centres = np.array([roll.pose[:2] for (roll,) in rolls])
    gaps = np.linalg.norm(np.maximum(np.abs(centres) - (0.155, 0.11), 0.0), axis=1) - 0.05
    np.testing.assert_allclose(gaps, 1e-3, atol=1e-12)
    assert len({tuple(centre) for centre in centres}) == 4
    assert {(roll.mass, roll.height, roll.shapes[0].radius) for (roll,) in rolls} == {
        (0.1, 0.22, 0.05)
    }
    assert not any(get_object(name).loose for name in PACKS[:3])


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_packs(name):
    scene = pack_scene("planar_arm", name)
    assert scene.object.shapes.first[-1] == len(scene.object.shapes.vertices)
    assert (scene.robot.shapes.first[1:] > scene.robot.shapes.first[:-1]).all()


@pytest.mark.parametrize("name", ROBOTS)
def test_home_is_within_the_limits(name):
    robot = get_robot(name)
    assert (robot.home >= robot.joint_array("lower")).all() and (
        robot.home <= robot.joint_array("upper")
    ).all()
    assert robot.home.shape == robot.speed_limit.shape == (robot.dof,)


def test_unknown_names_list_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"circle, .*hexagon.*Did you mean 'circle'"):
        get_object("circel")
    with pytest.raises(UnknownNameError, match="planar_arm"):
        get_robot("planar")

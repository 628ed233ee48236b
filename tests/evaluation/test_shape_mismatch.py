"""Closed forms of the mismatch between simple shapes."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.shape_mismatch import shape_mismatch
from piec_envs.errors import InvalidShapeError
from piec_envs.geometry.surface import trace_surface
from piec_envs.world.objects import get_object
from piec_envs.world.shapes import RoundedPolygon, box, capsule, disc, regular_polygon

RADIUS = 0.075
CIRCLE = [disc(RADIUS)]
DEGREE = np.pi / 180


def rounded_box(half: float, radius: float) -> RoundedPolygon:
    inner = half - radius
    return RoundedPolygon(box(2 * inner, 2 * inner).vertices, radius)


@pytest.mark.parametrize(
    ("name", "corners", "millimetres", "degrees"),
    [("octagon", 8, 6.2, 22.5), ("hexagon", 6, 11.6, 30.0), ("square", 4, 31.1, 45.0)],
)
def test_polygons_around_the_circle_differ_most_at_their_corners(
    name, corners, millimetres, degrees
):
    mismatch = shape_mismatch(CIRCLE, get_object(name).shapes)
    displacement, where = mismatch.worst_displacement
    assert displacement == pytest.approx(RADIUS * (1 / np.cos(np.pi / corners) - 1), abs=1e-7)
    assert 1e3 * displacement == pytest.approx(millimetres, abs=0.05)
    assert np.unique(np.round(where, 4)) == pytest.approx(
        (2 * np.arange(corners) + 1) * np.pi / corners, abs=1e-4
    )
    error, beside = mismatch.worst_normal_error
    assert error == pytest.approx(degrees * DEGREE, abs=1e-5)
    assert np.unique(np.round(beside, 4)) == pytest.approx(np.unique(np.round(where, 4)), abs=1e-4)


def test_an_object_does_not_differ_from_itself():
    for name in ("circle", "square", "three_discs"):
        mismatch = shape_mismatch(get_object(name).shapes, get_object(name).shapes)
        assert mismatch.worst_displacement[0] == mismatch.worst_normal_error[0] == 0


def test_the_order_does_not_matter():
    there = shape_mismatch(CIRCLE, [regular_polygon(6, RADIUS)])
    back = shape_mismatch([regular_polygon(6, RADIUS)], CIRCLE)
    assert np.array_equal(there.displacement, back.displacement)
    assert np.array_equal(there.normal_error, back.normal_error)


def test_a_shifted_disc():
    shift = 0.02
    mismatch = shape_mismatch(CIRCLE, [disc(RADIUS, (shift, 0.0))])
    assert mismatch.worst_displacement[0] == pytest.approx(shift, abs=1e-7)
    error, where = mismatch.worst_normal_error
    assert error == pytest.approx(np.arcsin(shift / RADIUS), abs=1e-6)
    assert where[0] == pytest.approx(np.pi / 2, abs=0.1 * DEGREE)


def test_rounded_corners_turn_smoothly():
    radius = 0.02
    mismatch = shape_mismatch(CIRCLE, [rounded_box(RADIUS, radius)])
    inner = RADIUS - radius
    assert mismatch.worst_displacement[0] == pytest.approx(
        np.sqrt(2) * inner + radius - RADIUS, abs=1e-7
    )
    assert mismatch.worst_normal_error[0] == pytest.approx(
        np.arctan(inner / RADIUS), abs=0.1 * DEGREE
    )


def test_a_capsule_differs_at_its_ends():
    mismatch = shape_mismatch(CIRCLE, [capsule((-0.05, 0.0), (0.05, 0.0), RADIUS)])
    assert mismatch.worst_displacement[0] == pytest.approx(0.05, abs=1e-6)
    assert np.unique(np.round(mismatch.worst_displacement[1], 3) % 6.283) == pytest.approx(
        [0.0, np.pi], abs=1e-3
    )
    assert mismatch.worst_normal_error[0] == pytest.approx(
        np.arctan(0.05 / RADIUS), abs=0.1 * DEGREE
    )


def test_a_union_is_seen_from_outside_alone():
    """Two halves of a square make the square: the seam between them is no surface."""
    left = RoundedPolygon([(-0.1, -0.1), (0.0, -0.1), (0.0, 0.1), (-0.1, 0.1)])
    right = RoundedPolygon([(0.0, -0.1), (0.1, -0.1), (0.1, 0.1), (0.0, 0.1)])
    directions = np.linspace(0, 2 * np.pi, 77)
    for seen, whole in zip(
        trace_surface([left, right], directions),
        trace_surface([box(0.2, 0.2)], directions),
        strict=True,
    ):
        np.testing.assert_allclose(seen, whole, atol=1e-8)


def test_the_normal_is_that_of_the_trace_surface():
    directions = np.linspace(0.01, 2 * np.pi, 100)
    reach, normal = trace_surface([regular_polygon(5, RADIUS)], directions)
    sides = 2 * np.pi * np.round(directions * 5 / (2 * np.pi)) / 5  # angle of the side that is met
    np.testing.assert_allclose(normal, np.column_stack([np.cos(sides), np.sin(sides)]), atol=1e-8)
    np.testing.assert_allclose(reach * np.cos(directions - sides), RADIUS, atol=1e-7)


def test_a_direction_without_surface_is_left_out():
    beside = [disc(0.02, (0.1, 0.0))]
    reach, normal = trace_surface(beside, np.array([0.0, np.pi]))
    assert reach[0] == pytest.approx(0.12, abs=1e-7) and normal[0] == pytest.approx([1, 0])
    assert np.isnan(reach[1]) and np.isnan(normal[1]).all()
    assert shape_mismatch(CIRCLE, beside).worst_displacement[0] == pytest.approx(0.045, abs=1e-6)
    with pytest.raises(InvalidShapeError, match="direction"):
        shape_mismatch(beside, [disc(0.02, (-0.1, 0.0))])

"""How wrong a simplified object is about contacts: where its surface lies, and which way it faces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs.errors import InvalidShapeError
from piec_envs.geometry.distance import point_distance
from piec_envs.kernels import batch_kernel
from piec_envs.world.scene import pack_shapes
from piec_envs.world.shapes import RoundedPolygon

DIRECTIONS = 3600
BESIDE = 1e-6  # rad; a normal jumps at a corner, so both of its sides are looked at
STAND_OFF = 1e-8  # m; on the surface itself, the distance has no gradient at a corner
CLOSE = 1e-12  # m
MAX_STEPS = 10_000
ALIKE = 1e-8  # m, rad; values that differ by less are equal


@dataclass(frozen=True, eq=False)
class ShapeMismatch:
    """Planned and true surface, seen from the object's origin in M directions.

    Args:
        directions: angles in ascending order, shape (M,), rad.
        displacement: distance between the two surfaces' points in each direction, shape (M,), m;
            NaN where there is none.
        normal_error: angle between their outward normals there, shape (M,), rad; NaN likewise.
    """

    directions: np.ndarray
    displacement: np.ndarray
    normal_error: np.ndarray

    @property
    def worst_displacement(self) -> tuple[float, np.ndarray]:
        """The largest displacement (m), and the directions in which it occurs, shape (k,), rad."""
        return _worst(self.displacement, self.directions)

    @property
    def worst_normal_error(self) -> tuple[float, np.ndarray]:
        """The largest normal error (rad), and the directions in which it occurs, shape (k,), rad."""
        return _worst(self.normal_error, self.directions)


def shape_mismatch(planned: Sequence[RoundedPolygon], true: Sequence[RoundedPolygon]) -> ShapeMismatch:
    """Compare two objects in every direction from their common origin.

    Args:
        planned: shapes of the object that is planned for, a union in its own frame.
        true: shapes of the object that is there, in the same frame.

    Returns:
        The mismatch in evenly spaced directions and on both sides of every corner.

    Raises:
        InvalidShapeError: if there is no direction in which both have a surface.
    """
    directions = _directions([*planned, *true])
    reach, normal = surface(planned, directions)
    true_reach, true_normal = surface(true, directions)
    turn = np.arctan2(
        normal[:, 0] * true_normal[:, 1] - normal[:, 1] * true_normal[:, 0], (normal * true_normal).sum(axis=1)
    )
    mismatch = ShapeMismatch(directions, np.abs(true_reach - reach), np.abs(turn))
    if np.isnan(mismatch.displacement).all():
        raise InvalidShapeError("the two objects have no direction from their origin in which both have a surface")
    return mismatch


def surface(shapes: Sequence[RoundedPolygon], directions: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Outermost points of a union of shapes in directions from the origin, and the normals there.

    Args:
        shapes: the union, in its own frame.
        directions: angles, shape (M,), rad.

    Returns:
        Distances from the origin, shape (M,), m, and outward normals, shape (M, 2); NaN in a
        direction that meets no surface.
    """
    packed = pack_shapes([(shape, 0, 0) for shape in shapes])
    outside = 1.1 * max(float(np.linalg.norm(shape.vertices, axis=1).max()) + shape.radius for shape in shapes)
    reach, normal = np.empty(len(directions)), np.empty((len(directions), 2))
    _trace(packed, outside, directions, reach, normal)
    return reach, normal


@batch_kernel
def _trace(shapes, outside, directions, reach, normal):
    """Walk from outside towards the origin by the distance to the nearest shape: no surface is stepped over.

    Args:
        shapes: a union as `PackedShapes`.
        outside: radius of a circle that contains it, m.
        directions: angles, shape (M,), rad.
        reach: output, distance of the surface from the origin, shape (M,), m.
        normal: output, shape (M, 2).
    """
    for i in range(directions.shape[0]):
        x, y = np.cos(directions[i]), np.sin(directions[i])
        radius = outside
        reach[i], normal[i] = np.nan, np.nan
        for _ in range(MAX_STEPS):
            gap, _, _, _, n_x, n_y = point_distance(shapes, shapes.vertices, radius * x, radius * y)
            gap -= STAND_OFF
            radius -= gap
            if radius <= 0.0:
                break
            if gap < CLOSE:
                reach[i], normal[i, 0], normal[i, 1] = radius, n_x, n_y
                break


def _directions(shapes: Sequence[RoundedPolygon]) -> np.ndarray:
    """Evenly spaced angles, and the corners of all shapes with both of their sides, in [0, 2 pi), rad."""
    even = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    corners = np.concatenate([shape.vertices for shape in shapes])  # (V, 2)
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    beside = np.concatenate([angles - BESIDE, angles, angles + BESIDE])
    return np.unique(np.concatenate([even, beside % (2 * np.pi)]))


def _worst(values: np.ndarray, directions: np.ndarray) -> tuple[float, np.ndarray]:
    """The largest value and all directions that have it."""
    largest = float(np.nanmax(values))
    return largest, directions[np.flatnonzero(values >= largest - ALIKE)]

"""How wrong a simplified object is about contacts: where its surface lies, and which way it
faces.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import InvalidShapeError, RoundedPolygon, trace_surface

DIRECTIONS = 3600
BESIDE = 1e-6  # rad; a normal jumps at a corner, so both of its sides are looked at
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
        """The largest normal error (rad), and the directions in which it occurs, shape
        (k,), rad.
        """
        return _worst(self.normal_error, self.directions)


def shape_mismatch(
    planned: Sequence[RoundedPolygon], true: Sequence[RoundedPolygon]
) -> ShapeMismatch:
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
    reach, normal = trace_surface(planned, directions)
    true_reach, true_normal = trace_surface(true, directions)
    turn = np.arctan2(
        normal[:, 0] * true_normal[:, 1] - normal[:, 1] * true_normal[:, 0],
        (normal * true_normal).sum(axis=1),
    )
    mismatch = ShapeMismatch(directions, np.abs(true_reach - reach), np.abs(turn))
    if np.isnan(mismatch.displacement).all():
        raise InvalidShapeError(
            "the two objects have no direction from their origin in which both have a surface"
        )
    return mismatch


def _directions(shapes: Sequence[RoundedPolygon]) -> np.ndarray:
    """Evenly spaced angles, and the corners of all shapes with both of their sides, in [0, 2 pi),
    rad.
    """
    even = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    corners = np.concatenate([shape.vertices for shape in shapes])  # (V, 2)
    angles = np.arctan2(corners[:, 1], corners[:, 0])
    beside = np.concatenate([angles - BESIDE, angles, angles + BESIDE])
    return np.unique(np.concatenate([even, beside % (2 * np.pi)]))


def _worst(values: np.ndarray, directions: np.ndarray) -> tuple[float, np.ndarray]:
    """The largest value and all directions that have it."""
    largest = float(np.nanmax(values))
    return largest, directions[np.flatnonzero(values >= largest - ALIKE)]

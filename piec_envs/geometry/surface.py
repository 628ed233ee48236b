"""Where the surface of an object lies in each direction from its origin."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piec_envs.geometry.body import point_distance
from piec_envs.kernels import batch_kernel
from piec_envs.world.packed import pack_shapes
from piec_envs.world.shapes import RoundedPolygon

STAND_OFF = 1e-8  # m; on the surface itself, the distance has no gradient at a corner
CLOSE = 1e-12  # m
MAX_STEPS = 10_000


def trace_surface(
    shapes: Sequence[RoundedPolygon], directions: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Outermost points of a union of shapes in directions from the origin, and the normals there.

    Args:
        shapes: the union, in its own frame.
        directions: angles, shape (M,), rad.

    Returns:
        Distances from the origin, shape (M,), m, and outward normals, shape (M, 2); NaN in a
        direction that meets no surface.
    """
    packed = pack_shapes([(shape, 0, 0) for shape in shapes])
    farthest = [np.linalg.norm(shape.vertices, axis=1).max() + shape.radius for shape in shapes]
    outside = 1.1 * float(max(farthest))
    reach = np.empty(len(directions))
    normal = np.empty((len(directions), 2))
    _trace(packed, outside, directions, reach, normal)
    return reach, normal


@batch_kernel
def _trace(shapes, outside, directions, reach, normal):
    """Walk from outside towards the origin by the distance to the nearest shape: no surface is
    stepped over.

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

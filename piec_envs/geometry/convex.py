"""The exact signed distance from points to a convex body given by the corners of its surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from piec_envs.errors import InvalidShapeError
from piec_envs.kernels import batch_kernel, kernel


class Hull(NamedTuple):
    """The surface of a convex body."""

    corners: np.ndarray  # (F, 3, 3) m, corners of the triangles, counter-clockwise from outside
    normals: np.ndarray  # (F, 3) outward unit normals


def convex_hull(vertices: np.ndarray) -> Hull:
    """The convex hull of points.

    Args:
        vertices: shape (V, 3), m.

    Raises:
        InvalidShapeError: if they do not span a volume.
    """
    vertices = np.asarray(vertices, dtype=float)
    try:
        hull = ConvexHull(vertices)
    except (QhullError, ValueError) as error:
        raise InvalidShapeError(f"{vertices.shape} vertices span no volume: {error}") from error
    # (F, 3, 3), (F, 3)
    corners = vertices[hull.simplices]
    normals = hull.equations[:, :3]
    turn = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    clockwise = (turn * normals).sum(axis=1) < 0
    corners[clockwise] = corners[clockwise][:, ::-1]
    return Hull(np.ascontiguousarray(corners), np.ascontiguousarray(normals))


@kernel
def _dot(a, b):
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@kernel
def _minus(a, b):
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


@kernel
def _segment_square(a, b, p):
    """Squared distance from p to the segment from a to b."""
    e, d = _minus(b, a), _minus(p, a)
    length2 = _dot(e, e)
    t = min(max(_dot(d, e) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
    r = d[0] - t * e[0], d[1] - t * e[1], d[2] - t * e[2]
    return _dot(r, r)


@kernel
def _above(a, b, p, n):
    """Whether p lies on the inner side of the edge from a to b of a triangle with normal n."""
    e, d = _minus(b, a), _minus(p, a)
    cross = e[1] * d[2] - e[2] * d[1], e[2] * d[0] - e[0] * d[2], e[0] * d[1] - e[1] * d[0]
    return _dot(cross, n) >= 0.0


@kernel
def hull_distance(hull, p):
    """Signed distance from a point to a convex body, negative inside.

    Args:
        hull: a `Hull`.
        p: three numbers, m.

    Returns:
        The distance in m: outside to the nearest of the triangles that face the point, inside minus
        the depth below the nearest face.
    """
    deepest, best = -np.inf, np.inf
    for i in range(hull.normals.shape[0]):
        a, b, c, n = hull.corners[i, 0], hull.corners[i, 1], hull.corners[i, 2], hull.normals[i]
        height = _dot(_minus(p, a), n)
        deepest = max(deepest, height)
        if height <= 0.0 or height * height >= best:
            continue
        if _above(a, b, p, n) and _above(b, c, p, n) and _above(c, a, p, n):
            best = height * height
        else:
            best = min(
                best, _segment_square(a, b, p), _segment_square(b, c, p), _segment_square(c, a, p)
            )
    return deepest if deepest <= 0.0 else np.sqrt(best)


@batch_kernel
def hull_distances(lo, hi, hull, points, out):
    """Signed distances of rows lo to hi - 1, by `hull_distance`.

    Args:
        lo, hi: row range.
        hull: a `Hull`.
        points: shape (B, 3), m.
        out: output, shape (B,), m.
    """
    for row in range(lo, hi):
        out[row] = hull_distance(hull, points[row])

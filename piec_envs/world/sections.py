"""What a convex body in space is for bodies beside it in the plane: its shadow over a range of
heights.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull, QhullError

from piec_envs.errors import InvalidShapeError

TOLERANCE = 1e-3  # m, by which a simplified outline may exceed the hull
GRAIN = 1e-6  # m, grid of the corners, so that the same bits come out of every version of the hull


def cross_section(
    vertices: np.ndarray, low: float, high: float, tolerance: float = TOLERANCE
) -> np.ndarray:
    """Convex outline of the part of a convex body between two heights, with few corners.

    Args:
        vertices: of the body, shape (V, 3), m.
        low, high: range of z, m.
        tolerance: by which the outline may exceed the hull of the projection, m.

    Returns:
        Corners, counter-clockwise, shape (k, 2), m; they contain the projection, to a micrometre.

    Raises:
        InvalidShapeError: if the vertices span no volume, or no part of it lies in the range.
    """
    try:
        points = _slab(np.asarray(vertices, dtype=float), low, high)  # (P, 2)
        hull = points[ConvexHull(points).vertices]
    except (QhullError, ValueError) as error:
        raise InvalidShapeError(
            f"the body spans no volume, or has no part between z = {low} and {high} m: {error}"
        ) from error
    corners = _simplify(hull, tolerance - 10 * GRAIN)
    centre = corners.mean(axis=0)
    outward = corners - centre
    # room for rounding
    corners = corners + 5 * GRAIN * outward / np.linalg.norm(outward, axis=1, keepdims=True)
    corners = np.round(corners / GRAIN) * GRAIN + 0.0  # no negative zeros
    return np.roll(corners, -int(np.lexsort(corners.T[::-1])[0]), axis=0)


def _slab(vertices: np.ndarray, low: float, high: float) -> np.ndarray:
    """Projected corners of the part of a convex body between two heights, shape (P, 2)."""
    hull = ConvexHull(vertices)
    z = vertices[:, 2]
    points = [vertices[hull.vertices][(z[hull.vertices] >= low) & (z[hull.vertices] <= high), :2]]
    edges = np.unique(
        np.sort(np.concatenate([hull.simplices[:, [i, i - 1]] for i in range(3)]), axis=1), axis=0
    )
    # (E, 3)
    start = vertices[edges[:, 0]]
    end = vertices[edges[:, 1]]
    for height in (low, high):
        cut = (start[:, 2] - height) * (end[:, 2] - height) < 0
        share = (height - start[cut, 2]) / (end[cut, 2] - start[cut, 2])
        points.append((start[cut] + share[:, None] * (end[cut] - start[cut]))[:, :2])
    return np.concatenate(points)


def _simplify(hull: np.ndarray, tolerance: float) -> np.ndarray:
    """Drop edges while their neighbours, made longer, meet within the tolerance of the hull.

    Args:
        hull: convex, counter-clockwise, shape (n, 2), m.
        tolerance: m.
    """
    corners = hull
    while len(corners) > 3:
        meeting = _meetings(corners)  # (k, 2)
        excess = np.array([_distance_to(hull, point) for point in meeting])
        least = int(np.argmin(excess))
        if excess[least] > tolerance:
            break
        corners = np.roll(corners, -least, axis=0)
        corners = np.concatenate([meeting[least][None], corners[2:]])
    return corners


def _meetings(corners: np.ndarray) -> np.ndarray:
    """Where the neighbours of each edge i, i + 1 meet beyond it, shape (k, 2); far away where they
    do not.
    """
    before, a, b, after = (np.roll(corners, shift, axis=0) for shift in (1, 0, -1, -2))
    u = a - before
    v = b - after
    gap = b - a
    turn = u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        s = (gap[:, 0] * v[:, 1] - gap[:, 1] * v[:, 0]) / turn
        t = (gap[:, 0] * u[:, 1] - gap[:, 1] * u[:, 0]) / turn
        meets = (np.abs(turn) > 0) & (s >= 0) & (t >= 0)
        return np.where(meets[:, None], a + s[:, None] * u, 1e6)


def _distance_to(hull: np.ndarray, point: np.ndarray) -> float:
    """Distance of a point outside to a convex outline, m."""
    edges = np.roll(hull, -1, axis=0) - hull
    share = np.clip(((point - hull) * edges).sum(axis=1) / (edges**2).sum(axis=1), 0.0, 1.0)
    return float(np.linalg.norm(point - hull - share[:, None] * edges, axis=1).min())

"""Rounded convex polygons: the one primitive that carries all geometry in the plane."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piec_envs.errors import InvalidShapeError


@dataclass(frozen=True, eq=False)
class RoundedPolygon:
    """All points within `radius` of a convex polygon.

    One vertex is a disc, two are a capsule, more with radius 0 are a sharp polygon.

    Args:
        vertices: corners, counter-clockwise, shape (k, 2), m.
        radius: rounding radius, m.

    Raises:
        InvalidShapeError: if the corners are not finite, convex and counter-clockwise, or the
            shape has no area.
    """

    vertices: np.ndarray
    radius: float = 0.0

    def __post_init__(self):
        vertices = np.array(self.vertices, dtype=float).reshape(-1, 2)  # (k, 2)
        object.__setattr__(self, "vertices", vertices)
        object.__setattr__(self, "radius", float(self.radius))
        if len(vertices) == 0 or not np.isfinite(vertices).all():
            raise InvalidShapeError(
                f"a shape needs at least one finite vertex, got {vertices.tolist()}"
            )
        if not (np.isfinite(self.radius) and self.radius >= 0):
            raise InvalidShapeError(f"radius must be finite and at least 0, got {self.radius}")
        if len(vertices) < 3:
            if self.radius == 0:
                raise InvalidShapeError("a disc or capsule needs a radius above 0")
            return
        edges = np.roll(vertices, -1, axis=0) - vertices  # (k, 2)
        following = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0]  # (k,)
        if not (turns > 0).all():
            raise InvalidShapeError(
                f"vertices must be convex and counter-clockwise, without collinear corners; got "
                f"{vertices.tolist()}"
            )

    @property
    def bounding_circle(self) -> tuple[np.ndarray, float]:
        """Centre (2,) and radius of a circle around the shape, m."""
        centre = self.vertices.mean(axis=0)
        return centre, float(np.linalg.norm(self.vertices - centre, axis=1).max()) + self.radius

    @property
    def area(self) -> float:
        """Area of the shape, m^2."""
        x, y = self.vertices.T
        step_x = np.roll(x, -1) - x
        step_y = np.roll(y, -1) - y
        rim = float(np.hypot(step_x, step_y).sum())  # both sides of a capsule
        return (
            float(0.5 * (x * step_y - y * step_x).sum())
            + self.radius * rim
            + np.pi * self.radius**2
        )

    @property
    def polar_moment(self) -> float:
        """Integral of the squared distance to the origin over the shape, to 1e-4 of it, m^4."""
        p = self.outline(100)  # (m, 2)
        q = np.roll(p, -1, axis=0)
        cross = p[:, 0] * q[:, 1] - p[:, 1] * q[:, 0]  # (m,)
        return float((cross[:, None] * (p * p + p * q + q * q)).sum() / 12)

    @property
    def is_rectangle(self) -> bool:
        """Whether it is a sharp rectangle, at any angle."""
        if len(self.vertices) != 4 or self.radius > 0:
            return False
        edges = np.roll(self.vertices, -1, axis=0) - self.vertices
        corners = np.abs((edges * np.roll(edges, -1, axis=0)).sum(axis=1))
        return bool((corners < 1e-12).all())

    def outline(self, arc_points: int = 12) -> np.ndarray:
        """Closed boundary for drawing.

        Args:
            arc_points: points on each rounded corner.

        Returns:
            Points in counter-clockwise order, shape (m, 2), m.
        """
        k = len(self.vertices)
        if k == 1:
            angles = np.linspace(0, 2 * np.pi, 4 * arc_points, endpoint=False)
            return self.vertices + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])
        edges = np.roll(self.vertices, -1, axis=0) - self.vertices
        outward = np.arctan2(-edges[:, 0], edges[:, 1])  # (k,) angle of each edge's outward normal
        corners = []
        for i in range(k):
            start = outward[i - 1]
            sweep = (outward[i] - start) % (2 * np.pi)
            angles = start + np.linspace(0, sweep, arc_points if self.radius else 1)
            corners.append(
                self.vertices[i] + self.radius * np.column_stack([np.cos(angles), np.sin(angles)])
            )
        return np.concatenate(corners)


def disc(radius: float, centre=(0.0, 0.0)) -> RoundedPolygon:
    """A disc.

    Args:
        radius: above 0, m.
        centre: two numbers, m.

    Returns:
        The shape, of one vertex.

    Raises:
        InvalidShapeError: as `RoundedPolygon` does.
    """
    return RoundedPolygon(np.array([centre]), radius)


def capsule(start, end, radius: float) -> RoundedPolygon:
    """All points within a distance of a segment.

    Args:
        start, end: of the segment, two numbers each, m.
        radius: the distance, above 0, m.

    Returns:
        The shape, of two vertices.

    Raises:
        InvalidShapeError: as `RoundedPolygon` does.
    """
    return RoundedPolygon(np.array([start, end]), radius)


def box(width: float, height: float) -> RoundedPolygon:
    """An axis-aligned rectangle around the origin.

    Args:
        width: along x, m.
        height: along y, m.

    Returns:
        The shape, sharp, of four vertices.

    Raises:
        InvalidShapeError: as `RoundedPolygon` does.
    """
    x = width / 2
    y = height / 2
    return RoundedPolygon(np.array([(-x, -y), (x, -y), (x, y), (-x, y)]))


def regular_polygon(corners: int, apothem: float) -> RoundedPolygon:
    """A regular polygon around the origin, given by its inscribed circle.

    Args:
        corners: how many.
        apothem: radius of the inscribed circle, m.

    Returns:
        The shape, sharp; one edge crosses the positive x axis at a right angle.

    Raises:
        InvalidShapeError: as `RoundedPolygon` does.
    """
    angles = 2 * np.pi * (np.arange(corners) + 0.5) / corners
    circumradius = apothem / np.cos(np.pi / corners)
    return RoundedPolygon(circumradius * np.column_stack([np.cos(angles), np.sin(angles)]))

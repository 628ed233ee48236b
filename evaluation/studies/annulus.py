"""A square annulus in a disc, and the exact escape time around and through it (paper, section 3.4).

Outside, the fastest way is a shortest path around a convex obstacle: straight lines from corner to
corner, the last of them radial. From the cavity it leads through a leaky wall: it is refracted
where it enters and where it leaves the wall (Fermat), and goes on outside as above.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from piec_envs import RoundedPolygon

SHRINK = 1 - 1e-9  # of the square that blocks the view, so that a line along its side does not
PERIMETER = 600  # points on each square where refracted paths are tried
ZOOMS = 12  # each a fifth as wide


@dataclass(frozen=True)
class Annulus:
    """A square ring of wall within a disc around the origin.

    Args:
        centre: of the squares, m.
        angle: of their sides, rad.
        outer: half the outer square's side, m.
        inner: half the cavity's side, m.
        radius: of the disc, m.
    """

    centre: tuple[float, float] = (0.47, 0.21)
    angle: float = 0.3
    outer: float = 0.31
    inner: float = 0.22
    radius: float = 1.0

    @property
    def walls(self) -> tuple[RoundedPolygon, ...]:
        """Four boxes, which overlap at the corners so that no seam is left."""
        a = self.inner
        b = self.outer
        box = np.array([(a, -b), (b, -b), (b, b), (a, b)])
        return tuple(RoundedPolygon(self.to_world(box @ _turn(np.pi / 2 * k).T)) for k in range(4))

    @property
    def cavity_area(self) -> float:
        """Area of the cavity, m^2."""
        return (2 * self.inner) ** 2

    def to_world(self, points: np.ndarray) -> np.ndarray:
        """Points of the annulus' frame in the world, shape (..., 2), m."""
        return points @ _turn(self.angle).T + self.centre

    def depth(self, points: np.ndarray, half: float) -> np.ndarray:
        """How far points lie inside a square around the annulus' centre, with its sides' angle.

        Args:
            points: shape (..., 2), m.
            half: half the square's side, m.

        Returns:
            Shape (...), m; negative outside.
        """
        return half - np.abs((points - self.centre) @ _turn(self.angle)).max(axis=-1)

    def outline(self, half: float, points: int = 4) -> np.ndarray:
        """Evenly spaced points on a square around the annulus' centre, with its sides' angle.

        Args:
            half: half the square's side, m.
            points: how many; a multiple of 4 has the corners among them.

        Returns:
            Shape (points, 2), m.
        """
        return self._on_square(half, np.arange(points) / points)

    def _on_square(self, half: float, share: np.ndarray) -> np.ndarray:
        """Points on a square by their share of its perimeter, shapes (..., 2), (...)."""
        side, along = np.divmod(4 * (np.asarray(share) % 1.0), 1.0)
        angle = np.pi / 2 * side
        x = 2 * along - 1
        y = np.full_like(along, -1.0)
        corner = np.stack(
            [np.cos(angle) * x - np.sin(angle) * y, np.sin(angle) * x + np.cos(angle) * y], -1
        )
        return self.to_world(half * corner)

    def blocks(self, start: np.ndarray, end: np.ndarray) -> np.ndarray:
        """Whether straight lines run through the outer square.

        Args:
            start, end: of the lines, shape (..., 2), m.

        Returns:
            Shape (...), bool.
        """
        frame = _turn(self.angle)
        half = self.outer * SHRINK
        a = (start - self.centre) @ frame
        d = (end - start) @ frame
        with np.errstate(divide="ignore", invalid="ignore"):
            # where the line meets the two sides on each axis
            low = (-half - a) / d
            high = (half - a) / d
        enter = np.minimum(low, high).max(axis=-1)
        leave = np.maximum(low, high).min(axis=-1)
        return np.maximum(enter, 0.0) < np.minimum(leave, 1.0)

    def exit_distance(self, points: np.ndarray) -> np.ndarray:
        """Length of the shortest path from points outside the outer square to the circle.

        Args:
            points: shape (M, 2), m.

        Returns:
            The geodesic distance, shape (M,), m; T at speed 1.
        """
        corners = self.outline(self.outer)  # (4, 2)
        beyond = self._straight(corners)
        for _ in range(2):  # the last corner is at most two sides away
            beyond = np.minimum(
                beyond, 2 * self.outer + np.minimum(np.roll(beyond, 1), np.roll(beyond, -1))
            )
        start = points[:, None]  # (M, 1, 2)
        around = np.linalg.norm(start - corners, axis=-1) + beyond  # (M, 4)
        around[self.blocks(start, np.broadcast_to(corners, (len(points), 4, 2)))] = np.inf
        return np.minimum(self._straight(points), around.min(axis=1))

    def _straight(self, points: np.ndarray) -> np.ndarray:
        """R - |p| where nothing is in the way, else inf, shapes (M,), (M, 2)."""
        r = np.hypot(points[:, 0], points[:, 1])
        end = points * (self.radius / np.maximum(r, 1e-12))[:, None]
        return np.where(self.blocks(points, end), np.inf, np.maximum(self.radius - r, 0.0))

    def leaky_time(self, point: np.ndarray, leak: float) -> float:
        """Escape time of a point in the cavity, at speed 1 but in the wall (paper, section 3.4).

        Args:
            point: shape (2,), m.
            leak: speed in the wall.

        Returns:
            The time, s; inf without a leak.
        """
        if leak == 0:
            return np.inf
        entry = leave = np.arange(PERIMETER) / PERIMETER
        for zoom in range(ZOOMS + 1):
            # (m, 2) each
            a = self._on_square(self.inner, entry)
            b = self._on_square(self.outer, leave)
            free = np.linalg.norm(a - point, axis=-1)[:, None] + self.exit_distance(b)
            total = free + np.linalg.norm(a[:, None] - b, axis=-1) / leak  # (m, m)
            i, j = np.unravel_index(total.argmin(), total.shape)
            near = np.linspace(-2, 2, 41) / PERIMETER / 5**zoom
            entry = entry[i] + near
            leave = leave[j] + near
        return float(total.min())


def _turn(angle: float) -> np.ndarray:
    """Rotation matrix."""
    c = np.cos(angle)
    s = np.sin(angle)
    return np.array([[c, -s], [s, c]])

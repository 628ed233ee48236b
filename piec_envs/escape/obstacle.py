"""The escape time of a point mass among fixed obstacles (paper, section 3.4).

Obstacles are rounded convex polygons, the disc's centre is the origin, and the solver is that of
`GridField`: a robot that never moves.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piec_envs.errors import InvalidParameterError, InvalidStateError, check_name
from piec_envs.escape.base import draw_map, find_path
from piec_envs.escape.between import value
from piec_envs.escape.disc import make_disc, make_scratch
from piec_envs.escape.eikonal import solve_disc
from piec_envs.escape.grid import METHODS
from piec_envs.escape.protocol import FieldMap
from piec_envs.escape.speed import SpeedModel
from piec_envs.kernels import batch_kernel
from piec_envs.world.packed import pack_shapes
from piec_envs.world.shapes import RoundedPolygon


@batch_kernel
def _values(field, points, out):
    """out[k] = T at points[k], shapes (M,), (M, 2)."""
    for k in range(points.shape[0]):
        out[k] = value(field, points[k, 0], points[k, 1])[0]


class ObstacleField:
    """Escape time of a point mass among fixed obstacles, solved once.

    Args:
        shapes: the obstacles; they may overlap.
        radius: of the workspace disc around the origin, m.
        speed: largest speed as a function of the distance to the obstacles; None is speed 1 outside
            them and 0 inside.
        resolution: nodes a side of the square grid over the disc.
        method: "sweeping" (first order) or "marching" (second order).

    Raises:
        UnknownNameError: if the method is not known.
        InvalidParameterError: if there is no obstacle, the radius is not above 0, or the resolution
            is below 16.
    """

    def __init__(
        self,
        shapes: Sequence[RoundedPolygon],
        radius: float,
        speed: SpeedModel | None = None,
        resolution: int = 200,
        method: str = "marching",
    ):
        check_name("method", method, METHODS)
        if not shapes:
            raise InvalidParameterError("at least one obstacle is needed")
        if not (np.isfinite(radius) and radius > 0):
            raise InvalidParameterError(f"radius must be finite and above 0, got {radius}")
        self.speed = speed or even_speed()
        self._disc = make_disc(radius, self.speed.u_bar, resolution)
        packed = pack_shapes([(shape, 0, 0) for shape in shapes])
        scratch = make_scratch(packed, 1, self._disc)
        scratch.vertices[:] = packed.vertices
        self._field = solve_disc(packed, self.speed.packed(), self._disc, METHODS[method], scratch)

    @property
    def h(self) -> float:
        """Cell size of the grid, m."""
        return self._disc.h

    def query(self, points: np.ndarray) -> np.ndarray:
        """Escape time of points.

        Args:
            points: shape (..., 2), m.

        Returns:
            T, shape (...), s; 0 on and outside the disc, inf where nothing leads out.

        Raises:
            InvalidStateError: if the last axis is not (x, y) or a number is not finite.
        """
        points = np.ascontiguousarray(points, dtype=float)
        if points.shape[-1:] != (2,) or not np.isfinite(points).all():
            raise InvalidStateError(f"points must be finite and (..., 2), got shape {points.shape}")
        out = np.empty(points.shape[:-1])
        _values(self._field, points.reshape(-1, 2), out.reshape(-1))
        return out

    def solve(self) -> FieldMap:
        """Escape time and speed over the whole workspace."""
        return draw_map(self._field, self.speed)

    def escape_path(self, point: np.ndarray) -> np.ndarray:
        """Fastest way out for a point, shape (2,), m.

        Returns:
            Points from the given one to the circle, T falling strictly, shape (m, 2), m; the point
            alone where it is outside already or nothing leads out.

        Raises:
            InvalidStateError: if the point is not one or not finite.
        """
        point = np.asarray(point, dtype=float)
        if point.shape != (2,) or not np.isfinite(point).all():
            raise InvalidStateError(f"a point must be finite and (2,), got {point.tolist()}")
        return find_path(self._field, point)


def even_speed(leak: float = 0.0) -> SpeedModel:
    """Speed 1 outside obstacles and `leak` inside, without a band around them (paper,
    section 3.4).
    """
    return SpeedModel(u_bar=1.0, a_min=1.0, d0=0.0, leak=leak)

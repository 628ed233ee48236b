"""The exact escape time, solved on a grid for every configuration asked."""

from __future__ import annotations

import numpy as np

from piec_envs.errors import InvalidParameterError, as_floats, check_name
from piec_envs.escape.base import ALL_GRADIENTS, POINT_GRADIENT, BatchedField
from piec_envs.escape.between import Field, point_gradient, value
from piec_envs.escape.disc import make_disc, make_scratch, place_robot
from piec_envs.escape.eikonal import solve_disc
from piec_envs.escape.paths import configuration_gradient
from piec_envs.escape.spatial import SpatialDisc
from piec_envs.escape.speed import SpeedModel
from piec_envs.geometry.kinematics import base_gradient
from piec_envs.kernels import batch_kernel
from piec_envs.parallel import run_rows
from piec_envs.world.packed import pack_robot
from piec_envs.world.robots import get_robot

METHODS = {"sweeping": False, "marching": True}  # first order, second order
DISTANCES = ("polygons", "rdf")


@batch_kernel
def _answer(lo, hi, robot, speed, disc, plan, q, points, out):
    """Rows lo to hi: one solve each, then every point of the row.

    Args:
        plan: (second_order, base, level of detail).
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        out: T (B, k), dT_dp (B, k, 2) and dT_dq (B, k, n), the latter two as far as the level asks.
    """
    second_order, base, level = plan
    times, slopes_p, slopes_q = out
    if hi <= lo:
        return
    scratch = make_scratch(robot.shapes, q.shape[1] + 1, disc)
    for row in range(lo, hi):
        b_x, b_y = place_robot(robot, base, q[row], scratch)
        field = solve_disc(robot.shapes, speed, disc, second_order, scratch)
        for k in range(points.shape[1]):
            x, y = points[row, k, 0] - b_x, points[row, k, 1] - b_y
            t, e_x, e_y = value(field, x, y)
            times[row, k] = t
            if level >= POINT_GRADIENT:
                slopes_p[row, k] = point_gradient(field, x, y, t, e_x, e_y)
            if level >= ALL_GRADIENTS:
                configuration_gradient(robot, base, scratch.frames, field, (x, y), slopes_q[row, k])
                base_gradient(
                    robot,
                    scratch.frames,
                    base,
                    slopes_p[row, k, 0],
                    slopes_p[row, k, 1],
                    slopes_q[row, k],
                )


class GridField(BatchedField):
    """Escape time from a grid solver, one solve per configuration (paper, section 3.3).

    The workspace disc moves with the robot's base. Rows of a batch do not depend on each other, so
    row i equals the single query bit for bit, with any number of threads.

    Args:
        robot_name: a row of the table of robots.
        resolution: nodes a side of the square grid over the disc.
        method: "sweeping" (first order) or "marching" (second order).
        speed: largest speed as a function of the distance to the robot.
        threads: threads over the rows of a batch; None takes all cores.
        distance: "polygons", to the planar robot; or "rdf", to its bodies in space, in the plane
            (`piec_envs.geometry.rdf`, of the robot "franka" only).
        radius: of the workspace disc, m; None takes the robot's.

    Raises:
        UnknownNameError: if the robot, the method or the distance is not known.
        InvalidParameterError: if the resolution is below 16, the radius is not above 0, or the
            robot has no such distance.
    """

    name = "grid"

    def __init__(
        self,
        robot_name: str = "planar_arm",
        resolution: int = 64,
        method: str = "sweeping",
        speed: SpeedModel | None = None,
        threads: int | None = None,
        distance: str = "polygons",
        radius: float | None = None,
    ):
        check_name("method", method, METHODS)
        check_name("distance", distance, DISTANCES)
        robot = get_robot(robot_name)
        if (
            radius is not None
            and not float(as_floats("radius", radius, (), InvalidParameterError)) > 0
        ):
            raise InvalidParameterError(f"radius must be above 0 m, got {radius!r}")
        super().__init__(robot_name, robot.dof, speed or SpeedModel())
        self.resolution = int(resolution)
        self.method = method
        self.threads = threads
        self.distance = distance
        self._base = robot.base_dof
        self._robot = pack_robot(robot_name)
        self._packed = self.speed.packed()
        self.radius = robot.workspace_radius if radius is None else float(radius)
        self._disc = make_disc(self.radius, self.speed.u_bar, resolution)
        self._spatial = None
        if distance == "rdf":
            self._spatial = SpatialDisc(robot_name, self._packed, self._disc, METHODS[method])

    def spec(self) -> dict:
        """What makes this field again through `make_field(**spec)`, as JSON-able values."""
        return {
            "name": self.name,
            "robot_name": self.robot_name,
            "resolution": self.resolution,
            "method": self.method,
            "distance": self.distance,
            "radius": self.radius,
            "speed": {key: float(number) for key, number in self._packed._asdict().items()},
        }

    def sample(self, q: np.ndarray) -> tuple[Field, np.ndarray]:
        """See `BatchedField`."""
        if self._spatial is not None:
            return self._spatial.sample(q), np.zeros(2)
        scratch = make_scratch(self._robot.shapes, self._dof + 1, self._disc)
        base = place_robot(self._robot, self._base, q, scratch)
        return solve_disc(
            self._robot.shapes, self._packed, self._disc, METHODS[self.method], scratch
        ), np.array(base)

    def _answer_rows(self, level, q, points, out):
        if self._spatial is not None:
            self._spatial.answer_rows(level, self.threads, q, points, out)
            return
        plan = METHODS[self.method], self._base, level
        run_rows(
            _answer,
            len(q),
            self.threads,
            self._robot,
            self._packed,
            self._disc,
            plan,
            q,
            points,
            out,
        )

"""The exact escape time, solved on a grid for every configuration asked."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.errors import InvalidStateError, check_name
from piec_envs.escape.between import Field, distance_at, value
from piec_envs.escape.disc import Disc, make_disc, make_scratch, place_robot, solve_disc
from piec_envs.escape.paths import MAX_STEPS_PER_NODE, configuration_gradient, trace
from piec_envs.escape.speed import SpeedModel, slowness
from piec_envs.escape.sweeping import FAR
from piec_envs.kernels import batch_kernel, kernel
from piec_envs.parallel import run_rows
from piec_envs.world.robots import get_robot
from piec_envs.world.scene import pack_scene

METHODS = {"sweeping": False, "marching": True}  # first order, second order
VALUE, POINT_GRADIENT, ALL_GRADIENTS = 0, 1, 2  # how much `_answer` computes


class FieldMap(NamedTuple):
    """The escape time of one configuration over the workspace, for drawing.

    `T[i, j]` and `speed[i, j]` belong to the point (x[j], y[i]).
    """

    x: np.ndarray  # (N,) m
    y: np.ndarray  # (N,) m
    T: np.ndarray  # (N, N) s, 0 outside the disc, inf where nothing leads out
    speed: np.ndarray  # (N, N) m/s


def draw_map(field: Field, disc: Disc, speed: SpeedModel, centre=(0.0, 0.0)) -> FieldMap:
    """A solved field as a `FieldMap` around the disc's centre."""
    outside = disc.bound <= 0  # (N, N)
    T = np.where(field.time < FAR, np.maximum(field.time, 0.0), np.inf)
    u = np.where(outside, speed.u_bar, speed.speed(field.distance))
    return FieldMap(disc.axis + centre[0], disc.axis + centre[1], np.where(outside, 0.0, T), u)


def find_path(field: Field, point: np.ndarray) -> np.ndarray:
    """Fastest way out of a solved field from a point, shapes (m, 2), (2,), relative to the disc's centre, m."""
    path = np.empty((MAX_STEPS_PER_NODE * len(field.time), 2))
    return path[: trace(field, point[0], point[1], path)]


@kernel
def _base_gradient(scene, frames, base, p_x, p_y, dq):
    """Gradient in the joints that move the base, against whose motion the point moves."""
    for j in range(base):
        axis, c, s = scene.joint_axis[j], frames[j, 2], frames[j, 3]
        dq[j] = -p_x * (c * axis[0] - s * axis[1]) - p_y * (s * axis[0] + c * axis[1])


@batch_kernel
def _answer(lo, hi, scene, speed, disc, plan, q, points, out):
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
    scratch = make_scratch(scene.robot, q.shape[1] + 1, disc)
    for row in range(lo, hi):
        b_x, b_y = place_robot(scene, base, q[row], scratch)
        field = solve_disc(scene.robot, speed, disc, second_order, scratch)
        for k in range(points.shape[1]):
            x, y = points[row, k, 0] - b_x, points[row, k, 1] - b_y
            t, e_x, e_y = value(field, x, y)
            times[row, k] = t
            if level >= POINT_GRADIENT:
                slow = slowness(speed, distance_at(field, x, y)) if 0.0 < t < np.inf else 0.0
                slopes_p[row, k, 0], slopes_p[row, k, 1] = -e_x * slow, -e_y * slow
            if level >= ALL_GRADIENTS:
                configuration_gradient(scene, base, scratch.frames, field, (x, y), slopes_q[row, k])
                _base_gradient(scene, scratch.frames, base, slopes_p[row, k, 0], slopes_p[row, k, 1], slopes_q[row, k])


class GridField:
    """Escape time from a grid solver, one solve per configuration (paper, section 3.2).

    The workspace disc moves with the robot's base. Rows of a batch do not depend on each other, so
    row i equals the single query bit for bit, with any number of threads.

    Args:
        robot_name: a row of the table of robots.
        resolution: nodes a side of the square grid over the disc.
        method: "sweeping" (first order) or "marching" (second order).
        speed: largest speed as a function of the distance to the robot.
        threads: threads over the rows of a batch; None takes all cores.

    Raises:
        UnknownNameError: if the robot or the method is not known.
        InvalidParameterError: if the resolution is below 16.
    """

    name = "grid"

    def __init__(
        self,
        robot_name: str = "planar_arm",
        resolution: int = 64,
        method: str = "sweeping",
        speed: SpeedModel | None = None,
        threads: int | None = None,
    ):
        check_name("method", method, METHODS)
        robot = get_robot(robot_name)
        self.robot_name, self.resolution, self.method = robot_name, int(resolution), method
        self.speed = speed or SpeedModel()
        self.threads = threads
        self._dof = robot.dof
        self._base = next((j for j, joint in enumerate(robot.joints) if joint.axis[2] != 0), robot.dof)
        self._scene = pack_scene(robot_name, "circle")
        self._packed = self.speed.packed()
        self._disc = make_disc(robot.workspace_radius, self.speed.u_bar, resolution)

    @property
    def u_bar(self) -> float:
        """Speed in free space, m/s."""
        return self.speed.u_bar

    @property
    def leak(self) -> float:
        """Speed within the wall over u_bar, below 1; 0 is a hard wall."""
        return self.speed.leak

    def spec(self) -> dict:
        """What makes this field again through `make_field(**spec)`, as JSON-able values."""
        return {
            "name": self.name,
            "robot_name": self.robot_name,
            "resolution": self.resolution,
            "method": self.method,
            "speed": {key: float(number) for key, number in self._packed._asdict().items()},
        }

    def query(self, points: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Escape time of points.

        Args:
            points: shape (B, k, 2) or (k, 2), m.
            q_r: joint positions, shape (B, n) or (n,), rad or m.

        Returns:
            T, shape (B, k) or (k,), s; 0 on and outside the disc, inf where nothing leads out.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        return self._ask(points, q_r, VALUE)[0]

    def point_gradients(self, points: np.ndarray, q_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Escape time and its gradient in the points.

        Args:
            points: shape (B, k, 2) or (k, 2), m.
            q_r: joint positions, shape (B, n) or (n,), rad or m.

        Returns:
            (T, dT_dp): s and s/m, shapes (B, k) and (B, k, 2), without B for a single row. dT_dp has
            norm 1/u(p), and is 0 where T is 0 or inf.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        return self._ask(points, q_r, POINT_GRADIENT)[:2]

    def gradients(self, points: np.ndarray, q_r: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Escape time and its gradients in the points and the configuration.

        Args:
            points: shape (B, k, 2) or (k, 2), m.
            q_r: joint positions, shape (B, n) or (n,), rad or m.

        Returns:
            (T, dT_dp, dT_dq): as `point_gradients`, and dT_dq of shape (B, k, n) or (k, n), s/rad or
            s/m, from the escape path (see `paths`); 0 where T is 0 or inf.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        return self._ask(points, q_r, ALL_GRADIENTS)

    def solve(self, q_r: np.ndarray) -> FieldMap:
        """Escape time and speed over the whole workspace.

        Args:
            q_r: joint positions, shape (n,), rad or m.

        Returns:
            A `FieldMap`.

        Raises:
            InvalidStateError: if q_r has the wrong shape or is not finite.
        """
        field, base = self._solve(self._rows(np.empty((0, 2)), q_r)[1][0])
        return draw_map(field, self._disc, self.speed, base)

    def escape_path(self, point: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Fastest way out for a point.

        Args:
            point: shape (2,), m.
            q_r: joint positions, shape (n,), rad or m.

        Returns:
            Points from the given one to the circle, T falling strictly, shape (m, 2), m; the point
            alone where it is outside already or nothing leads out.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        points, q, _ = self._rows(np.reshape(point, (1, 2)), q_r)
        field, base = self._solve(q[0])
        return find_path(field, points[0, 0] - base) + base

    def _solve(self, q):
        """One configuration as a `Field`, and the position of the base."""
        scratch = make_scratch(self._scene.robot, self._dof + 1, self._disc)
        base = place_robot(self._scene, self._base, q, scratch)
        return solve_disc(self._scene.robot, self._packed, self._disc, METHODS[self.method], scratch), np.array(base)

    def _rows(self, points, q_r):
        """Points (B, k, 2) and configurations (B, n), checked, and whether a single row was given."""
        points, q = np.ascontiguousarray(points, dtype=float), np.ascontiguousarray(q_r, dtype=float)
        single = q.ndim == 1
        if single:
            points, q = points[None], q[None]
        if points.ndim != 3 or points.shape[2] != 2 or q.ndim != 2 or len(points) != len(q) or q.shape[1] != self._dof:
            raise InvalidStateError(
                f"points must be (B, k, 2) and q_r (B, {self._dof}), or (k, 2) and ({self._dof},); "
                f"got {np.shape(points)[single:]} and {np.shape(q_r)}"
            )
        if not (np.isfinite(points).all() and np.isfinite(q).all()):
            raise InvalidStateError("points and q_r must be finite")
        return points, q, single

    def _ask(self, points, q_r, level):
        """(T, dT_dp, dT_dq) as far as the level goes; the rest are empty."""
        points, q, single = self._rows(points, q_r)
        rows, k = points.shape[:2]
        p_size, q_size = 2 * (level >= POINT_GRADIENT), self._dof * (level >= ALL_GRADIENTS)
        out = np.empty((rows, k)), np.empty((rows, k, p_size)), np.empty((rows, k, q_size))
        plan = METHODS[self.method], self._base, level
        run_rows(_answer, rows, self.threads, self._scene, self._packed, self._disc, plan, q, points, out)
        return tuple(array[0] for array in out) if single else out

"""Static caging: which posture makes the object's escape take longest (paper, section 4.5,
eq. 9).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from piec_envs.errors import InvalidParameterError, InvalidStateError, as_floats, check_name
from piec_envs.escape.field import REDUCTIONS, EscapeField, key_points_world
from piec_envs.escape.speed import SpeedModel
from piec_envs.geometry.clearance import clearance_rows
from piec_envs.parallel import run_rows
from piec_envs.world.objects import get_object
from piec_envs.world.packed import Scene, pack_scene
from piec_envs.world.robots import get_robot

COLLISION_WEIGHT = 1e3  # w_col of the paper's appendix A.1.2, s of escape time per metre of overlap
CLEARANCE_WORK = 0.5  # us of a posture, about, or more with its gradient
FEASIBLE = 1e-6  # m; a posture that breaks no constraint by more counts as feasible


class Postures(NamedTuple):
    """What a `CagingProblem` says of B postures."""

    escape_time: np.ndarray  # (B,) T_hat, s
    phi: np.ndarray  # (B, m) constraints, m; negative where broken

    @property
    def value(self) -> np.ndarray:
        """T_hat less the penalty on overlap, shape (B,), s: what CMA-ES maximises."""
        # The paper prints the cost -T_hat + w_col sum(phi), whose minimum would reward overlap (phi
        # < 0) and closeness; a penalty on overlap alone is meant: +w_col sum(max(0, -phi)).
        return self.escape_time - COLLISION_WEIGHT * np.maximum(0.0, -self.phi).sum(axis=1)

    @property
    def feasible(self) -> np.ndarray:
        """Whether all constraints hold, shape (B,)."""
        return self.phi.min(axis=1) >= -FEASIBLE


class Caged(NamedTuple):
    """One posture beside an object, and what is known of it."""

    robot: str  # a row of the table of robots
    object: str  # a row of the table of objects
    q_r: np.ndarray  # (n,) rad or m
    pose: np.ndarray  # (3,) m and rad
    speed: SpeedModel  # of what wants to escape
    escape_time: float  # s
    enclosed: bool | None  # None of a start, which is not judged


@dataclass(frozen=True, eq=False)
class CagingProblem:
    """Choose a posture q that maximises T_hat(pose, q), without overlap and within the joint
    limits.

    The constraints phi >= 0 are, in metres: for each link and each shape of the object their signed
    distance, then for each two links that could collide theirs, all less `clearance`.

    Args:
        robot: row of the table of robots.
        object: row of the table of objects.
        pose: the object's x, y, angle, shape (3,), or (B, 3) to judge row i of B postures at pose
            i.
        field: the escape field, with a leaky wall.
        reduce: "mean" or "max" over the key points.
        avoid_self_overlap: whether links must keep apart.
        clearance: distance that must be kept, m.
        threads: threads of a batch; None takes all cores.

    Raises:
        UnknownNameError: for a name in no table.
        InvalidStateError: if the pose has the wrong shape or is not finite.
        InvalidParameterError: if a key point lies outside the workspace, or the wall is hard.
    """

    robot: str
    object: str
    pose: np.ndarray
    field: EscapeField
    reduce: str = "mean"
    avoid_self_overlap: bool = True
    clearance: float = 0.0
    threads: int | None = None

    def __post_init__(self):
        get_robot(self.robot)
        get_object(self.object)
        check_name("reduction", self.reduce, REDUCTIONS)
        shape = (len(self.pose), 3) if np.ndim(self.pose) == 2 else (3,)
        object.__setattr__(
            self, "pose", as_floats("object pose", self.pose, shape, InvalidStateError)
        )
        clearance = float(as_floats("clearance", self.clearance, (), InvalidParameterError))
        object.__setattr__(self, "clearance", clearance)
        if not getattr(self.field, "leak", 1.0) > 0:
            raise InvalidParameterError(
                "static caging needs a field with a leaky wall, since behind a hard one the "
                "escape time is "
                "infinite and ranks nothing; got leak = 0"
            )
        self._check_inside()

    def _check_inside(self) -> None:
        """Refuse key points outside the disc of a robot whose base stands still."""
        robot = get_robot(self.robot)
        if robot.joints[0].axis[2] == 0:
            return
        far = np.hypot(self.key_points[..., 0], self.key_points[..., 1]).max(axis=-1)  # () or (B,)
        if far.max() >= robot.workspace_radius:
            pose = np.atleast_2d(self.pose)[int(far.argmax())].tolist()
            raise InvalidParameterError(
                f"all key points of {self.object!r} must lie inside the workspace disc, less than "
                f"{robot.workspace_radius} m from the base; at pose {pose} one is "
                f"{far.max():.3f} m away"
            )

    # --- what follows from the arguments -------------------------------------------------------

    @cached_property
    def scene(self) -> Scene:
        """Robot and object for the kernels."""
        return pack_scene(self.robot, self.object)

    @cached_property
    def key_points(self) -> np.ndarray:
        """Key points in the world, shape (k, 2) or (B, k, 2), m."""
        return key_points_world(get_object(self.object).key_points, self.pose)

    @cached_property
    def pairs(self) -> np.ndarray:
        """Links to hold apart, shape (P, 2)."""
        return (
            self.scene.robot.apart if self.avoid_self_overlap else np.zeros((0, 2), dtype=np.int64)
        )

    @property
    def lower(self) -> np.ndarray:
        """Lower joint limits, shape (n,)."""
        return self.scene.robot.lower

    @property
    def upper(self) -> np.ndarray:
        """Upper joint limits, shape (n,)."""
        return self.scene.robot.upper

    @property
    def object_rows(self) -> int:
        """How many constraints hold links and object apart; they stand before the others."""
        return self.scene.robot.links * len(self.scene.object.shapes.radius)

    # --- values --------------------------------------------------------------------------------

    def measure(self, q: np.ndarray) -> Postures:
        """Escape time and constraints of postures, shape (B, n), rad or m."""
        q = self._rows(q)
        times = self.field.query(self._points(len(q)), q)  # (B, k)
        return Postures(REDUCTIONS[self.reduce](times, axis=1), self._clearances(q, 0)[0])

    def constraints(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Constraints phi and dphi_dq of postures (B, n), shapes (B, m) and (B, m, n), m
        and m/rad.
        """
        return self._clearances(self._rows(q), self.scene.robot.lower.shape[0])

    def escape_time(self, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """T_hat and dT_hat_dq of postures (B, n), shapes (B,) and (B, n), s and s/rad."""
        q = self._rows(q)
        times, _, slopes = self.field.gradients(self._points(len(q)), q)  # (B, k), (B, k, n)
        if self.reduce == "mean":
            return times.mean(axis=1), slopes.mean(axis=1)
        rows = np.arange(len(q))
        last = times.argmax(axis=1)
        return times[rows, last], slopes[rows, last]

    def _clearances(self, q: np.ndarray, columns: int) -> tuple[np.ndarray, np.ndarray]:
        """Constraints and the first `columns` columns of their gradient: all of them or none."""
        count = self.object_rows + len(self.pairs)
        phi = np.empty((len(q), count))
        slope = np.empty((len(q), count, columns))
        pose = np.ascontiguousarray(np.broadcast_to(self.pose, (len(q), 3)))
        work = CLEARANCE_WORK * len(q)
        run_rows(
            clearance_rows,
            len(q),
            self.threads,
            self.scene,
            self.pairs,
            pose,
            q,
            phi,
            slope,
            work=work,
        )
        return phi - self.clearance, slope

    def _points(self, rows: int) -> np.ndarray:
        """Key points for each row, shape (rows, k, 2)."""
        return np.ascontiguousarray(
            np.broadcast_to(self.key_points, (rows, *self.key_points.shape[-2:]))
        )

    def _rows(self, q: np.ndarray) -> np.ndarray:
        """Postures, checked, shape (B, n)."""
        rows = len(self.pose) if self.pose.ndim == 2 else np.shape(q)[0] if np.ndim(q) == 2 else 1
        return as_floats("postures", q, (rows, len(self.lower)), InvalidStateError)

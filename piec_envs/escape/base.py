"""What fields that answer batches share: the checks of what they are asked, paths and maps."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from piec_envs.errors import InvalidStateError, all_finite
from piec_envs.escape.between import Field
from piec_envs.escape.paths import MAX_STEPS_PER_NODE, trace
from piec_envs.escape.protocol import EscapeField, FieldMap
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.sweeping import FAR

# how much a query computes
VALUE = 0
POINT_GRADIENT = 1
ALL_GRADIENTS = 2


def draw_map(field: Field, speed: SpeedModel, centre=(0.0, 0.0)) -> FieldMap:
    """A solved field as a `FieldMap` around the disc's centre.

    Args:
        field: the solved configuration.
        speed: that it was solved with.
        centre: of the disc, two numbers, m.

    Returns:
        The map; outside the disc T is 0 and the speed that of free space.
    """
    axis = field.start + field.h * np.arange(len(field.time))  # (N,)
    outside = np.hypot(*np.meshgrid(axis, axis)) >= field.radius  # (N, N)
    T = np.where(field.time < FAR, np.maximum(field.time, 0.0), np.inf)
    u = np.where(outside, speed.u_bar, speed.speed(field.distance))
    return FieldMap(axis + centre[0], axis + centre[1], np.where(outside, 0.0, T), u)


def find_path(field: Field, point: np.ndarray) -> np.ndarray:
    """Fastest way out of a solved field from a point.

    Args:
        field: the solved configuration.
        point: relative to the disc's centre, shape (2,), m.

    Returns:
        Points relative to the disc's centre, shape (m, 2), m.
    """
    path = np.empty((MAX_STEPS_PER_NODE * len(field.time), 2))
    return path[: trace(field, point[0], point[1], path)]


class BatchedField(EscapeField, ABC):
    """An `EscapeField` that answers whole batches: exact (`GridField`), learned (`NetworkField`) or
    tabulated (`TableField`).

    It adds the robot and the speed that it is of, threads, and `sample`. Rows do not depend on each
    other, so row i equals the single query bit for bit, with any number of threads. Nothing changes
    a field: copies in the same process are the field itself, and what is pickled is its `spec`,
    from which it is made again.

    Args:
        robot_name: a row of the table of robots.
        dof: its number of joints.
        speed: largest speed as a function of the distance to the robot.
    """

    threads: int | None

    def __init__(self, robot_name: str, dof: int, speed: SpeedModel):
        self.robot_name = robot_name
        self.speed = speed
        self._dof = dof

    def __copy__(self) -> BatchedField:
        return self

    def __deepcopy__(self, memo: dict) -> BatchedField:
        return self

    def __reduce__(self) -> tuple:
        return _made_again, (type(self), self.spec(), self.threads)

    @property
    def u_bar(self) -> float:
        """Speed in free space, m/s."""
        return self.speed.u_bar

    @property
    def leak(self) -> float:
        """Speed within the wall over u_bar, below 1; 0 is a hard wall."""
        return self.speed.leak

    @abstractmethod
    def sample(self, q: np.ndarray) -> tuple[Field, np.ndarray]:
        """One configuration on a grid over the disc, and the position of the base.

        Args:
            q: joint positions, shape (n,), rad or m, valid.
        """

    @abstractmethod
    def _answer_rows(self, level: int, q: np.ndarray, points: np.ndarray, out: tuple) -> None:
        """Fill `out` = T (B, k), dT_dp (B, k, 2) and dT_dq (B, k, n), empty beyond the level."""

    def solve(self, q_r: np.ndarray) -> FieldMap:
        """Escape time and speed over the whole workspace; see `EscapeField`."""
        field, base = self.sample(self._rows(np.empty((0, 2)), q_r)[1][0])
        return draw_map(field, self.speed, base)

    def escape_path(self, point: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Fastest way out for a point; see `EscapeField.escape_path`."""
        points, q, _ = self._rows(np.reshape(point, (1, 2)), q_r)
        field, base = self.sample(q[0])
        return find_path(field, points[0, 0] - base) + base

    def query(self, points: np.ndarray, q_r: np.ndarray) -> np.ndarray:
        """Escape time of points; see `EscapeField.query`."""
        return self._ask(points, q_r, VALUE)[0]

    def point_gradients(self, points: np.ndarray, q_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Escape time and its gradient in the points; see `EscapeField.point_gradients`."""
        return self._ask(points, q_r, POINT_GRADIENT)[:2]

    def gradients(
        self, points: np.ndarray, q_r: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Escape time and both gradients; see `EscapeField.gradients`."""
        return self._ask(points, q_r, ALL_GRADIENTS)

    def _rows(self, points, q_r):
        """Points (B, k, 2) and configurations (B, n), checked, and whether a single row was
        given.
        """
        points = np.ascontiguousarray(points, dtype=float)
        q = np.ascontiguousarray(q_r, dtype=float)
        single = q.ndim == 1
        if single:
            points = points[None]
            q = q[None]
        if (
            points.ndim != 3
            or points.shape[2] != 2
            or q.ndim != 2
            or len(points) != len(q)
            or q.shape[1] != self._dof
        ):
            raise InvalidStateError(
                f"points must be (B, k, 2) and q_r (B, {self._dof}), or (k, 2) and ({self._dof},); "
                f"got {np.shape(points)[single:]} and {np.shape(q_r)}"
            )
        if not (all_finite(points) and all_finite(q)):
            raise InvalidStateError("points and q_r must be finite")
        return points, q, single

    def _ask(self, points, q_r, level):
        """(T, dT_dp, dT_dq) as far as the level goes; the rest are empty."""
        points, q, single = self._rows(points, q_r)
        rows, k = points.shape[:2]
        p_size = 2 * (level >= POINT_GRADIENT)
        q_size = self._dof * (level >= ALL_GRADIENTS)
        out = np.empty((rows, k)), np.empty((rows, k, p_size)), np.empty((rows, k, q_size))
        self._answer_rows(level, q, points, out)
        return tuple(array[0] for array in out) if single else out


def _made_again(
    kind: Callable[..., BatchedField], spec: Mapping[str, Any], threads: int | None
) -> BatchedField:
    """A field from what it says of itself."""
    options: dict[str, Any] = {key: value for key, value in spec.items() if key != "name"}
    if "speed" in options:
        options["speed"] = SpeedModel(**options["speed"])
    return kind(threads=threads, **options)

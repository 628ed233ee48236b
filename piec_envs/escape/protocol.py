"""What every escape field answers, said once."""

from __future__ import annotations

from abc import abstractmethod
from typing import NamedTuple, Protocol

import numpy as np


class FieldMap(NamedTuple):
    """The escape time of one configuration over the workspace, for drawing.

    `T[i, j]` and `speed[i, j]` belong to the point (x[j], y[i]).
    """

    x: np.ndarray  # (N,) m
    y: np.ndarray  # (N,) m
    T: np.ndarray  # (N, N) s, 0 outside the disc, inf where nothing leads out
    speed: np.ndarray  # (N, N) m/s


class EscapeField(Protocol):
    """Anything that answers escape times.

    On and outside the workspace disc an object has escaped: T and its gradients are 0 there, and
    the escape path is the point alone. Points and configurations that are not finite are refused.
    """

    name: str

    @property
    @abstractmethod
    def u_bar(self) -> float:
        """Speed in free space, m/s."""
        ...

    @property
    @abstractmethod
    def leak(self) -> float:
        """Speed within the wall over u_bar, below 1; 0 is a hard wall."""
        ...

    @abstractmethod
    def spec(self) -> dict:
        """What makes this field again through `make_field(**spec)`, as JSON-able values."""
        ...

    @abstractmethod
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
        ...

    @abstractmethod
    def point_gradients(self, points: np.ndarray, q_r: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Escape time and its gradient in the points.

        Args:
            points: shape (B, k, 2) or (k, 2), m.
            q_r: joint positions, shape (B, n) or (n,), rad or m.

        Returns:
            (T, dT_dp): s and s/m, shapes (B, k) and (B, k, 2), without B for a single row. An exact
            field's dT_dp has norm 1/u(p); it is 0 where T is 0 or inf.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        ...

    @abstractmethod
    def gradients(
        self, points: np.ndarray, q_r: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Escape time and its gradients in the points and the configuration.

        Args:
            points: shape (B, k, 2) or (k, 2), m.
            q_r: joint positions, shape (B, n) or (n,), rad or m.

        Returns:
            (T, dT_dp, dT_dq): as `point_gradients`, and dT_dq of shape (B, k, n) or (k, n), s/rad
            or s/m; 0 where T is 0 or inf.

        Raises:
            InvalidStateError: if the shapes do not fit or a number is not finite.
        """
        ...

    @abstractmethod
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
        ...

    @abstractmethod
    def solve(self, q_r: np.ndarray) -> FieldMap:
        """Escape time and speed over the whole workspace, of joint positions (n,), rad or m."""
        ...

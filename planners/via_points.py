"""Trajectories through via points (after VP-STO: least integrated squared acceleration)."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline


class ViaPointTrajectory:
    """Joint paths through evenly spaced via points, from rest to rest.

    Of all curves through the points with zero velocity at both ends, the clamped cubic spline has
    the least integrated squared acceleration; it is linear in the points.

    Args:
        points: number of via points; the last one is at the end of the path.
        steps: number of control steps.
    """

    def __init__(self, points: int, steps: int):
        self.points = points
        self.steps = steps
        knots = np.linspace(0, steps, points + 1)
        unit = np.vstack([np.zeros(points), np.eye(points)])  # (points + 1, points)
        # (steps, points)
        self.basis = CubicSpline(knots, unit, bc_type="clamped")(np.arange(1, steps + 1))

    def path(self, start: np.ndarray, via: np.ndarray) -> np.ndarray:
        """Joint positions after each step.

        Args:
            start: present configuration, shape (n,), rad or m.
            via: via points, shape (..., points, n).

        Returns:
            Shape (..., steps, n).
        """
        return start + self.basis @ (via - start)

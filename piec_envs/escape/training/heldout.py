"""The error on configurations that training never sees, to be watched while it goes on."""

from __future__ import annotations

import numpy as np

from piec_envs.escape.grid import GridField
from piec_envs.escape.network import NetworkField
from piec_envs.escape.samples import draw_configurations, draw_points
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.weights import FieldWeights

SEED = 20_001  # apart from the seeds of training and of the accuracy study
CONFIGURATIONS = 20
POINTS = 100
RESOLUTION = 140


class HeldOut:
    """Relative error against the second-order grid at points enclosed by curled configurations.

    It is only looked at: no recipe learns from it.

    Args:
        robot_name: a row of the table of robots.
        speed: the speed model.
        threads: for the grid.
    """

    def __init__(self, robot_name: str, speed: SpeedModel, threads: int | None = None):
        rng = np.random.default_rng(SEED)
        self.q = draw_configurations(robot_name, "curled", CONFIGURATIONS, rng)
        self.points = draw_points(robot_name, "curled", self.q, POINTS, rng)
        self.true = GridField(robot_name, RESOLUTION, "marching", speed, threads).query(
            self.points, self.q
        )

    def error(self, weights: FieldWeights) -> dict[str, float]:
        """Median and mean relative error of a network."""
        found = NetworkField(weights.robot, weights, threads=1).query(self.points, self.q)
        error = np.abs(found - self.true) / self.true
        return {"median": float(np.median(error)), "mean": float(error.mean())}

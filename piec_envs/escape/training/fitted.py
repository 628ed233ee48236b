"""Fitting a field to targets: labels of the grid, or Bellman look-aheads of the round before."""

from __future__ import annotations

import numpy as np
import torch
from torch import nn

from piec_envs.escape.grid import GridField
from piec_envs.escape.inference import SHIFT
from piec_envs.escape.network import NetworkField
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.training.lookahead import bellman_targets
from piec_envs.escape.training.recipes import Bellman, Labelled
from piec_envs.escape.training.reference import LEAST_SCALE, FieldModule
from piec_envs.escape.training.sampling import training_set
from piec_envs.escape.weights import FieldWeights
from piec_envs.world.robots import get_robot

# keep a seed's random numbers apart by their use
DATA_STREAM = 0
BATCH_STREAM = 1
LEAST_BOUND = 0.02  # s, of T_0; nearer to the circle the ratio T / T_0 says nothing
MOST_RATIO = 100.0  # of T / T_0


class FittedLoss:
    """Huber loss of log(T / T_0) on a training set that is made anew in each round.

    Args:
        recipe: how targets are made, and how many.
        robot_name: a row of the table of robots.
        speed: the speed model.
        seed: of all randomness.
        device: of the model.
        threads: for targets.
    """

    def __init__(
        self,
        recipe: Labelled | Bellman,
        robot_name: str,
        speed: SpeedModel,
        seed: int,
        device: str,
        threads: int | None = None,
    ):
        self.recipe = recipe
        self.robot_name = robot_name
        self.speed = speed
        self.seed = seed
        self.device = device
        self.threads = threads
        self.x = self.y = torch.empty(0)

    @property
    def lengths(self) -> list[int]:
        """Iterations of each round."""
        recipe = self.recipe
        if not isinstance(recipe, Bellman):
            return [recipe.iterations]
        return [recipe.iterations] * recipe.rounds + [recipe.last_factor * recipe.iterations]

    def begin_round(
        self, number: int, weights: FieldWeights
    ) -> tuple[torch.Tensor, torch.Tensor] | None:
        """Make the training set.

        Args:
            number: of the round.
            weights: the network at its start.

        Returns:
            Mean and scale of the inputs in round 0, else None.
        """
        rng = np.random.default_rng([self.seed, DATA_STREAM, number])
        q, points = training_set(
            self.robot_name, self.recipe.configurations, self.recipe.points, rng
        )
        field = NetworkField(self.robot_name, weights, self.threads)
        targets = self._targets(number, field, q, points, rng)
        bound = (
            get_robot(self.robot_name).workspace_radius - np.hypot(*np.moveaxis(points, -1, 0))
        ) / self.speed.u_bar
        kept = (bound > LEAST_BOUND) & np.isfinite(targets)
        ratio = np.clip(targets[kept] / bound[kept], 1.0, MOST_RATIO)
        self.x = torch.from_numpy(field.describe(points, q)[kept]).to(self.device)
        self.y = torch.from_numpy(np.log(ratio).astype(np.float32)).to(self.device)
        return (self.x.mean(0), self.x.std(0).clamp(min=LEAST_SCALE)) if number == 0 else None

    def _targets(self, number, field, q, points, rng) -> np.ndarray:
        """T at every point, shape (B, k), s."""
        if isinstance(self.recipe, Labelled):
            grid = GridField(
                self.robot_name, self.recipe.resolution, "marching", self.speed, self.threads
            )
            return grid.query(points, q)
        return bellman_targets(self.robot_name, self.recipe, field, number == 0, q, points, rng)

    def __call__(self, module: FieldModule, iteration: int) -> torch.Tensor:
        """The loss of one iteration's batch."""
        rng = np.random.default_rng([self.seed, BATCH_STREAM, iteration])
        chosen = torch.from_numpy(rng.integers(len(self.y), size=self.recipe.batch)).to(self.device)
        z = module(self.x.index_select(0, chosen))
        found = nn.functional.softplus(z - SHIFT)
        return nn.functional.smooth_l1_loss(
            found, self.y.index_select(0, chosen), beta=self.recipe.huber
        )

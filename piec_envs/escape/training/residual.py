"""The paper's physics-informed loss: eikonal residual and boundary, without labels (section
4.3).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import torch

from piec_envs.escape.samples import draw_configurations, robot_distance
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.training.recipes import Residual
from piec_envs.escape.training.reference import LEAST_SCALE, FieldModule, Geometry
from piec_envs.escape.training.sampling import clear_points
from piec_envs.escape.weights import FieldWeights
from piec_envs.world.robots import get_robot

NORMALISATION_POINTS = 20_000


class Interior(NamedTuple):
    """Points where the eikonal equation is to hold, with what the network says there."""

    p: torch.Tensor  # (N, 2), m
    q: torch.Tensor  # (N, n)
    slowness: torch.Tensor  # 1 / u, (N,), s/m
    time: torch.Tensor  # T, (N,), s
    slope: torch.Tensor  # its gradient in p, (N, 2), s/m
    laplacian: torch.Tensor | None = None  # (N,), s/m^2, where it is asked for


class ResidualLoss:
    """lambda_pde (|grad_p T| - 1/u)^2 + lambda_bc T^2 on the circle (paper, section 4.3).

    Args:
        recipe: points, and the two factors.
        robot_name, speed, seed, device: as in `FittedLoss`.
        threads: not needed.
    """

    def __init__(
        self,
        recipe: Residual,
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
        self.geometry = Geometry(robot_name, recipe.inputs, speed)

    @property
    def lengths(self) -> list[int]:
        """Iterations of the only round."""
        return [self.recipe.iterations]

    def begin_round(
        self, number: int, weights: FieldWeights
    ) -> tuple[torch.Tensor, torch.Tensor] | None:
        """Mean and scale of geometric inputs; raw ones go in as they are, as in the paper.

        Args:
            number, weights: not needed.

        Returns:
            Mean and scale, shapes (F,), or None for raw inputs.
        """
        if self.recipe.inputs == "raw":
            return None
        rng = np.random.default_rng(self.seed)
        q = draw_configurations(self.robot_name, "uniform", NORMALISATION_POINTS // 10, rng)
        points = clear_points(self.robot_name, q, 10, rng, self.recipe.clearance)
        x = self.geometry.describe(
            self._tensor(points.reshape(-1, 2)), self._tensor(np.repeat(q, 10, axis=0))
        )
        return x.mean(0), x.std(0).clamp(min=LEAST_SCALE)

    def _tensor(self, array: np.ndarray) -> torch.Tensor:
        return torch.from_numpy(np.ascontiguousarray(array, dtype=np.float32)).to(self.device)

    def __call__(self, module: FieldModule, iteration: int) -> torch.Tensor:
        """The loss of one iteration's batch."""
        recipe = self.recipe
        rng = np.random.default_rng([self.seed, iteration])
        q = draw_configurations(self.robot_name, "uniform", recipe.configurations, rng)
        loss = self._inner_loss(module, self._interior(module, q, rng, iteration))
        return (
            loss + recipe.weight_bc * self._boundary(module, q, rng)
            if recipe.inputs == "raw"
            else loss
        )

    def _inner_loss(self, module: FieldModule, interior: Interior) -> torch.Tensor:
        """What is asked for inside the disc."""
        return self.recipe.weight_pde * self._residual(interior)

    def _points(self, q: np.ndarray, rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
        """Points (N, 2) and their configurations (N, n): near the robot, and anywhere."""
        recipe = self.recipe
        each = -(-recipe.batch // len(q))
        # (B, k, 2)
        points = clear_points(self.robot_name, q, each, rng, recipe.clearance, recipe.band)
        anywhere = clear_points(self.robot_name, q, each, rng, recipe.clearance)
        near = rng.uniform(size=points.shape[:2]) < recipe.near_share
        points = np.where(near[..., None], points, anywhere)
        return points.reshape(-1, 2)[: recipe.batch], np.repeat(q, each, axis=0)[: recipe.batch]

    def _speed(self, distance: np.ndarray, iteration: int) -> np.ndarray:
        """Speeds at distances to the robot, m/s; the same in every iteration."""
        return self.speed.speed(distance)

    def _interior(
        self, module: FieldModule, q: np.ndarray, rng: np.random.Generator, iteration: int
    ) -> Interior:
        """Points of this iteration, with T and its slope."""
        points, rows = self._points(q, rng)
        distance = robot_distance(self.robot_name, points[:, None], rows)[:, 0]
        slowness = self._tensor(1 / self._speed(distance, iteration))
        p = self._tensor(points).requires_grad_()
        joints = self._tensor(rows)
        return Interior(p, joints, slowness, *self._derived(module, p, joints))

    def _derived(
        self, module: FieldModule, p: torch.Tensor, q: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        """T and its gradient in p."""
        T = self.geometry.time(module, p, q)
        (slope,) = torch.autograd.grad(T.sum(), p, create_graph=True)
        return T, slope

    def _left_side(self, interior: Interior) -> torch.Tensor:
        """What the equation holds against the slowness, shape (N,), s/m."""
        return torch.sqrt((interior.slope * interior.slope).sum(1) + 1e-12)

    def _residual(self, interior: Interior) -> torch.Tensor:
        """Mean square of the residual."""
        left = self._left_side(interior)
        slowness = interior.slowness
        residual = left / slowness - 1 if self.recipe.scaled else left - slowness
        return (residual * residual).mean()

    def _boundary(self, module, q, rng) -> torch.Tensor:
        """Mean of T^2 on the circle, which the factorised form keeps at 0 by itself."""
        count = self.recipe.boundary
        robot = get_robot(self.robot_name)
        angle = rng.uniform(0, 2 * np.pi, count)
        rows = q[rng.integers(len(q), size=count)]
        points = robot.workspace_radius * np.column_stack([np.cos(angle), np.sin(angle)])
        T = self.geometry.time(module, self._tensor(points), self._tensor(rows))
        return (T * T).mean()

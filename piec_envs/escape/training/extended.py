"""What later work adds to the paper's loss: viscosity, progressive speed, a temporal difference.

Sources: see `Extended`. Each term is written for one time field T(p; q) whose zero is the circle,
where the papers' fields are between two points.
"""

from __future__ import annotations

import numpy as np
import torch

from piec_envs.escape.training.jet import raw_jet
from piec_envs.escape.training.recipes import Extended
from piec_envs.escape.training.reference import FieldModule
from piec_envs.escape.training.residual import Interior, ResidualLoss
from piec_envs.world.robots import get_robot


class ExtendedLoss(ResidualLoss):
    """The paper's loss with the additions whose numbers are not 0; arguments as in `FittedLoss`."""

    recipe: Extended

    def _speed(self, distance: np.ndarray, iteration: int) -> np.ndarray:
        """Speeds at distances to the robot, m/s, from u_bar everywhere at first to the true
        ones.
        """
        true = super()._speed(distance, iteration)
        length = self.recipe.ramp * self.recipe.iterations
        if iteration >= length:
            return true
        share = iteration / length
        return (1 - share) * self.speed.u_bar + share * true

    def _left_side(self, interior: Interior) -> torch.Tensor:
        """|grad T| - eps Laplacian(T), shape (N,), s/m."""
        left = super()._left_side(interior)
        if interior.laplacian is None:
            return left
        return left - self.recipe.viscosity * interior.laplacian

    def _derived(
        self, module: FieldModule, p: torch.Tensor, q: torch.Tensor
    ) -> tuple[torch.Tensor, ...]:
        """T and its gradient in p, and its Laplacian if that counts."""
        if self.recipe.viscosity:
            return raw_jet(module, p, q)
        return super()._derived(module, p, q)

    def _inner_loss(self, module: FieldModule, interior: Interior) -> torch.Tensor:
        """The residual's part and the temporal difference's."""
        loss = super()._inner_loss(module, interior)
        if not self.recipe.weight_td:
            return loss
        return loss + self.recipe.weight_td * self._temporal_difference(module, interior)

    def _temporal_difference(self, module: FieldModule, interior: Interior) -> torch.Tensor:
        """Mean square of T(p) - (dt + T(p')), p' where the point is after dt along -grad T.

        The target is not differentiated. A point that would leave the disc stops at the circle, T =
        0.
        """
        with torch.no_grad():
            ahead, spent, out = self._ahead(interior)
            later = self.geometry.time(module, ahead, interior.q)
            target = spent + torch.where(out, torch.zeros_like(later), later)
        difference = interior.time - target
        return (difference * difference).mean()

    def _ahead(self, interior: Interior) -> tuple[torch.Tensor, torch.Tensor, torch.Tensor]:
        """Points after a time step, (N, 2), m, the time they took, (N,), s, and which are out."""
        radius = get_robot(self.robot_name).workspace_radius
        p = interior.p.detach()
        slope = interior.slope.detach()
        along = -slope / torch.sqrt((slope * slope).sum(1, keepdim=True) + 1e-12)
        behind = (p * along).sum(1)
        square = behind * behind - (p * p).sum(1) + radius * radius
        way_out = torch.sqrt(square.clamp(min=0)) - behind
        step = self.recipe.time_step / interior.slowness
        reach = torch.minimum(step, way_out)
        return p + reach[:, None] * along, reach * interior.slowness, way_out <= step

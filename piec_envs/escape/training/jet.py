"""T with its gradient and Laplacian in the points, carried forward through the network in one pass.

Differentiating a gradient twice more costs nearly twice as much. An array of shape (4, N, F) holds
a layer's values, their derivatives in x and y, and their Laplacians.
"""

from __future__ import annotations

import torch
from torch import nn

from piec_envs.escape.training.reference import FieldModule


def raw_jet(module: FieldModule, p: torch.Tensor, q: torch.Tensor) -> tuple[torch.Tensor, ...]:
    """T = softplus(z) of a network on the inputs (p, q), with its derivatives in p.

    Args:
        module: the network.
        p: points, shape (N, 2), m.
        q: configurations, shape (N, n).

    Returns:
        T (N,), s; its gradient (N, 2), s/m; its Laplacian (N,), s/m^2.
    """
    values = (torch.cat([p, q], dim=1) - module.mean) / module.scale
    jet = torch.zeros(4, *values.shape, dtype=values.dtype, device=values.device)
    jet[0] = values
    jet[1, :, 0] = 1 / module.scale[0]
    jet[2, :, 1] = 1 / module.scale[1]
    for layer in module.hidden:
        jet = _activated(_linear(layer, jet))
    z, slope_x, slope_y, bend = _linear(module.out, jet)[..., 0]
    share = torch.sigmoid(z)
    slope = torch.stack([slope_x, slope_y], dim=1)
    laplacian = share * (bend + (1 - share) * (slope * slope).sum(1))
    return nn.functional.softplus(z), share[:, None] * slope, laplacian


def _linear(layer: nn.Module, jet: torch.Tensor) -> torch.Tensor:
    """A linear layer: its bias moves the values alone."""
    product = jet @ layer.weight.T
    return torch.cat([product[:1] + layer.bias, product[1:]])


def _activated(jet: torch.Tensor) -> torch.Tensor:
    """The activation x/2 (1 + u), u = x / sqrt(1 + x^2).

    Its slope is (1 + 2 u - u^3) / 2, its bend (1 - 3/2 u^2) u'.
    """
    x, slope_x, slope_y, laplacian = jet
    inverse = torch.rsqrt(1 + x * x)
    u = x * inverse
    slope = 0.5 * (1 + u * (2 - u * u))
    bend = (1 - 1.5 * u * u) * inverse**3
    curved = slope * laplacian + bend * (slope_x * slope_x + slope_y * slope_y)
    return torch.stack([0.5 * x * (1 + u), slope * slope_x, slope * slope_y, curved])

"""The learned field in torch: the readable twin of the compiled kernels, differentiable
everywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import torch
from torch import nn

from piec_envs.escape.features import NEAR, pairs
from piec_envs.escape.inference import SHIFT
from piec_envs.escape.packed_network import meeting_distance
from piec_envs.escape.speed import SpeedModel
from piec_envs.escape.weights import FieldWeights
from piec_envs.world.robots import get_robot

TINY = 1e-12  # m^2, as in the kernels
LEAST_SCALE = 1e-2  # of a normalised input: features hardly seen in training must not explode later
SMALL = 1e-2  # likewise


def skeleton(robot_name: str, q: torch.Tensor) -> torch.Tensor:
    """Origins of the turning joints and the tip, in the frame of the base turned by the first of
    them.

    Args:
        robot_name: a row of the table of robots.
        q: configurations, shape (N, n).

    Returns:
        Shape (N, L + 1, 2), m.
    """
    robot = get_robot(robot_name)
    joints = robot.joints
    base = robot.base_dof
    tip = (float(robot.tip[0]), float(robot.tip[1]))
    turn = torch.zeros_like(q[:, 0])
    where = torch.zeros(len(q), 2, dtype=q.dtype, device=q.device)
    points = [where]
    for j in range(base + 1, len(joints) + 1):
        offset = joints[j].origin[:2] if j < len(joints) else tip
        c = torch.cos(turn)
        s = torch.sin(turn)
        where = where + torch.stack(
            [c * offset[0] - s * offset[1], s * offset[0] + c * offset[1]], dim=1
        )
        points.append(where)
        if j < len(joints):
            turn = turn + joints[j].origin[2] + joints[j].axis[2] * q[:, j]
    return torch.stack(points, dim=1)


def to_base(robot_name: str, p: torch.Tensor, q: torch.Tensor) -> torch.Tensor:
    """Points in the frame of `skeleton`, for a robot whose base is fixed or slides along x and y.

    Args:
        robot_name: a row of the table of robots.
        p: points in the world, shape (N, 2), m.
        q: configurations, shape (N, n), rad or m.

    Returns:
        Shape (N, 2), m.
    """
    joints = get_robot(robot_name).joints
    base = get_robot(robot_name).base_dof
    for j in range(base):
        p = p - q[:, j : j + 1] * torch.tensor(joints[j].axis[:2], dtype=p.dtype, device=p.device)
    angle = joints[base].origin[2] + joints[base].axis[2] * q[:, base]
    c = torch.cos(angle)
    s = torch.sin(angle)
    return torch.stack([c * p[:, 0] + s * p[:, 1], c * p[:, 1] - s * p[:, 0]], dim=1)


def _distance(a: torch.Tensor, start: torch.Tensor, end: torch.Tensor) -> torch.Tensor:
    """Distance of points to segments, all (N, 2)."""
    edge = end - start
    t = (((a - start) * edge).sum(1) / (edge * edge).sum(1)).clamp(0, 1)
    offset = a - start - t[:, None] * edge
    return torch.sqrt((offset * offset).sum(1) + TINY)


def _half_sine(p: torch.Tensor, start: torch.Tensor, end: torch.Tensor) -> torch.Tensor:
    """sin(phi / 2) of the angle that the segments subtend at the points, all (N, 2)."""
    a = start - p
    b = end - p
    a_norm, b_norm = (torch.sqrt((v * v).sum(1, keepdim=True) + TINY) for v in (a, b))
    cross = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    middle = b_norm * a + a_norm * b
    return cross / torch.sqrt((middle * middle).sum(1) + TINY)


def features(robot_name: str, points: torch.Tensor, q: torch.Tensor, d0: float) -> torch.Tensor:
    """The features listed in `piec_envs.escape.features`.

    Args:
        robot_name: a row of the table of robots.
        points: shape (N, 2), m.
        q: configurations, shape (N, n).
        d0: thickness of the wall, m.

    Returns:
        Shape (N, F).
    """
    width = meeting_distance(robot_name, d0)
    p = to_base(robot_name, points, q)
    s = skeleton(robot_name, q)
    segments = s.shape[1] - 1
    columns = [p[:, 0], p[:, 1], torch.sqrt((p * p).sum(1) + TINY)]
    for m in range(2, segments + 1):
        columns += [s[:, m, 0], s[:, m, 1]]
    for i in range(segments):
        distance = _distance(p, s[:, i], s[:, i + 1])
        columns += [distance, NEAR / (NEAR + distance), _half_sine(p, s[:, i], s[:, i + 1])]
    for m, i in pairs(segments):
        distance = _distance(s[:, m], s[:, i], s[:, i + 1])
        closure = torch.sqrt((1 - distance / width).clamp(min=0) + SMALL) - SMALL**0.5
        columns += [NEAR / (NEAR + distance), closure]
    return torch.stack(columns, dim=1)


class Activation(torch.autograd.Function):
    """x/2 (1 + x / sqrt(1 + x^2)); keeps only x, which halves the memory traffic of a
    composed one.
    """

    @staticmethod
    def forward(ctx, x):
        """The value.

        Args:
            ctx: keeps x for `backward`.
            x: of any shape.

        Returns:
            The shape of x.
        """
        ctx.save_for_backward(x)
        return 0.5 * torch.addcmul(x, x, x * torch.rsqrt(1 + x * x))

    @staticmethod
    def backward(ctx, *gradients):
        """Times the derivative (1 + 2 u - u^3) / 2, u = x / sqrt(1 + x^2), differentiable in turn.

        Args:
            ctx: of `forward`.
            gradients: one, of the loss in the output.

        Returns:
            The gradient of the loss in x.
        """
        (x,) = ctx.saved_tensors
        u = x * torch.rsqrt(1 + x * x)
        return gradients[0] * 0.5 * (1 + u * (2 - u * u))


class FieldModule(nn.Module):
    """The network z(inputs) of a field, its inputs normalised.

    Args:
        inputs: F.
        width: of the hidden layers.
        depth: number of hidden layers.
    """

    mean: torch.Tensor
    scale: torch.Tensor

    def __init__(self, inputs: int, width: int, depth: int):
        super().__init__()
        self.register_buffer("mean", torch.zeros(inputs))
        self.register_buffer("scale", torch.ones(inputs))
        self.hidden = nn.ModuleList(
            nn.Linear(inputs if k == 0 else width, width) for k in range(depth)
        )
        self.out = nn.Linear(width, 1)

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Outputs (N,) for inputs (N, F)."""
        x = (x - self.mean) / self.scale
        for layer in self.hidden:
            x = Activation.apply(layer(x))
        return self.out(x)[:, 0]

    def arrays(self) -> dict[str, np.ndarray]:
        """The weights as `FieldWeights` holds them."""
        first, *others = self.hidden
        width = first.out_features
        tensors = {
            "mean": self.mean,
            "scale": self.scale,
            "w_in": first.weight,
            "b_in": first.bias,
            "w": torch.stack([layer.weight for layer in others])
            if others
            else torch.empty(0, width, width),
            "b": torch.stack([layer.bias for layer in others]) if others else torch.empty(0, width),
            "w_out": self.out.weight[0],
            "b_out": self.out.bias,
        }
        return {
            name: tensor.detach().cpu().numpy().astype(np.float32)
            for name, tensor in tensors.items()
        }

    @classmethod
    def of(cls, weights: FieldWeights) -> FieldModule:
        """The module with given weights."""
        arrays = {name: torch.tensor(array) for name, array in weights.arrays.items()}
        module = cls(len(arrays["mean"]), len(arrays["b_in"]), 1 + len(arrays["b"]))
        first, *others = module.hidden
        with torch.no_grad():
            module.mean.copy_(arrays["mean"])
            module.scale.copy_(arrays["scale"])
            first.weight.copy_(arrays["w_in"])
            first.bias.copy_(arrays["b_in"])
            for k, layer in enumerate(others):
                layer.weight.copy_(arrays["w"][k])
                layer.bias.copy_(arrays["b"][k])
            module.out.weight.copy_(arrays["w_out"][None])
            module.out.bias.copy_(arrays["b_out"])
        return module


@dataclass(frozen=True)
class Geometry:
    """What turns a network's output into a time.

    Args:
        robot: name of the robot.
        inputs: "skeleton" or "raw"; see `FieldWeights`.
        speed: gives u_bar and d0.
    """

    robot: str
    inputs: str
    speed: SpeedModel

    def describe(self, points: torch.Tensor, q: torch.Tensor) -> torch.Tensor:
        """The network's inputs.

        Args:
            points: shape (N, 2), m.
            q: configurations, shape (N, n), rad or m.

        Returns:
            Shape (N, F).
        """
        if self.inputs == "skeleton":
            return features(self.robot, points, q, self.speed.d0)
        joints = get_robot(self.robot).joints
        base = get_robot(self.robot).base_dof
        for j in range(base):
            points = points - q[:, j : j + 1] * torch.tensor(
                joints[j].axis[:2], dtype=points.dtype, device=points.device
            )
        return torch.cat([points, q[:, base:]], dim=1)

    def time(self, module: nn.Module, points: torch.Tensor, q: torch.Tensor) -> torch.Tensor:
        """T at points inside the disc.

        Args:
            module: the network z.
            points: shape (N, 2), m.
            q: configurations, shape (N, n), rad or m.

        Returns:
            Softplus(z) for raw inputs, else T_0 exp(softplus(z - 3)), shape (N,), s.
        """
        z = module(self.describe(points, q))
        if self.inputs == "raw":
            return nn.functional.softplus(z)
        return self.bound(points, q) * torch.exp(nn.functional.softplus(z - SHIFT))

    def bound(self, points: torch.Tensor, q: torch.Tensor) -> torch.Tensor:
        """The least time T_0 = (R - |p|) / u_bar.

        Args:
            points: p, shape (N, 2), m.
            q: configurations, shape (N, n), rad or m.

        Returns:
            Shape (N,), s.
        """
        p = to_base(self.robot, points, q)
        return (
            get_robot(self.robot).workspace_radius - torch.sqrt((p * p).sum(1) + TINY)
        ) / self.speed.u_bar

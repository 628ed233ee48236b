"""A learned field as its compiled kernels take it: weights, geometry and scales in one tuple."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.escape.features import pairs
from piec_envs.escape.perceptron import PackedLayers, pack_layers
from piec_envs.escape.weights import FieldWeights
from piec_envs.world.robots import get_robot


class PackedNetwork(NamedTuple):
    """A learned field for the compiled kernels."""

    layers: PackedLayers  # the weights
    # `pairs` (K, 2), and the distance at which walls of links meet, m
    gaps: tuple[np.ndarray, np.float32]
    tip: np.ndarray  # (2,) m, in the last frame
    base: int  # leading joints that move the base
    geometric: bool  # inputs "skeleton", else "raw"
    radius: float  # of the workspace, m
    u_bar: float  # m/s


def meeting_distance(robot_name: str, d0: float) -> float:
    """Distance between the skeletons of two links at which the walls around them meet.

    Args:
        robot_name: a row of the table of robots.
        d0: thickness of the wall, m.

    Returns:
        2 (half width of a link + d0), m.
    """
    return 2 * (get_robot(robot_name).half_width + d0)


def pack_network(weights: FieldWeights) -> PackedNetwork:
    """Pack a learned field; the normalisation of its inputs goes into the first layer."""
    robot = get_robot(weights.robot)
    arrays = {name: np.asarray(array, dtype=float) for name, array in weights.arrays.items()}
    w_in = arrays["w_in"] / arrays["scale"]
    b_in = arrays["b_in"] - w_in @ arrays["mean"]
    return PackedNetwork(
        layers=pack_layers(
            w_in, b_in, arrays["w"], arrays["b"], arrays["w_out"], arrays["b_out"][0]
        ),
        gaps=(
            pairs(robot.dof - robot.base_dof),
            np.float32(meeting_distance(weights.robot, weights.speed.d0)),
        ),
        tip=robot.tip,
        base=robot.base_dof,
        geometric=weights.inputs == "skeleton",
        radius=float(robot.workspace_radius),
        u_bar=weights.speed.u_bar,
    )

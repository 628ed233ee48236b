"""The compiled learned field: features, layers and gradients of LANES points side by side."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.escape.base import VALUE
from piec_envs.escape.features import (
    LANES,
    describe,
    describe_back,
    joint_gradient,
    place_skeleton,
)
from piec_envs.escape.perceptron import backward, forward
from piec_envs.geometry.kinematics import base_gradient, link_frames
from piec_envs.held import Held
from piec_envs.kernels import batch_kernel, kernel

SHIFT = 3.0  # T = T_0 exp(softplus(z - SHIFT)), so that an untrained network is close to T_0


class Block(NamedTuple):
    """Working memory for LANES points side by side."""

    frames: np.ndarray  # (n + 1, 4)
    place: np.ndarray  # (4, LANES) x, y, cos, sin of the frame of the skeleton
    p: np.ndarray  # (2, LANES) float32, points in that frame
    skeleton: np.ndarray  # (L + 1, 2, LANES) float32
    spare: np.ndarray  # (LANES,)
    x: np.ndarray  # (F, LANES)
    hidden: np.ndarray  # (depth, H, LANES)
    slope: np.ndarray  # (depth, H, LANES)
    z: np.ndarray  # (LANES,)
    g: np.ndarray  # (2, H, LANES)
    g_x: np.ndarray  # (F, LANES)
    g_p: np.ndarray  # (2, LANES)
    g_skeleton: np.ndarray  # (L + 1, 2, LANES)


@batch_kernel
def make_block(robot, network):
    """Working memory for one thread.

    Args:
        robot: a `PackedRobot`.
        network: a `PackedNetwork`.

    Returns:
        A `Block`.
    """
    f32, layers, n = np.float32, network.layers, robot.joint_axis.shape[0]
    width, depth, inputs = layers.w_out.shape[0], layers.w.shape[0] + 1, layers.w_in.shape[1]
    points = n - network.base + 1
    return Block(
        np.empty((n + 1, 4)),
        np.empty((4, LANES)),
        np.empty((2, LANES), f32),
        np.empty((points, 2, LANES), f32),
        np.empty(LANES, f32),
        np.zeros((inputs, LANES), f32),
        np.empty((depth, width, LANES), f32),
        np.empty((depth, width, LANES), f32),
        np.empty(LANES, f32),
        np.empty((2, width, LANES), f32),
        np.empty((inputs, LANES), f32),
        np.empty((2, LANES), f32),
        np.empty((points, 2, LANES), f32),
    )


@kernel
def load_block(robot, network, q, points, first, last, block):
    """Fill the lanes with the points `first`, `first` + 1, ..., counted row by row; `last` fills
    the rest.

    Args:
        robot: a `PackedRobot`.
        network: a `PackedNetwork`.
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        first, last: numbers of points.
        block: `place`, `p`, `skeleton` and the network's inputs `x` are written.
    """
    columns, before = points.shape[1], -1
    for lane in range(LANES):
        number = min(first + lane, last)
        row = number // columns
        if row != before:
            place = place_skeleton(
                robot, network.base, network.tip, q[row], block.frames, block.skeleton, lane
            )
            before = row
        else:
            for m in range(block.skeleton.shape[0]):
                block.skeleton[m, 0, lane] = block.skeleton[m, 0, lane - 1]
                block.skeleton[m, 1, lane] = block.skeleton[m, 1, lane - 1]
        for i in range(4):
            block.place[i, lane] = place[i]
        p = points[row, number - row * columns]
        d_x, d_y = p[0] - place[0], p[1] - place[1]
        block.p[0, lane] = place[2] * d_x + place[3] * d_y
        block.p[1, lane] = place[2] * d_y - place[3] * d_x
        if not network.geometric:
            block.x[0, lane], block.x[1, lane] = d_x, d_y
            for j in range(network.base, q.shape[1]):
                block.x[2 + j - network.base, lane] = q[row, j]
    if network.geometric:
        describe(block.p, block.skeleton, network.gaps, block.spare, block.x)


@kernel
def _time(network, z, rho):
    """(T, dT/dz, dT/drho) at the network's output z, at the distance rho from the base."""
    bound = (network.radius - rho) / network.u_bar
    if bound <= 0.0:
        return 0.0, 0.0, 0.0
    v = z - SHIFT if network.geometric else z
    e = np.exp(-abs(v))
    softplus = max(v, 0.0) + np.log(1.0 + e)
    sigmoid = (1.0 if v > 0.0 else e) / (1.0 + e)
    if not network.geometric:
        return softplus, sigmoid, 0.0
    ratio = np.exp(softplus)
    return bound * ratio, bound * ratio * sigmoid, -ratio / network.u_bar


@kernel
def _gradients(robot, network, row, lane, block, slope_z, slope_rho, dT_dp, dT_dq):
    """Write dT/dp (2,) and, unless it is empty, dT/dq (n,) of one lane."""
    p_x, p_y, c, s = block.p[0, lane], block.p[1, lane], block.place[2, lane], block.place[3, lane]
    if network.geometric:
        outward = slope_rho / max(np.hypot(p_x, p_y), 1e-12)
        g_x, g_y = (
            slope_z * block.g_p[0, lane] + outward * p_x,
            slope_z * block.g_p[1, lane] + outward * p_y,
        )
        dT_dp[0], dT_dp[1] = c * g_x - s * g_y, s * g_x + c * g_y
    else:
        dT_dp[0], dT_dp[1] = slope_z * block.g_x[0, lane], slope_z * block.g_x[1, lane]
    if dT_dq.shape[0] == 0:
        return
    if network.geometric:
        joint_gradient(
            robot,
            network.base,
            p_x,
            p_y,
            slope_z,
            lane,
            block.skeleton,
            block.g_p,
            block.g_skeleton,
            dT_dq,
        )
    else:
        for j in range(network.base, dT_dq.shape[0]):
            dT_dq[j] = slope_z * block.g_x[2 + j - network.base, lane]
    if network.base > 0:
        link_frames(robot, row, block.frames)
        base_gradient(robot, block.frames, network.base, dT_dp[0], dT_dp[1], dT_dq)


@batch_kernel
def make_answerer(robot, network):
    """What a thread answers with, held: the robot, the network and scratch.

    Args:
        robot: a `PackedRobot`.
        network: a `PackedNetwork`.

    Returns:
        For `answer_rows`.
    """
    return Held((robot, network, make_block(robot, network)))


@batch_kernel
def answer_rows(lo, hi, held, level, q, points, out):
    """Rows lo to hi: every point's T and, as far as the level asks, its gradients.

    Args:
        lo, hi: row range.
        held: from `make_answerer`.
        level: VALUE, POINT_GRADIENT or ALL_GRADIENTS.
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        out: T (B, k), dT_dp (B, k, 2) and dT_dq (B, k, n), empty beyond the level.
    """
    times, slopes_p, slopes_q = out
    columns = points.shape[1]
    if hi <= lo or columns == 0:
        return
    robot, network, block = held.value
    for first in range(lo * columns, hi * columns, LANES):
        last = min(first + LANES, hi * columns) - 1
        load_block(robot, network, q, points, first, last, block)
        forward(network.layers, block.x, block.hidden, block.slope, block.z)
        if level > VALUE:
            backward(network.layers, block.slope, block.g, block.g_x)
            if network.geometric:
                describe_back(
                    block.p,
                    block.skeleton,
                    network.gaps,
                    block.x,
                    block.g_x,
                    block.spare,
                    block.g_p,
                    block.g_skeleton,
                )
        for number in range(first, last + 1):
            row, lane = number // columns, number - first
            k = number - row * columns
            b_x, b_y = (
                points[row, k, 0] - block.place[0, lane],
                points[row, k, 1] - block.place[1, lane],
            )
            t, slope_z, slope_rho = _time(network, block.z[lane], np.hypot(b_x, b_y))
            times[row, k] = t
            if level > VALUE:
                _gradients(
                    robot,
                    network,
                    q[row],
                    lane,
                    block,
                    slope_z,
                    slope_rho,
                    slopes_p[row, k],
                    slopes_q[row, k],
                )


@batch_kernel
def describe_rows(lo, hi, robot, network, q, points, out):
    """Network inputs of every point of rows lo to hi - 1.

    Args:
        lo, hi: row range.
        robot: a `PackedRobot`.
        network: a `PackedNetwork`.
        q: joint positions, shape (B, n), rad or m.
        points: shape (B, k, 2), m.
        out: output, shape (B, k, F).
    """
    columns = points.shape[1]
    if hi <= lo or columns == 0:
        return
    block = make_block(robot, network)
    for first in range(lo * columns, hi * columns, LANES):
        last = min(first + LANES, hi * columns) - 1
        load_block(robot, network, q, points, first, last, block)
        for number in range(first, last + 1):
            row = number // columns
            for f in range(out.shape[2]):
                out[row, number - row * columns, f] = block.x[f, number - first]

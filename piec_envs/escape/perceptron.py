"""A multi-layer perceptron, evaluated for LANES inputs side by side, and its gradient in the
inputs.

Hidden layers have one width H, a multiple of four, and the activation x/2 (1 + x / sqrt(1 + x^2)),
a SiLU without exponential. Arrays end with the axis of lanes.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.escape.features import LANES
from piec_envs.kernels import lane_kernel

BLOCK = 4  # outputs that one pass over the inputs adds up
_ZERO = np.float32(0.0)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_TWO = np.float32(2.0)


class PackedLayers(NamedTuple):
    """Weights as float32; the number of inputs F is padded to a multiple of BLOCK with zeros.

    `transposed` and `transposed_in` serve the gradient.
    """

    w_in: np.ndarray  # (H, F)
    b_in: np.ndarray  # (H,)
    w: np.ndarray  # (depth - 1, H, H)
    b: np.ndarray  # (depth - 1, H)
    w_out: np.ndarray  # (H,)
    b_out: np.float32  # of the one output
    transposed_in: np.ndarray  # (F, H)
    transposed: np.ndarray  # (depth - 1, H, H)
    zero: np.ndarray  # (max(F, H),)


def pack_layers(w_in, b_in, w, b, w_out, b_out) -> PackedLayers:
    """Pack the weights of a perceptron.

    Args:
        w_in, b_in, w, b, w_out, b_out: shapes as in `PackedLayers`, F of any size.

    Returns:
        The same as float32, F padded, and what serves the gradient.
    """
    padding = -w_in.shape[1] % BLOCK
    w_in = np.pad(w_in, ((0, 0), (0, padding))).astype(np.float32)
    w = np.ascontiguousarray(w, dtype=np.float32)
    return PackedLayers(
        np.ascontiguousarray(w_in),
        np.ascontiguousarray(b_in, dtype=np.float32),
        w,
        np.ascontiguousarray(b, dtype=np.float32),
        np.ascontiguousarray(w_out, dtype=np.float32),
        np.float32(b_out),
        np.ascontiguousarray(w_in.T),
        np.ascontiguousarray(w.transpose(0, 2, 1)),
        np.zeros(max(w_in.shape), dtype=np.float32),
    )


@lane_kernel
def _dense(w, b, x, y):
    """Y = w x + b for w of shape (O, I), O a multiple of BLOCK; x (I, LANES), y (O, LANES)."""
    for o in range(0, w.shape[0], 4):
        for n in range(LANES):
            y[o, n], y[o + 1, n], y[o + 2, n], y[o + 3, n] = b[o], b[o + 1], b[o + 2], b[o + 3]
        for i in range(w.shape[1]):
            w_0, w_1, w_2, w_3 = w[o, i], w[o + 1, i], w[o + 2, i], w[o + 3, i]
            for n in range(LANES):
                x_i = x[i, n]
                y[o, n] += w_0 * x_i
                y[o + 1, n] += w_1 * x_i
                y[o + 2, n] += w_2 * x_i
                y[o + 3, n] += w_3 * x_i


@lane_kernel
def _activate(y, slope):
    """Replace y by its activation and write the derivative, both (H, LANES)."""
    for o in range(y.shape[0]):
        for n in range(LANES):
            v = y[o, n]
            u = v / np.sqrt(_ONE + v * v)
            y[o, n] = _HALF * v * (_ONE + u)
            slope[o, n] = _HALF * (_ONE + u * (_TWO - u * u))


@lane_kernel
def forward(layers, x, hidden, slope, z):
    """The network's output.

    Args:
        layers: a `PackedLayers`.
        x: inputs, shape (F, LANES).
        hidden, slope: activations and their derivatives, written, shape (depth, H, LANES).
        z: output, shape (LANES,).
    """
    _dense(layers.w_in, layers.b_in, x, hidden[0])
    _activate(hidden[0], slope[0])
    last = layers.w.shape[0]
    for k in range(last):
        _dense(layers.w[k], layers.b[k], hidden[k], hidden[k + 1])
        _activate(hidden[k + 1], slope[k + 1])
    for n in range(LANES):
        z[n] = layers.b_out
    for o in range(layers.w_out.shape[0]):
        w_o = layers.w_out[o]
        for n in range(LANES):
            z[n] += w_o * hidden[last, o, n]


@lane_kernel
def backward(layers, slope, g, g_x):
    """Gradient of the output in the inputs.

    Args:
        layers: a `PackedLayers`.
        slope: of the activations, from `forward`, shape (depth, H, LANES).
        g: scratch, shape (2, H, LANES).
        g_x: output, shape (F, LANES).
    """
    last = layers.w.shape[0]
    for o in range(layers.w_out.shape[0]):
        for n in range(LANES):
            g[0, o, n] = layers.w_out[o] * slope[last, o, n]
    now = 0
    for k in range(last - 1, -1, -1):
        _dense(layers.transposed[k], layers.zero, g[now], g[1 - now])
        now = 1 - now
        for o in range(layers.w_out.shape[0]):
            for n in range(LANES):
                g[now, o, n] *= slope[k, o, n]
    _dense(layers.transposed_in, layers.zero, g[now], g_x)

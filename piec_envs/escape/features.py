"""What a learned field is told of a point and a configuration, and how its gradient leads back.

The robot is seen as its skeleton: the origins of its turning joints and its tip, s_0 to s_L, in the
frame of the base turned by the first turning joint, since the field of a disc does not change when
all turns. The features of a point p are

    p, |p|, s_2 ... s_L,
    for each segment (s_i, s_i+1):   |p - segment|, nearness to it, sin(half the angle it subtends
    at p), for each s_m off a segment:      its nearness to that segment (how narrow the gaps are),
    and its closure,

with nearness = c / (c + distance) and closure = sqrt(max(0, 1 - distance / w)), w the distance at
which the walls of two links meet: where they overlap, the time through them grows with that root.
LANES pairs (point, configuration) are described side by side; arrays end with that axis.
`piec_envs.escape.training.reference` is the readable twin.
"""

from __future__ import annotations

import numpy as np

from piec_envs.geometry.kinematics import link_frames
from piec_envs.kernels import kernel, lane_kernel

LANES = 32
NEAR = 0.06  # m, distance at which the nearness is one half
_NEAR = np.float32(NEAR)
_ZERO = np.float32(0.0)
_ONE = np.float32(1.0)
_TWO = np.float32(2.0)
# round the root of the closure at 0
_SMALL = np.float32(1e-2)
_ROOT = np.float32(0.1)
_OPEN = np.float32(1e-6)  # closure of a gap that is open, up to rounding
_TINY = np.float32(1e-12)  # m^2, keeps roots and quotients finite on the skeleton itself


def pairs(segments: int) -> np.ndarray:
    """Which skeleton points are compared with which segments, shape (K, 2): (point m,
    segment i).
    """
    off = [(m, i) for m in range(segments + 1) for i in range(segments) if m not in (i, i + 1)]
    return np.array(off, dtype=np.int64).reshape(-1, 2)


def feature_count(segments: int) -> int:
    """Number of features of a robot with that many segments."""
    return 3 + 2 * (segments - 1) + 3 * segments + 2 * len(pairs(segments))


@kernel
def place_skeleton(robot, base, tip, q, frames, skeleton, lane):
    """Write the skeleton of a configuration into one lane.

    Args:
        robot: a `PackedRobot`.
        base: number of leading joints that move the base.
        tip: the robot's tip in its last frame, shape (2,), m.
        q: joint positions, shape (n,).
        frames: scratch, shape (n + 1, 4).
        skeleton: output, shape (L + 1, 2, LANES), m.
        lane: which one.

    Returns:
        (x, y, cos, sin) of the frame that the skeleton is written in.
    """
    link_frames(robot, q, frames)
    x, y, c, s = frames[base + 1, 0], frames[base + 1, 1], frames[base + 1, 2], frames[base + 1, 3]
    last = q.shape[0]
    for m in range(skeleton.shape[0]):
        f = min(base + 1 + m, last)
        d_x, d_y = frames[f, 0] - x, frames[f, 1] - y
        if m == skeleton.shape[0] - 1:
            d_x += frames[f, 2] * tip[0] - frames[f, 3] * tip[1]
            d_y += frames[f, 3] * tip[0] + frames[f, 2] * tip[1]
        skeleton[m, 0, lane] = c * d_x + s * d_y
        skeleton[m, 1, lane] = c * d_y - s * d_x
    return x, y, c, s


@lane_kernel
def _distance(a, start, end, out):
    """out[n] = distance of the points `a` to the segments from `start` to `end`, all (2, LANES)."""
    for n in range(LANES):
        e_x, e_y = end[0, n] - start[0, n], end[1, n] - start[1, n]
        d_x, d_y = a[0, n] - start[0, n], a[1, n] - start[1, n]
        t = (d_x * e_x + d_y * e_y) / (e_x * e_x + e_y * e_y)
        t = t if t > _ZERO else _ZERO
        t = t if t < _ONE else _ONE
        r_x, r_y = d_x - t * e_x, d_y - t * e_y
        out[n] = np.sqrt(r_x * r_x + r_y * r_y + _TINY)


@lane_kernel
def _to_nearness(distance, out):
    for n in range(LANES):
        out[n] = _NEAR / (_NEAR + distance[n])


@lane_kernel
def _to_closure(distance, width, out):
    for n in range(LANES):
        v = _ONE - distance[n] / width
        out[n] = np.sqrt((v if v > _ZERO else _ZERO) + _SMALL) - _ROOT


@lane_kernel
def _half_sine(p, start, end, out):
    """out[n] = sin(phi / 2) of the angle phi in (-pi, pi) that the segment subtends at p.

    With a and b from p to the ends it is a x b over the norm of |b| a + |a| b, which stays exact to
    rounding, and real, where p comes to lie on the segment and the two cancel.
    """
    for n in range(LANES):
        a_x, a_y = start[0, n] - p[0, n], start[1, n] - p[1, n]
        b_x, b_y = end[0, n] - p[0, n], end[1, n] - p[1, n]
        a, b = np.sqrt(a_x * a_x + a_y * a_y + _TINY), np.sqrt(b_x * b_x + b_y * b_y + _TINY)
        w_x, w_y = b * a_x + a * b_x, b * a_y + a * b_y
        out[n] = (a_x * b_y - a_y * b_x) / np.sqrt(w_x * w_x + w_y * w_y + _TINY)


@lane_kernel
def describe(p, skeleton, gaps, distance, x):
    """Features of one block.

    Args:
        p: points, shape (2, LANES), m.
        skeleton: shape (L + 1, 2, LANES), m.
        gaps: `pairs`, and the distance at which walls meet, m.
        distance: scratch, shape (LANES,).
        x: output, shape (F, LANES).
    """
    (pairs, width), segments = gaps, skeleton.shape[0] - 1
    for n in range(LANES):
        x[0, n], x[1, n] = p[0, n], p[1, n]
        x[2, n] = np.sqrt(p[0, n] * p[0, n] + p[1, n] * p[1, n] + _TINY)
    f = 3
    for m in range(2, segments + 1):
        for n in range(LANES):
            x[f, n], x[f + 1, n] = skeleton[m, 0, n], skeleton[m, 1, n]
        f += 2
    for i in range(segments):
        _distance(p, skeleton[i], skeleton[i + 1], x[f])
        _to_nearness(x[f], x[f + 1])
        _half_sine(p, skeleton[i], skeleton[i + 1], x[f + 2])
        f += 3
    for k in range(pairs.shape[0]):
        m, i = pairs[k, 0], pairs[k, 1]
        _distance(skeleton[m], skeleton[i], skeleton[i + 1], distance)
        _to_nearness(distance, x[f])
        _to_closure(distance, width, x[f + 1])
        f += 2


@lane_kernel
def _distance_back(a, start, end, g, g_a, g_start, g_end):
    """Add the gradient g (LANES,) of `_distance` to those of its points, (2, LANES)."""
    for n in range(LANES):
        e_x, e_y = end[0, n] - start[0, n], end[1, n] - start[1, n]
        d_x, d_y = a[0, n] - start[0, n], a[1, n] - start[1, n]
        t = (d_x * e_x + d_y * e_y) / (e_x * e_x + e_y * e_y)
        t = t if t > _ZERO else _ZERO
        t = t if t < _ONE else _ONE
        r_x, r_y = d_x - t * e_x, d_y - t * e_y
        scale = g[n] / np.sqrt(r_x * r_x + r_y * r_y + _TINY)
        n_x, n_y = scale * r_x, scale * r_y
        g_a[0, n] += n_x
        g_a[1, n] += n_y
        g_start[0, n] -= (_ONE - t) * n_x
        g_start[1, n] -= (_ONE - t) * n_y
        g_end[0, n] -= t * n_x
        g_end[1, n] -= t * n_y


@lane_kernel
def _half_sine_back(p, start, end, g, g_p, g_start, g_end):
    """Add the gradient g (LANES,) of `_half_sine` to those of its points, (2, LANES)."""
    for n in range(LANES):
        a_x, a_y = start[0, n] - p[0, n], start[1, n] - p[1, n]
        b_x, b_y = end[0, n] - p[0, n], end[1, n] - p[1, n]
        a2, b2 = a_x * a_x + a_y * a_y + _TINY, b_x * b_x + b_y * b_y + _TINY
        product, dot = np.sqrt(a2 * b2), a_x * b_x + a_y * b_y
        share = (product + dot) / (_TWO * product)
        scale = g[n] * np.sqrt(share if share > _ZERO else _ZERO) / _TWO  # d sin(phi/2) / dphi
        a_x, a_y, b_x, b_y = (
            scale * a_y / a2,
            -scale * a_x / a2,
            -scale * b_y / b2,
            scale * b_x / b2,
        )
        g_start[0, n] += a_x
        g_start[1, n] += a_y
        g_end[0, n] += b_x
        g_end[1, n] += b_y
        g_p[0, n] -= a_x + b_x
        g_p[1, n] -= a_y + b_y


@lane_kernel
def describe_back(p, skeleton, gaps, x, g_x, g, g_p, g_skeleton):
    """Lead the gradient in the features back to the point and the skeleton.

    Args:
        p, skeleton, gaps, x: as in `describe`.
        g_x: gradient in the features, shape (F, LANES).
        g: scratch, shape (LANES,).
        g_p: output, shape (2, LANES).
        g_skeleton: output, shape (L + 1, 2, LANES).
    """
    (pairs, width), segments = gaps, skeleton.shape[0] - 1
    for n in range(LANES):
        share = g_x[2, n] / x[2, n]
        g_p[0, n], g_p[1, n] = g_x[0, n] + share * p[0, n], g_x[1, n] + share * p[1, n]
    f = 3
    for m in range(segments + 1):
        for n in range(LANES):
            g_skeleton[m, 0, n] = g_x[f, n] if m >= 2 else _ZERO
            g_skeleton[m, 1, n] = g_x[f + 1, n] if m >= 2 else _ZERO
        f += 2 if m >= 2 else 0
    for i in range(segments):
        for n in range(LANES):
            g[n] = g_x[f, n] - g_x[f + 1, n] * x[f + 1, n] * x[f + 1, n] / _NEAR
        _distance_back(p, skeleton[i], skeleton[i + 1], g, g_p, g_skeleton[i], g_skeleton[i + 1])
        _half_sine_back(
            p, skeleton[i], skeleton[i + 1], g_x[f + 2], g_p, g_skeleton[i], g_skeleton[i + 1]
        )
        f += 3
    for k in range(pairs.shape[0]):
        m, i = pairs[k, 0], pairs[k, 1]
        for n in range(LANES):
            g[n] = -g_x[f, n] * x[f, n] * x[f, n] / _NEAR
            closure = x[f + 1, n]
            g[n] -= g_x[f + 1, n] / (_TWO * width * (closure + _ROOT)) if closure > _OPEN else _ZERO
        _distance_back(
            skeleton[m],
            skeleton[i],
            skeleton[i + 1],
            g,
            g_skeleton[m],
            g_skeleton[i],
            g_skeleton[i + 1],
        )
        f += 2


@kernel
def joint_gradient(robot, base, p_x, p_y, turn, lane, skeleton, g_p, g_skeleton, out):
    """Gradient in the joints that turn, from that in the point and the skeleton.

    Turning the arm by the first of them is turning the point back; a later one turns what lies
    beyond it.

    Args:
        robot, base: as in `place_skeleton`.
        p_x, p_y: the point in the frame of the skeleton, m.
        turn: factor on every gradient.
        lane: which one.
        skeleton, g_p, g_skeleton: as in `describe_back`.
        out: output, shape (n,); entries of the base's joints stay as they are.
    """
    out[base] = turn * robot.joint_axis[base, 2] * (g_p[0, lane] * p_y - g_p[1, lane] * p_x)
    for j in range(1, skeleton.shape[0] - 1):
        x, y, total = skeleton[j, 0, lane], skeleton[j, 1, lane], 0.0
        for m in range(j + 1, skeleton.shape[0]):
            total += g_skeleton[m, 1, lane] * (skeleton[m, 0, lane] - x)
            total -= g_skeleton[m, 0, lane] * (skeleton[m, 1, lane] - y)
        out[base + j] = turn * robot.joint_axis[base + j, 2] * total

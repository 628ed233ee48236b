"""The robot distance field of many points, compiled: the least of its bodies' distances.

A distance is taken to be at least that to the body's bounding box minus `slack`, which is twice the
largest error of the fit on many points. Bodies are asked in the order of that bound, until it
exceeds the least distance.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.geometry.rdf.bernstein import shape_distance, shape_slope
from piec_envs.kernels import batch_kernel, kernel


class PackedRdf(NamedTuple):
    """Polynomials of S shapes of degree n, and the B bodies that have them."""

    weights: np.ndarray  # (S, n + 1, n + 1, n + 1) m, Bernstein coefficients
    binomials: np.ndarray  # (2, n + 1) of degree n, and n times those of degree n - 1
    centre: np.ndarray  # (S, 3) m, of the boxes
    half: np.ndarray  # (S, 3) m, half the edges of the box of the polynomial
    core: np.ndarray  # (S, 3) m, half the edges of the body's bounding box
    width: np.ndarray  # (S, 3) m, of the steep part of u
    extent: np.ndarray  # (S, 3) asinh(half / width)
    slack: np.ndarray  # (S,) m
    shape: np.ndarray  # (B,) int64, row of the above for each body
    body: np.ndarray  # (B,) int64, row of the body's frame
    joints: np.ndarray  # (B,) int64, joints before the body


class RdfScratch(NamedTuple):
    """Working memory of one thread."""

    panel: np.ndarray  # (2, (n + 1)^2) the tensor contracted along x with the basis and its slope
    rows: np.ndarray  # (3, n + 1) and along y
    basis: np.ndarray  # (3, n + 1)
    slope: np.ndarray  # (3, n + 1) d basis / du
    power: np.ndarray  # (2, n + 1)
    bound: np.ndarray  # (B,) m


@batch_kernel
def make_rdf_scratch(rdf):
    """Working memory for one thread, for a `PackedRdf`."""
    n, bodies = rdf.weights.shape[1], rdf.body.shape[0]
    return RdfScratch(
        np.empty((2, n * n)),
        np.empty((3, n)),
        np.empty((3, n)),
        np.empty((3, n)),
        np.empty((2, n)),
        np.empty(bodies),
    )


@kernel
def _to_body(frames, b, p):
    """A point in the frame of body b."""
    x, y, z = p[0] - frames[b, 0, 3], p[1] - frames[b, 1, 3], p[2] - frames[b, 2, 3]
    return (
        frames[b, 0, 0] * x + frames[b, 1, 0] * y + frames[b, 2, 0] * z,
        frames[b, 0, 1] * x + frames[b, 1, 1] * y + frames[b, 2, 1] * z,
        frames[b, 0, 2] * x + frames[b, 1, 2] * y + frames[b, 2, 2] * z,
    )


@kernel
def _box_distance(centre, half, p):
    """Signed distance from a point to a box."""
    x, y, z = (
        abs(p[0] - centre[0]) - half[0],
        abs(p[1] - centre[1]) - half[1],
        abs(p[2] - centre[2]) - half[2],
    )
    deepest = max(x, y, z)
    if deepest <= 0.0:
        return deepest
    x, y, z = max(x, 0.0), max(y, 0.0), max(z, 0.0)
    return np.sqrt(x * x + y * y + z * z)


@kernel
def _fill_bounds(rdf, frames, p, bound):
    """Lower bounds of the distances to the bodies, m."""
    for k in range(bound.shape[0]):
        s = rdf.shape[k]
        bound[k] = (
            _box_distance(rdf.centre[s], rdf.core[s], _to_body(frames, rdf.body[k], p))
            - rdf.slack[s]
        )


@kernel
def arm_distance(rdf, frames, p, scratch):
    """Distance from a point in space to the arm.

    Args:
        rdf, scratch: a `PackedRdf` and an `RdfScratch`.
        frames: poses of the bodies, shape (11, 4, 4), m.
        p: three numbers, m.

    Returns:
        The distance, m.
    """
    _fill_bounds(rdf, frames, p, scratch.bound)
    best, k = np.inf, np.argmin(scratch.bound)
    while scratch.bound[k] < best:
        scratch.bound[k] = np.inf
        best = min(
            best, shape_distance(rdf, rdf.shape[k], _to_body(frames, rdf.body[k], p), scratch)
        )
        k = np.argmin(scratch.bound)
    return best


@kernel
def arm_slope(rdf, frames, p, scratch):
    """Distance from a point in space to the arm, and its gradient in the point.

    Args:
        rdf, frames, p, scratch: as in `arm_distance`.

    Returns:
        (d, k, (n_x, n_y, n_z)): the distance, m, the row of the nearest body in `rdf.body`, and the
        gradient.
    """
    _fill_bounds(rdf, frames, p, scratch.bound)
    k = np.argmin(scratch.bound)
    best, nearest, x, y, z = np.inf, k, 0.0, 0.0, 0.0
    while scratch.bound[k] < best:
        scratch.bound[k] = np.inf
        d, g_x, g_y, g_z = shape_slope(rdf, rdf.shape[k], _to_body(frames, rdf.body[k], p), scratch)
        if d < best:
            best, nearest, x, y, z = d, k, g_x, g_y, g_z
        k = np.argmin(scratch.bound)
    turn = frames[rdf.body[nearest]]
    n_x = turn[0, 0] * x + turn[0, 1] * y + turn[0, 2] * z
    n_y = turn[1, 0] * x + turn[1, 1] * y + turn[1, 2] * z
    n_z = turn[2, 0] * x + turn[2, 1] * y + turn[2, 2] * z
    return best, nearest, (n_x, n_y, n_z)


@kernel
def joint_slope(frames, j, p, n):
    """dd/dq of joint j + 1, which turns the body about its axis under a point that stands still.

    Args:
        frames, j: poses of the bodies, shape (11, 4, 4), m, and the joint's index, from 0.
        p, n: three numbers each, the point, m, and the gradient of the distance in it.

    Returns:
        -n . (a x (p - o)), where the joint's axis has direction a and goes through o, m/rad.
    """
    b = j + 1
    x, y, z = p[0] - frames[b, 0, 3], p[1] - frames[b, 1, 3], p[2] - frames[b, 2, 3]
    a_x, a_y, a_z = frames[b, 0, 2], frames[b, 1, 2], frames[b, 2, 2]
    return -(n[0] * (a_y * z - a_z * y) + n[1] * (a_z * x - a_x * z) + n[2] * (a_x * y - a_y * x))


@batch_kernel
def answer_rdf(lo, hi, rdf, level, frames, points, out):
    """Rows lo to hi of a batch.

    Args:
        lo, hi: row range.
        rdf, level: a `PackedRdf`, and 0 for distances alone or 1 for gradients too.
        frames: poses of the bodies, shape (B, 11, 4, 4), m.
        points: shape (B, k, 3), m.
        out: d (B, k), dd_dp (B, k, 3) and dd_dq (B, k, 7), the latter two empty at level 0.
    """
    distance, in_p, in_q = out
    if hi <= lo:
        return
    scratch = make_rdf_scratch(rdf)
    for row in range(lo, hi):
        for i in range(points.shape[1]):
            p = points[row, i, 0], points[row, i, 1], points[row, i, 2]
            if level == 0:
                distance[row, i] = arm_distance(rdf, frames[row], p, scratch)
            else:
                distance[row, i], k, n = arm_slope(rdf, frames[row], p, scratch)
                in_p[row, i, 0], in_p[row, i, 1], in_p[row, i, 2] = n
                for j in range(7):
                    in_q[row, i, j] = (
                        joint_slope(frames[row], j, p, n) if j < rdf.joints[k] else 0.0
                    )

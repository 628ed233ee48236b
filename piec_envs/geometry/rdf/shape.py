"""The polynomial of one body, and the readable twin of `piec_envs.geometry.rdf.bernstein`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import comb
from typing import NamedTuple

import numpy as np

from piec_envs.world.robots.panda import BODIES, body_frames, mesh_of

MARGIN = 0.21  # m, from the body's bounding box to that of its polynomial
# width of the steep part of u: share of the body's half extent, least m
STEEP = 0.4
LEAST_WIDTH = 0.008


class Box(NamedTuple):
    """The domain of a polynomial, and its coordinate u = 1/2 + asinh((x - centre) / width) / (2
    extent).
    """

    centre: np.ndarray  # (3,) m
    half: np.ndarray  # (3,) m, half the edges
    core: np.ndarray  # (3,) m, half the edges of the body's bounding box
    width: np.ndarray  # (3,) m
    extent: np.ndarray  # (3,) asinh(half / width)

    def to_unit(self, points: np.ndarray) -> np.ndarray:
        """The coordinates u of points in the box, both (..., 3)."""
        return 0.5 + 0.5 * np.arcsinh((points - self.centre) / self.width) / self.extent

    def from_unit(self, u: np.ndarray) -> np.ndarray:
        """The points at coordinates u, both (..., 3), m."""
        return self.centre + self.width * np.sinh((2 * u - 1) * self.extent)


@dataclass(frozen=True, eq=False)
class FittedShape:
    """The polynomial of one body.

    Args:
        weights: Bernstein coefficients, shape (n + 1, n + 1, n + 1), m.
        box: where it holds.
        slack: estimate of its largest error in the box, on the safe side, m.
        error: mean absolute error within 0.2 m of the surface, "outside" and "inside", m.
    """

    weights: np.ndarray
    box: Box
    slack: float
    error: dict[str, float]


def box_around(vertices: np.ndarray) -> Box:
    """The domain of the polynomial of a body with these vertices, shape (V, 3), m."""
    low = vertices.min(axis=0)
    high = vertices.max(axis=0)
    core = (high - low) / 2
    half = core + MARGIN
    width = np.maximum(STEEP * core, LEAST_WIDTH)
    return Box((low + high) / 2, half, core, width, np.arcsinh(half / width))


def binomials(degree: int) -> np.ndarray:
    """Factors of u^i (1 - u)^(n - i), and of those of degree n - 1 times n, shape (2,
    degree + 1).
    """
    lower = [degree * comb(degree - 1, i) for i in range(degree)]
    return np.array([[comb(degree, i) for i in range(degree + 1)], [*lower, 0]], dtype=float)


def bernstein(degree: int, u: np.ndarray) -> np.ndarray:
    """Bernstein polynomials b_i = C(n, i) u^i (1 - u)^(n - i).

    Args:
        degree: n.
        u: where, in [0, 1], any shape (...,).

    Returns:
        Shape (..., degree + 1).
    """
    i = np.arange(degree + 1)
    u = np.asarray(u, dtype=float)[..., None]
    return binomials(degree)[0] * u**i * (1 - u) ** (degree - i)


def bernstein_slope(degree: int, u: np.ndarray) -> np.ndarray:
    """Derivatives of the Bernstein polynomials, n (b_(i-1) - b_i) of degree n - 1.

    Args:
        degree: n.
        u: where, in [0, 1], any shape (...,).

    Returns:
        Shape (..., degree + 1).
    """
    lower = np.pad(bernstein(degree - 1, u), [(0, 0)] * np.ndim(u) + [(1, 1)])
    return -degree * np.diff(lower, axis=-1)


def contract(weights: np.ndarray, factors: Sequence[np.ndarray]) -> np.ndarray:
    """Sum of weights[i, j, k] x[b, i] y[b, j] z[b, k] over i, j and k.

    Args:
        weights: shape (n + 1, n + 1, n + 1).
        factors: x, y and z, each of shape (B, n + 1).

    Returns:
        Shape (B,), in the unit of the weights.
    """
    x, y, z = factors
    # (B, n + 1, n + 1)
    panel = (x @ weights.reshape(len(weights), -1)).reshape(-1, *weights.shape[1:])
    return (np.einsum("bj,bjk->bk", y, panel) * z).sum(axis=1)


def evaluate(weights: np.ndarray, box: Box, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Distance of points in the frame of a body, and its gradient in them.

    Args:
        weights: Bernstein coefficients, shape (n + 1, n + 1, n + 1), m.
        box: their domain.
        points: shape (B, 3), m.

    Returns:
        (d, dd_dp), shapes (B,) and (B, 3): the polynomial at the nearest point of the box plus the
        way there.
    """
    inner = np.clip(points, box.centre - box.half, box.centre + box.half)
    degree = len(weights) - 1
    way = points - inner  # (B, 3)
    beyond = np.linalg.norm(way, axis=1)  # (B,)
    u = box.to_unit(inner)
    du_dx = 0.5 / (box.extent * np.hypot(inner - box.centre, box.width))  # (B, 3)
    basis, slope = (
        [f(degree, u[:, axis]) for axis in range(3)] for f in (bernstein, bernstein_slope)
    )
    value = contract(weights, basis)
    rise = [
        contract(weights, [*basis[:axis], slope[axis], *basis[axis + 1 :]]) for axis in range(3)
    ]
    out = way / np.maximum(beyond, 1e-300)[:, None]
    return value + beyond, np.where(way == 0, np.stack(rise, axis=-1) * du_dx, out)


def arm_reference(
    shapes: Mapping[str, FittedShape], bodies: Sequence[str], points: np.ndarray, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Distance of points in space to the arm in one posture: the least over all bodies, and its
    gradients.

    Args:
        shapes: by the names of the bodies' meshes.
        bodies: rows of `BODIES`.
        points: shape (k, 3), m.
        q: the seven joints, shape (7,), rad.

    Returns:
        (d, dd_dp, dd_dq), shapes (k,), (k, 3) and (k, 7), m and rad.
    """
    frames = body_frames(q)
    found = []
    for body in bodies:
        pose = frames[BODIES.index(body)]
        shape = shapes[mesh_of(body)]
        d, local = evaluate(shape.weights, shape.box, (points - pose[:3, 3]) @ pose[:3, :3])
        n = local @ pose[:3, :3].T  # (k, 3)
        turn = np.zeros((len(points), 7))
        # the body turns about the joint's axis, under the point
        for j in range(min(BODIES.index(body), 7)):
            axis = frames[j + 1, :3, 2]
            origin = frames[j + 1, :3, 3]
            turn[:, j] = -(n * np.cross(axis, points - origin)).sum(axis=1)
        found.append((d, n, turn))
    d, n, turn = (np.stack(arrays) for arrays in zip(*found, strict=True))
    nearest = d.argmin(axis=0)
    rows = np.arange(len(points))
    return d[nearest, rows], n[nearest, rows], turn[nearest, rows]

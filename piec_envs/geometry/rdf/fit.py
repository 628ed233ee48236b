"""Fit the robot distance field: one Bernstein polynomial per body, in closed form (Li et al. 2024).

The samples stand on a grid, Chebyshev points along each axis of the box, so that the least squares
problem in (n + 1)^3 coefficients falls apart into three in n + 1: W = P_x P_y P_z D, each P the
regularised pseudo-inverse of the basis at the points of one axis.
"""

from __future__ import annotations

import numpy as np

from piec_envs.geometry.convex import Hull, convex_hull, hull_distances
from piec_envs.geometry.rdf.shape import (
    LEAST_WIDTH,
    MARGIN,
    STEEP,
    Box,
    FittedShape,
    bernstein,
    box_around,
    contract,
)
from piec_envs.parallel import run_rows

DENSITY = 1.7  # samples per coefficient and axis
# of the largest singular value: keeps the coefficients below 1e9 m, in which 1e-7 m is left
RIDGE = 1e-5
TESTS = 10_000  # points on which the error is measured
SAFETY = 2.0  # slack over the largest error measured
SHELL = 0.2  # m from the surface, where the error is stated
RECIPE = {
    "margin": MARGIN,
    "steep": STEEP,
    "least_width": LEAST_WIDTH,
    "density": DENSITY,
    "ridge": RIDGE,
    "tests": TESTS,
    "safety": SAFETY,
    "shell": SHELL,
}


def exact_distance(hull: Hull, points: np.ndarray, threads: int | None = None) -> np.ndarray:
    """Signed distance of points to a convex body, negative inside.

    Args:
        hull: its surface.
        points: shape (..., 3), m.
        threads: over the points; None takes all cores.

    Returns:
        Shape (...,), m.
    """
    rows = np.ascontiguousarray(points, dtype=float).reshape(-1, 3)
    out = np.empty(len(rows))
    run_rows(hull_distances, len(rows), threads, hull, rows, out)
    return out.reshape(np.shape(points)[:-1])


def fit_shape(vertices: np.ndarray, degree: int, threads: int | None = None) -> FittedShape:
    """Fit the polynomial of a convex body.

    Args:
        vertices: of which it is the hull, shape (V, 3), m.
        degree: n.
        threads: None takes all cores.

    Returns:
        The polynomial, by W = P_x P_y P_z D of this module's docstring, and its errors on points
        drawn at random.

    Raises:
        InvalidShapeError: if they do not span a volume.
    """
    hull = convex_hull(vertices)
    box = box_around(vertices)
    count = round(DENSITY * (degree + 1))
    u = (1 - np.cos((np.arange(count) + 0.5) * np.pi / count)) / 2  # (m,)
    grid = np.stack(np.meshgrid(u, u, u, indexing="ij"), axis=-1)  # (m, m, m, 3)
    left, sizes, right = np.linalg.svd(bernstein(degree, u), full_matrices=False)
    inverse = (right.T * (sizes / (sizes**2 + (RIDGE * sizes[0]) ** 2))) @ left.T  # (n + 1, m)
    weights = exact_distance(hull, box.from_unit(grid), threads)
    for _ in range(3):  # contract the first axis, and turn the next one to the front
        weights = np.tensordot(weights, inverse, axes=(0, 1))
    return FittedShape(np.ascontiguousarray(weights), box, *_errors(hull, box, weights, threads))


def spread_points(box: Box, count: int, rng: np.random.Generator) -> np.ndarray:
    """Random points in a box, the second half of them in the body's bounding box.

    Args:
        box: the domain of a polynomial.
        count: how many points.
        rng: source of randomness.

    Returns:
        Shape (count, 3), m.
    """
    half = np.repeat([box.half, box.core], [count - count // 2, count // 2], axis=0)
    return box.centre + rng.uniform(-1, 1, (count, 3)) * half


def _errors(
    hull: Hull, box: Box, weights: np.ndarray, threads: int | None
) -> tuple[float, dict[str, float]]:
    """Slack, m, and mean errors of a fit, m."""
    points = spread_points(box, TESTS, np.random.default_rng(0))
    true = exact_distance(hull, points, threads)
    x, y, z = bernstein(len(weights) - 1, box.to_unit(points).T)
    error = np.abs(contract(weights, (x, y, z)) - true)
    shell = {"outside": (true > 0) & (true <= SHELL), "inside": true <= 0}
    return SAFETY * float(error.max()), {
        side: float(error[rows].mean()) for side, rows in shell.items()
    }

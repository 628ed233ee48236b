"""Distances of convex polygons with few and many corners, against all pairs of corners and
edges.
"""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.geometry.polygon import closest_on_polygon, core_distance

CORNERS = (3, 4, 5, 7, 11, 16, 22)  # a mesh's cross-section has up to 22


def polygon(corners, rng):
    """A convex polygon, counterclockwise: corners of an ellipse at uneven angles, turned."""
    angle = 2 * np.pi * (np.arange(corners) + rng.uniform(-0.4, 0.4, corners)) / corners
    a = rng.uniform(0, 2 * np.pi)
    turn = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    return np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(0.03, 0.2, 2) @ turn


def to_edges(points, corners):
    """Distance of each point to each edge, shape (P, E), and how far it is beyond the
    edge's line.
    """
    edge = np.roll(corners, -1, axis=0) - corners
    rest = points[:, None] - corners
    t = np.clip((rest * edge).sum(-1) / (edge**2).sum(-1), 0, 1)
    normal = np.column_stack([edge[:, 1], -edge[:, 0]]) / np.linalg.norm(
        edge, axis=1, keepdims=True
    )
    return np.linalg.norm(rest - t[..., None] * edge, axis=-1), (rest * normal).sum(-1)


def plain_distance(a, b):
    """The distance of two polygons; where they overlap, minus the least translation that parts
    them.
    """
    (near_a, beyond_a) = to_edges(b, a)
    (near_b, beyond_b) = to_edges(a, b)
    gap = max(beyond_a.min(axis=0).max(), beyond_b.min(axis=0).max())
    return gap if gap < 0 else min(near_a.min(), near_b.min())


@pytest.mark.parametrize("m", CORNERS)
@pytest.mark.parametrize("n", CORNERS)
def test_two_polygons(m, n):
    rng = np.random.default_rng(100 * m + n)
    apart = 0
    for _ in range(60):
        a = polygon(m, rng)
        b = polygon(n, rng) + rng.uniform(-0.3, 0.3, 2)
        distance, *normal = core_distance(a, 0, m, b, 0, n)
        assert distance == pytest.approx(plain_distance(a, b), abs=1e-12)
        assert np.hypot(*normal) == pytest.approx(1)
        # moved by the distance against the normal they just touch
        touching = b - distance * np.array(normal)
        assert plain_distance(a, touching) == pytest.approx(0, abs=1e-9)
        back, *other = core_distance(b, 0, n, a, 0, m)
        assert back == pytest.approx(distance, abs=1e-12)
        np.testing.assert_allclose(other, np.negative(normal), atol=1e-6)
        apart += distance > 0
    assert 5 < apart < 55


@pytest.mark.parametrize("n", CORNERS)
def test_a_point_and_a_polygon_among_others(n):
    rng = np.random.default_rng(n)
    a = polygon(n, rng)
    rows = np.vstack([polygon(5, rng), a, polygon(3, rng)])  # the polygon owns the rows between
    points = rng.uniform(-0.15, 0.15, (400, 2))
    near, beyond = to_edges(points, a)
    true = np.where(beyond.max(axis=1) < 0, beyond.max(axis=1), near.min(axis=1))
    assert 10 < (true < 0).sum() < 390
    for point, expected in zip(points, true, strict=True):
        distance, c_x, c_y, n_x, n_y, corner = closest_on_polygon(rows, 5, 5 + n, *point)
        assert distance == pytest.approx(expected, abs=1e-12)
        np.testing.assert_allclose([c_x + distance * n_x, c_y + distance * n_y], point, atol=1e-12)
        assert to_edges(np.array([[c_x, c_y]]), a)[0].min() < 1e-9
        assert corner == -1 or np.hypot(*(rows[corner] - [c_x, c_y])) < 1e-12

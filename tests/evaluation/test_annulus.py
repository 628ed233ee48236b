"""The exact escape times around and through the square annulus, by hand and by brute force."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from evaluation.studies.annulus import Annulus
from piec_envs.geometry.body import point_distance
from piec_envs.world.packed import pack_shapes

UPRIGHT = Annulus(centre=(0.5, 0.0), angle=0.0, outer=0.2, inner=0.1)


def disc_points(count: int) -> np.ndarray:
    rng = np.random.default_rng(0)
    r = np.sqrt(rng.uniform(size=count))
    angle = rng.uniform(0, 2 * np.pi, count)
    return np.column_stack([r * np.cos(angle), r * np.sin(angle)])


def test_the_walls_fill_the_ring():
    annulus = Annulus()
    points = disc_points(3000)
    walls = pack_shapes([(shape, 0, 0) for shape in annulus.walls])
    d = np.array([point_distance(walls, walls.vertices, x, y)[0] for x, y in points])
    ring = (annulus.depth(points, annulus.outer) > 0) & (annulus.depth(points, annulus.inner) < 0)
    assert ((d < 0) == ring).all() and ring.any()
    assert np.abs(annulus.depth(annulus.outline(annulus.inner, 40), annulus.inner)).max() < 1e-12


def test_paths_by_hand():
    points = np.array([(0.2, 0.0), (0.2, 0.1), (-0.4, 0.3), (0.9, 0.0), (0.3, -0.2)])
    corner = 1 - np.hypot(0.3, 0.2)  # from (0.3, +-0.2) straight out
    expected = [np.hypot(0.1, 0.2) + corner, np.hypot(0.1, 0.1) + corner, 0.5, 0.1, corner]
    np.testing.assert_allclose(UPRIGHT.exit_distance(points), expected, rtol=1e-12)


def test_from_the_centre_of_the_cavity_the_way_is_straight():
    assert UPRIGHT.leaky_time(np.array([0.5, 0.0]), 0.05) == pytest.approx(
        0.4 + 0.1 / 0.05, rel=1e-9
    )
    assert UPRIGHT.leaky_time(np.array([0.5, 0.0]), 0.0) == np.inf


@pytest.mark.parametrize("leak", [0.05, 0.3])
def test_refraction_obeys_snells_law_on_a_flat_wall(leak):
    """Through one wall alone: minimise over where the path enters and leaves it, by another
    method.
    """
    from scipy.optimize import minimize

    annulus = Annulus(angle=0.0)
    star = np.array([0.58, 0.1])
    x_in, x_out = (annulus.centre[0] + half for half in (annulus.inner, annulus.outer))

    def total(y):
        free = np.hypot(x_in - star[0], y[0] - star[1]) + 1 - np.hypot(x_out, y[1])
        return free + np.hypot(x_out - x_in, y[1] - y[0]) / leak

    best = minimize(total, [0.1, 0.1], tol=1e-14)
    assert annulus.leaky_time(star, leak) == pytest.approx(best.fun, rel=1e-7)


def test_no_detour_over_random_points_is_shorter():
    """Dijkstra over random points and the corners, joined wherever they see each other."""
    annulus = Annulus()
    points = np.concatenate([disc_points(150), 0.4 * disc_points(150)])
    points = points[annulus.depth(points, annulus.outer) < -1e-6]
    nodes = np.concatenate([points, annulus.outline(annulus.outer)])
    i, j = np.triu_indices(len(nodes), 1)
    seen = ~annulus.blocks(nodes[i], nodes[j])
    length = np.linalg.norm(nodes[i] - nodes[j], axis=1)
    outward = nodes / np.hypot(*nodes.T)[:, None]
    free = ~annulus.blocks(nodes, outward)
    n = len(nodes)
    rows = np.concatenate([i[seen], np.flatnonzero(free)])
    columns = np.concatenate([j[seen], np.full(free.sum(), n)])
    cost = np.concatenate([length[seen], 1 - np.hypot(*nodes[free].T)])
    graph = coo_matrix((cost, (rows, columns)), shape=(n + 1, n + 1)).tocsr()
    T = dijkstra(graph, directed=False, indices=n)[: len(points)]
    np.testing.assert_allclose(annulus.exit_distance(points), T, rtol=1e-12)
    assert (~free).sum() > 3

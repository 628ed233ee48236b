"""The exact distance to a convex body: a box, a ball of many faces, and MuJoCo."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest

from piec_envs.errors import InvalidShapeError
from piec_envs.geometry.convex import convex_hull
from piec_envs.geometry.rdf.fit import exact_distance

HALF = np.array([0.1, 0.2, 0.05])
CORNERS = HALF * np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1]), axis=-1).reshape(-1, 3)


def points_around(half, count=2000, seed=0):
    return np.random.default_rng(seed).uniform(-2, 2, (count, 3)) * half


def test_a_box_has_the_distance_of_a_box():
    points = points_around(HALF)
    excess = np.abs(points) - HALF
    true = np.linalg.norm(np.maximum(excess, 0), axis=1) + np.minimum(excess.max(axis=1), 0)
    np.testing.assert_allclose(exact_distance(convex_hull(CORNERS), points), true, atol=1e-12)


def test_a_ball_of_many_faces_is_nearly_a_ball():
    rng = np.random.default_rng(0)
    ball = rng.standard_normal((3000, 3))
    ball *= 0.3 / np.linalg.norm(ball, axis=1, keepdims=True)
    points = points_around(np.full(3, 0.3))
    error = exact_distance(convex_hull(ball), points) - (np.linalg.norm(points, axis=1) - 0.3)
    assert (error > -1e-12).all() and error.max() < 4e-3


def test_faces_look_outward():
    hull = convex_hull(np.random.default_rng(1).standard_normal((60, 3)))
    edges = hull.corners[:, 1:] - hull.corners[:, :1]
    turn = np.cross(edges[:, 0], edges[:, 1])
    turn /= np.linalg.norm(turn, axis=1, keepdims=True)
    np.testing.assert_allclose(turn, hull.normals, atol=1e-9)
    assert (
        ((hull.corners[:, 0] - hull.corners.mean(axis=(0, 1))) * hull.normals).sum(axis=1) > 0
    ).all()


def test_outside_it_is_the_distance_of_mujoco():
    vertices = np.random.default_rng(2).standard_normal((40, 3)) * HALF
    spec = mujoco.MjSpec()
    spec.add_mesh(name="body", uservert=vertices.ravel())
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_MESH, meshname="body")
    ball = spec.worldbody.add_body(name="ball", mocap=True)
    ball.add_geom(type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[1e-3, 0, 0])
    model = spec.compile()
    data = mujoco.MjData(model)
    points = points_around(4 * HALF, 100)
    distance = exact_distance(convex_hull(vertices), points)
    for point, d in zip(points[distance > 0.01], distance[distance > 0.01], strict=True):
        data.mocap_pos[0] = point
        mujoco.mj_forward(model, data)
        assert mujoco.mj_geomDistance(model, data, 0, 1, 10.0, None) + 1e-3 == pytest.approx(
            d, abs=1e-5
        )


def test_flat_vertices_are_refused():
    with pytest.raises(InvalidShapeError, match="span no volume"):
        convex_hull(CORNERS * [1, 1, 0])

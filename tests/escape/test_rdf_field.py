"""The escape field around the bodies in space: beside that of the polygons, and against
differences.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.escape import GridField, SpeedModel, make_field
from piec_envs.escape.samples import draw_configurations, draw_points, robot_distance
from piec_envs.geometry.rdf import panda_distance_field
from piec_envs.world.robots import get_robot
from piec_envs.world.robots.franka import PLANE, all_joints

CURLED = np.array([0.3, -2.2, 1.2])


@pytest.fixture(scope="module")
def field():
    return GridField("franka", 64, "marching", distance="rdf")


@pytest.fixture(scope="module")
def sample():
    rng = np.random.default_rng(0)
    q = draw_configurations("franka", "curled", 8, rng)
    return draw_points("franka", "curled", q, 30, rng), q


def in_plane(points):
    return np.concatenate([points, np.full((*points.shape[:-1], 1), PLANE)], axis=-1)


def test_the_bodies_in_the_plane_are_no_larger_than_their_shadows(sample):
    points, q = sample
    spatial = panda_distance_field().distance(in_plane(points), all_joints(q))
    difference = spatial - robot_distance("franka", points, q)
    assert difference.min() > -5e-3 and 0.0 < np.median(difference) < 0.02


def test_the_map_holds_the_distance_of_the_field_in_space(field):
    drawn = field.solve(CURLED)
    x, y = np.meshgrid(drawn.x, drawn.y)
    inside = np.hypot(x, y) < get_robot("franka").workspace_radius
    points = np.stack([x[inside], y[inside]], axis=-1)
    d = panda_distance_field().distance(in_plane(points), all_joints(CURLED))
    # beside the wall a node may stand for the middle of a passage
    clear = np.abs(d - field.speed.d0) > 0.05
    np.testing.assert_allclose(drawn.speed[inside][clear], field.speed.speed(d[clear]), rtol=1e-9)


def test_times_agree_with_those_of_the_polygons_where_distances_do(field, sample):
    points, q = sample
    polygons = GridField("franka", 64, "marching")
    time = field.query(points, q)
    true = polygons.query(points, q)
    assert np.quantile(np.abs(time / true - 1), 0.9) < 0.02
    assert (time < 1.05 * true).all()
    radius = get_robot("franka").workspace_radius
    straight = np.maximum(radius - np.hypot(*np.moveaxis(points, -1, 0)), 0) / field.u_bar
    assert (time >= straight - 1e-9).all()


def test_a_finer_grid_changes_little(field, sample):
    points = sample[0][:4]
    q = sample[1][:4]
    fine = GridField("franka", 160, "marching", distance="rdf").query(points, q)
    error = np.abs(field.query(points, q) - fine) / fine
    assert np.median(error) < 0.01 and np.quantile(error, 0.9) < 0.03


def test_gradients_match_differences(sample):
    points = sample[0][:4]
    q = sample[1][:4]
    field = GridField("franka", 160, "marching", distance="rdf")
    h = 1e-3
    hard = GridField("franka", 160, "marching", SpeedModel(leak=0.0), distance="rdf")
    time, dT_dp, dT_dq = field.gradients(points, q)
    assert (time == field.query(points, q)).all() and (
        dT_dp == field.point_gradients(points, q)[1]
    ).all()
    for found, steps in ((dT_dp, np.eye(2)), (dT_dq, np.eye(3))):
        pairs = [
            (field.query(points + h * s, q), field.query(points - h * s, q))
            if len(s) == 2
            else (field.query(points, q + h * s), field.query(points, q - h * s))
            for s in steps
        ]
        difference = np.stack([(a - b) / (2 * h) for a, b in pairs], axis=-1)
        length = np.linalg.norm(difference, axis=-1)
        felt = np.isfinite(hard.query(points, q)) & (length > 0.5)
        cosine = (found * difference).sum(axis=-1) / (
            np.linalg.norm(found, axis=-1) * np.maximum(length, 1e-9)
        )
        ratio = np.linalg.norm(found, axis=-1)[felt] / length[felt]
        assert felt.sum() > 20
        assert np.median(cosine[felt]) > 0.999 and np.quantile(cosine[felt], 0.1) > 0.98
        assert 0.9 < np.median(ratio) < 1.1


def test_a_path_leads_out_and_its_times_fall(field, sample):
    start = sample[0][0, 0]
    path = field.escape_path(start, sample[1][0])
    T = field.query(path, sample[1][0])
    assert (path[0] == start).all() and (np.diff(T) < 0).all()
    assert np.hypot(*path[-1]) == pytest.approx(get_robot("franka").workspace_radius)


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_are_those_of_single_queries_bit_for_bit(field, sample, threads):
    points, q = sample
    batch = GridField("franka", 64, "marching", threads=threads, distance="rdf").gradients(
        points, q
    )
    for row in (0, 5):
        for a, b in zip(batch, field.gradients(points[row], q[row]), strict=True):
            assert (a[row] == b).all()


def test_the_table_makes_it_and_its_spec_remakes_it(sample):
    made = make_field("grid", "franka", distance="rdf")
    again = make_field(**json.loads(json.dumps(made.spec())))
    assert made.spec()["distance"] == again.spec()["distance"] == "rdf"
    assert make_field("grid", "franka").spec()["distance"] == "polygons"
    assert (made.query(*sample) == again.query(*sample)).all()


def test_other_robots_and_distances_are_refused():
    for robot in ("planar_arm", "franka_capsules"):
        with pytest.raises(InvalidParameterError, match=f"{robot}.*is for: franka"):
            make_field("grid", robot, distance="rdf")
    with pytest.raises(UnknownNameError, match="polygons, rdf"):
        make_field("grid", "franka", distance="meshes")

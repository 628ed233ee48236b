"""The table of fields, key points and the escape time of an object."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from piec_envs import enclosed_points
from piec_envs.errors import InvalidParameterError, InvalidStateError, UnknownNameError
from piec_envs.escape import (
    CAGING_SCALE,
    FIELDS,
    SpeedModel,
    key_points_world,
    make_field,
    object_escape_time,
)
from piec_envs.world.objects import OBJECTS
from piec_envs.world.robots import get_robot

Q = np.array([0.3, 0.9, 1.1, 0.7])
COARSE = {"table": {"robot_name": "franka_capsules", "resolution": 33, "spacing": 0.3}}


@pytest.fixture(params=FIELDS)
def field(request):
    """Every row of the table, for a robot that it serves."""
    return make_field(request.param, **COARSE.get(request.param, {"robot_name": "planar_arm"}))


def posture(field, bend):
    """A configuration with every joint but the first bent from straight, in the direction that its
    limits allow.
    """
    robot = get_robot(field.robot_name)
    q = robot.straight + bend * robot.curl_sides(0.6)[-1] * (np.arange(robot.dof) > 0)
    q[0] = 0.3
    return q


def test_a_field_is_remade_from_its_spec(field):
    again = make_field(**json.loads(json.dumps(field.spec())))
    points = np.array([[0.4, 0.3], [-0.5, 0.8]])
    q = posture(field, 0.9)
    assert again.spec() == field.spec() and again.name == field.name in FIELDS
    assert (again.query(points, q) == field.query(points, q)).all()


# the straight arm reaches the circle
@pytest.mark.parametrize("bend", [0.9, 0.0], ids=["curled", "straight"])
def test_a_point_on_or_outside_the_disc_has_escaped(field, bend):
    q = posture(field, bend)
    radius = get_robot(field.robot_name).workspace_radius
    angle = np.linspace(0, 2 * np.pi, 12)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([radius * (1 + 1e-12) * ring, 1.03 * radius * ring, 100 * ring])
    T, dT_dp, dT_dq = field.gradients(points, q)
    assert (T == 0).all() and (dT_dp == 0).all() and (dT_dq == 0).all()
    assert (field.query(points, q) == 0).all() and (field.query(0.99 * radius * ring, q) > 0).all()
    assert (field.escape_path(points[-1], q) == points[-1:]).all()
    drawn = field.solve(q)
    outside = np.hypot(*np.meshgrid(drawn.x, drawn.y)) >= radius
    assert outside.any() and (drawn.T[outside] == 0).all()


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_what_is_not_finite_is_refused(field, bad):
    q = posture(field, 0.9)
    broken = np.where(np.arange(len(q)) == 1, bad, q)
    for points, row in ((np.array([[bad, 0.0]]), q), (np.zeros((1, 2)), broken)):
        for ask in (field.query, field.point_gradients, field.gradients):
            with pytest.raises(InvalidStateError, match="finite"):
                ask(points, row)
    with pytest.raises(InvalidStateError, match="finite"):
        field.escape_path(np.array([bad, 0.0]), q)
    with pytest.raises(InvalidStateError, match="finite"):
        field.solve(broken)


def test_equal_arguments_give_the_same_instance():
    assert make_field("grid", resolution=64) is make_field("grid", resolution=64)
    assert make_field("grid", speed={"leak": 0.1}) is make_field("grid", speed=SpeedModel(leak=0.1))


def test_unknown_names_and_options_are_refused():
    with pytest.raises(UnknownNameError, match="grid"):
        make_field("gird")
    with pytest.raises(InvalidParameterError, match="colour"):
        make_field("grid", colour="red")
    with pytest.raises(UnknownNameError, match="mean"):
        object_escape_time(make_field("grid"), np.zeros((1, 2)), np.zeros(3), Q, reduce="median")


@given(arrays(float, (4, 3), elements=st.floats(-3, 3)))
def test_key_points_are_those_of_the_rigid_motion_in_every_batch_size(pose):
    key_points = OBJECTS["three_discs"].key_points
    world = key_points_world(key_points, pose)
    assert world.shape == (4, 3, 2)
    for row, (x, y, theta) in zip(world, pose, strict=True):
        turn = np.array([[np.cos(theta), -np.sin(theta)], [np.sin(theta), np.cos(theta)]])
        np.testing.assert_allclose(row, key_points @ turn.T + [x, y], atol=1e-12)
    assert (world == np.stack([key_points_world(key_points, p) for p in pose])).all()
    assert (world.reshape(2, 2, 3, 2) == key_points_world(key_points, pose.reshape(2, 2, 3))).all()


def test_object_time_is_the_mean_or_the_larger_maximum_of_its_key_points():
    field = make_field("grid")
    key_points = OBJECTS["three_discs"].key_points
    pose = np.array([[0.3, 0.5, 0.2], [-0.4, 0.4, 1.0]])
    q = np.stack([Q, -Q])
    times = field.query(key_points_world(key_points, pose), q)  # (2, 3)
    mean, most = (
        object_escape_time(field, key_points, pose, q, reduce) for reduce in ("mean", "max")
    )
    assert (mean == times.mean(1)).all() and (most == times.max(1)).all() and (mean <= most).all()
    assert object_escape_time(field, key_points, pose[0], Q) == mean[0]
    assert 0 < CAGING_SCALE * mean[0] < 1


def test_enclosed_points_are_those_that_a_hard_wall_lets_out_nowhere():
    curled = np.array([0.4, 1.5, 1.4, 1.5])
    points = np.array([[-0.15, 0.35], [-0.5, -0.5]])  # within the curl, and far from it
    q = np.stack([curled, np.zeros(4)])
    held = enclosed_points("planar_arm", np.stack([points, points]), q)
    assert held.tolist() == [[True, False], [False, False]]
    assert enclosed_points("planar_arm", points, curled).tolist() == [True, False]
    with pytest.raises(InvalidStateError, match="finite"):
        enclosed_points("planar_arm", np.array([[np.nan, 0.0]]), curled)

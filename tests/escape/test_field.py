"""The table of fields, key points and the escape time of an object."""

import json

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.escape import CAGING_SCALE, FIELDS, SpeedModel, key_points_world, make_field, object_escape_time
from piec_envs.world.objects import OBJECTS

Q = np.array([0.3, 0.9, 1.1, 0.7])


@pytest.mark.parametrize("name", FIELDS)
def test_a_field_is_remade_from_its_spec(name):
    field = make_field(name, "planar_arm")
    again = make_field(**json.loads(json.dumps(field.spec())))
    points = np.array([[0.4, 0.3], [-0.5, 0.8]])
    assert field.name == name
    assert (again.query(points, Q) == field.query(points, Q)).all()


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
    field, key_points = make_field("grid"), OBJECTS["three_discs"].key_points
    pose = np.array([[0.3, 0.5, 0.2], [-0.4, 0.4, 1.0]])
    q = np.stack([Q, -Q])
    times = field.query(key_points_world(key_points, pose), q)  # (2, 3)
    mean, most = (object_escape_time(field, key_points, pose, q, reduce) for reduce in ("mean", "max"))
    assert (mean == times.mean(1)).all() and (most == times.max(1)).all() and (mean <= most).all()
    assert object_escape_time(field, key_points, pose[0], Q) == mean[0]
    assert 0 < CAGING_SCALE * mean[0] < 1

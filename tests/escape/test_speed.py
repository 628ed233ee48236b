"""Laws of the speed model and its kernels."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.samples import draw_configurations, robot_distance
from piec_envs.escape.speed import SpeedModel, cost_map, decay, slowness, slowness_slope
from piec_envs.geometry.body import point_distance
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.world.packed import pack_robot

distances = st.floats(-0.5, 3.0)


def test_speed_has_the_values_of_the_design():
    speed = SpeedModel().speed([0.0, 0.03, 0.03 + 1e-9, 0.1, 2.0])
    np.testing.assert_allclose(speed / 0.05, [0.05, 0.05, 0.3169, 0.882, 1.0], rtol=1e-3)


@given(st.floats(-20, 20))
def test_decay_is_the_exponential(z):
    assert decay(z) == pytest.approx(np.exp(z), rel=1e-12)


@given(
    distances,
    st.sampled_from(
        [SpeedModel(), SpeedModel(leak=0.3), SpeedModel(floor=0.5, s=150.0), SpeedModel(s=0.0)]
    ),
)
def test_slowness_kernel_equals_the_reference(d, model):
    assert slowness(model.packed(), d) == pytest.approx(1 / model.speed(d), rel=1e-11)


@given(st.floats(0.031, 1.0), st.sampled_from([SpeedModel(), SpeedModel(tau=0.1, s=20.0)]))
def test_slope_equals_a_central_difference(d, model):
    step = 1e-6
    difference = (1 / model.speed(d + step) - 1 / model.speed(d - step)) / (2 * step)
    assert slowness_slope(model.packed(), d) == pytest.approx(difference, rel=1e-4, abs=1e-5)


def test_hard_wall_has_infinite_slowness():
    packed = SpeedModel(leak=0).packed()
    assert slowness(packed, 0.03) == np.inf
    assert slowness(packed, 0.0301) < np.inf
    assert slowness_slope(packed, 0.02) == 0


def test_cost_map_equals_the_scalar_kernel_bit_for_bit():
    packed = SpeedModel().packed()
    d = np.random.default_rng(0).uniform(-0.1, 1.5, 1001)
    out = np.empty_like(d)
    cost_map(packed, d, 0.5, out)
    assert (out == [0.5 * slowness(packed, x) for x in d]).all()


def test_distance_map_equals_point_distance():
    rng = np.random.default_rng(0)
    robot = pack_robot("planar_arm")
    points = rng.uniform(-1.5, 1.5, (200, 2))
    for q in draw_configurations("planar_arm", "uniform", 3, rng):
        frames = np.empty((5, 4))
        vertices = np.empty_like(robot.shapes.vertices)
        link_frames(robot, q, frames)
        place_shapes(robot.shapes, frames, vertices, np.empty_like(robot.shapes.centre))
        expected = [point_distance(robot.shapes, vertices, x, y)[0] for x, y in points]
        np.testing.assert_allclose(robot_distance("planar_arm", points, q), expected, atol=1e-12)


@pytest.mark.parametrize(
    "bad", [{"leak": -0.1}, {"u_bar": 0.0}, {"s": np.nan}, {"a_min": 2.0}, {"d0": np.inf}]
)
def test_numbers_out_of_range_are_refused(bad):
    with pytest.raises(InvalidParameterError, match=next(iter(bad))):
        SpeedModel(**bad)


@pytest.mark.parametrize("leak", [1.0, 1.5, -1e-3, np.inf, np.nan])
def test_a_wall_that_slows_nothing_is_none(leak):
    with pytest.raises(
        InvalidParameterError, match=r"leak must be finite and in \[0.0, 1.0\), got"
    ):
        SpeedModel(leak=leak)
    assert SpeedModel(leak=0.99).speed(0.0) == pytest.approx(0.99 * 0.05)
    assert SpeedModel(a_min=1.0, floor=1.0).a_min == 1.0  # the other shares may reach 1

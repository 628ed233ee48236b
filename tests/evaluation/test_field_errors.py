"""The relative error of escape fields as figures show it."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation.figures.fields import RelativeError, view
from piec_envs.escape.grid import GridField
from piec_envs.escape.speed import SpeedModel
from piec_envs.world.robots import get_robot

EXACT = GridField(resolution=64, threads=1)
COARSE = GridField(resolution=32, threads=1)
CURLED = np.array([[0.1, 1.15, 1.89, 1.29], [1.9, -0.81, -2.18, -0.96]])


@pytest.mark.parametrize("near", [None, 0.5])
def test_error_of_a_slower_world_is_even(near):
    slower = GridField(resolution=64, speed=SpeedModel(u_bar=0.05 / 1.02), threads=1)
    error = RelativeError.between(EXACT, slower, CURLED[0], near)
    np.testing.assert_allclose(error.percent[error.counted], 2.0, rtol=1e-6)
    assert [error.median, error.p95, error.largest] == pytest.approx([2.0, 2.0, 2.0])
    assert (error.percent[np.hypot(*np.meshgrid(error.x, error.y)) >= 1.4] == 0).all()


def test_error_counts_free_nodes_in_view():
    robot = get_robot("planar_arm")
    whole, close = (RelativeError.between(EXACT, COARSE, CURLED[0], near) for near in (None, 0.4))
    (x_min, x_max), (y_min, y_max) = view(robot, CURLED[0], 0.4)
    x, y = np.meshgrid(close.x, close.y)
    inside = (x >= x_min) & (x <= x_max) & (y >= y_min) & (y <= y_max)
    assert np.array_equal(close.counted, whole.counted & inside)
    assert (
        whole.distance[whole.counted].min() > 0.05 and 0 < close.counted.sum() < whole.counted.sum()
    )
    # free space far from the robot has no error
    assert 0 < whole.p95 < close.p95 < close.largest <= whole.largest


def test_error_leaves_out_what_is_enclosed():
    hard = GridField(resolution=64, speed=SpeedModel(leak=0.0), threads=1)
    q = np.array([-2.58, -1.32, -1.93, -1.56])
    error = RelativeError.between(hard, EXACT, q)
    enclosed = np.isinf(hard.solve(q).T) & (error.distance > 0.05)
    assert (
        enclosed.any()
        and not np.isfinite(error.percent[enclosed]).any()
        and not error.counted[enclosed].any()
    )

"""Where fields are trained, and the times along paths that they are trained towards."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from piec_envs.errors import InvalidParameterError  # noqa: E402
from piec_envs.escape import SpeedModel, make_field  # noqa: E402
from piec_envs.escape.network import NetworkField  # noqa: E402
from piec_envs.escape.samples import robot_distance  # noqa: E402
from piec_envs.escape.training import RECIPES, sampling  # noqa: E402
from piec_envs.escape.training.lookahead import Paths, even_directions  # noqa: E402
from piec_envs.escape.training.residual import ResidualLoss  # noqa: E402
from piec_envs.world.robots import get_robot  # noqa: E402

ARM = "planar_arm"
R = 1.4
U_BAR = 0.05
LITTLE = dataclasses.replace(RECIPES["pinn"], directions=4, first_directions=8, descent_steps=4)


def test_training_points_keep_their_distance(monkeypatch):
    rng = np.random.default_rng(0)
    q, points = sampling.training_set(ARM, 30, 20, rng)
    robot = get_robot(ARM)
    assert q.shape == (30, 4) and points.shape == (30, 20, 2)
    assert (q >= robot.joint_array("lower")).all() and (q <= robot.joint_array("upper")).all()
    assert (np.hypot(*points.transpose(2, 0, 1)) < R).all() and (
        robot_distance(ARM, points, q) >= 0
    ).all()
    band = robot_distance(ARM, sampling.clear_points(ARM, q, 20, rng, 0.031, 0.1), q)
    assert band.min() >= 0.031 and band.max() <= 0.1
    recipe = dataclasses.replace(RECIPES["pinn-paper"], batch=300)
    inner, rows = ResidualLoss(recipe, ARM, SpeedModel(), 0, "cpu")._points(q, rng)
    distance = robot_distance(ARM, inner[:, None], rows)
    assert len(inner) == 300 and distance.min() >= recipe.clearance
    assert np.mean(distance <= recipe.band) == pytest.approx(recipe.near_share, abs=0.03)
    monkeypatch.setattr(sampling, "MAX_DRAWS", 20)
    with pytest.raises(InvalidParameterError, match="hardly any point"):
        sampling.clear_points(ARM, q, 5, rng, 3.0)


@pytest.fixture
def paths(random_weights):
    """Look-aheads with a network that knows little."""
    return Paths(
        ARM,
        NetworkField(ARM, random_weights(rise=0.2), threads=1),
        dataclasses.replace(LITTLE, descent_steps=80),
    )


def test_lines_in_free_space_take_their_length_over_the_speed(paths):
    q = np.tile([0.0, 2.5, 2.5, 2.5], (40, 1))  # curled up near the base
    angle = np.linspace(0, 2 * np.pi, 40)
    points = np.column_stack([np.cos(angle), np.sin(angle)])  # 0.4 m from the circle
    ends, times = paths.lines(q, points, points[:, None], [0.1, 0.3, 3.0])
    expected = np.broadcast_to([0.1, 0.3, R - 1.0], times.shape)
    np.testing.assert_allclose(times, expected / U_BAR, rtol=1e-4)
    np.testing.assert_allclose(np.hypot(*ends.transpose(2, 0, 1)), 1 + expected, rtol=1e-8)
    assert (paths.field.query(ends[:, 2:], q) == 0).all()


@pytest.mark.parametrize(
    "speed", [SpeedModel(), SpeedModel(s=8.0, tau=0.2), SpeedModel(s=0.0)], ids=str
)
def test_lines_among_the_links_take_the_integral_of_the_slowness(speed, random_weights):
    paths = Paths(ARM, NetworkField(ARM, random_weights(speed=speed), threads=1), LITTLE)
    rng = np.random.default_rng(1)
    q, points = sampling.training_set(ARM, 40, 1, rng)
    directions = even_directions(rng, 40, 3)
    ends, times = paths.lines(q, points[:, 0], directions, [0.7])
    share = (np.arange(4000) + 0.5) / 4000
    along = points[:, :, None] + share[:, None] * (ends - points)[:, :, None]  # (40, 3, 4000, 2)
    distance = robot_distance(ARM, along.reshape(40, -1, 2), q).reshape(40, 3, -1)
    true = np.linalg.norm(ends - points, axis=-1) * (1 / speed.speed(distance)).mean(axis=-1)
    # where a line grazes the wall, steps of 2 mm count
    np.testing.assert_allclose(times, true, rtol=0.06)
    assert np.median(np.abs(times / true - 1)) < 0.003


def test_targets_of_paths_bound_the_time_from_above(paths):
    rng = np.random.default_rng(2)
    q, points = sampling.training_set(ARM, 60, 10, rng)
    true = make_field("grid", resolution=160, method="marching").query(points, q).ravel()
    reachable = np.isfinite(make_field("grid", speed={"leak": 0.0}).query(points, q)).ravel()
    q = np.repeat(q, 10, axis=0)
    points = points.reshape(-1, 2)
    straight = paths.straight_out(q, points, rng)
    descent = paths.descend(q, points)
    assert (
        reachable.mean() > 0.5 and np.isfinite(straight).all() and np.isfinite(descent).mean() > 0.5
    )
    for bound in (straight, descent):
        assert (bound[reachable] >= 0.98 * true[reachable]).all()
    assert np.median(straight[reachable] / true[reachable]) < 1.2

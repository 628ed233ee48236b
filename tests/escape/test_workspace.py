"""The disc of a field goes along with a base that slides, and may be larger than the reach."""

import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError
from piec_envs.escape import GridField
from piec_envs.escape.samples import draw_configurations, draw_points
from piec_envs.world.robots import get_robot

U_BAR = 0.05


@pytest.mark.parametrize("any_robot", ["sliding_arm"], indirect=True)
def test_the_disc_moves_with_the_base(any_robot):
    field = GridField(any_robot)
    fixed = GridField("planar_arm")
    rng = np.random.default_rng(0)
    q = draw_configurations("planar_arm", "curled", 4, rng)
    points = draw_points("planar_arm", "curled", q, 5, rng, 0.05)
    shift = np.array([1.3, -2.1])
    moved = np.concatenate([np.broadcast_to(shift, (4, 2)), q], axis=1)
    T, dT_dp, dT_dq = field.gradients(points + shift, moved)
    expected = fixed.gradients(points, q)
    np.testing.assert_allclose(T, expected[0], rtol=1e-9)
    np.testing.assert_allclose(dT_dq[..., 2:], expected[2], rtol=1e-6, atol=1e-6)
    assert (dT_dq[..., :2] == -dT_dp).all()
    drawn = field.solve(moved[0])
    path = field.escape_path(points[0, 0] + shift, moved[0])
    assert drawn.x.mean() == pytest.approx(1.3) and drawn.y.mean() == pytest.approx(-2.1)
    np.testing.assert_allclose(path - shift, fixed.escape_path(points[0, 0], q[0]), atol=1e-6)


def test_a_larger_workspace_adds_a_straight_way_out():
    """Beyond the arm's reach an object flees at u_bar: T grows by the added radius over u_bar, and
    T - T_0 stays.
    """
    own = get_robot("franka").workspace_radius
    # beside the arm
    points = np.array([[0.1, -0.4], [0.2, -0.3]])
    q = np.array([0.4, -1.5, 1.2])
    small, large = (  # nodes equally dense
        GridField("franka", round(160 * radius / own), "marching", radius=radius).query(points, q)
        for radius in (own, 2.0)
    )
    np.testing.assert_allclose(large - small, (2.0 - own) / U_BAR, rtol=0.01)
    assert GridField("franka").radius == own


@pytest.mark.parametrize("radius", [0.0, -1.0, float("nan"), "wide"])
def test_a_workspace_without_a_radius_is_refused(radius):
    with pytest.raises(InvalidParameterError, match="radius"):
        GridField("franka", radius=radius)

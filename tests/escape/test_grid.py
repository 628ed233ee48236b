"""Laws of the grid field: bounds, walls, batches, paths, gradients, pressing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piec_envs.errors import InvalidParameterError, InvalidStateError, UnknownNameError
from piec_envs.escape import GridField, SpeedModel
from piec_envs.escape.samples import draw_configurations, draw_points, robot_distance

R = 1.4
U_BAR = 0.05
CAGE_Q = np.array([-0.5, 1.75, 1.6, 1.6])  # the arm closes a ring around CAGE_POINT
CAGE_POINT = np.array([0.27, 0.08])
HARD = SpeedModel(leak=0.0)
METHODS = ("sweeping", "marching")
angles = st.floats(-2.6, 2.6)
configurations = st.tuples(angles, angles, angles, angles).map(np.array)


def sample(kind, rows, k, seed=0, clearance=0.05):
    rng = np.random.default_rng(seed)
    q = draw_configurations("planar_arm", kind, rows, rng)
    return draw_points("planar_arm", kind, q, k, rng, clearance), q


def bound(points):
    return np.maximum(R - np.hypot(points[..., 0], points[..., 1]), 0) / U_BAR


@pytest.fixture(scope="module", params=METHODS)
def field(request):
    return GridField(method=request.param)


@settings(max_examples=30, deadline=None)
@given(
    configurations,
    st.sampled_from(METHODS),
    st.sampled_from([0.0, 0.05, 0.99]),
    st.integers(0, 10**6),
)
def test_no_point_escapes_faster_than_in_a_straight_line(q, method, leak, seed):
    points = np.random.default_rng(seed).uniform(-1.6, 1.6, (50, 2))
    T = GridField(method=method, speed=SpeedModel(leak=leak)).query(points, q)
    assert not np.isnan(T).any()
    assert (T - bound(points) >= -1e-9).all()
    outside = np.hypot(*points.T) >= R
    assert (T[outside] == 0).all()
    assert (T[~outside] > 0).all()
    if leak > 0:
        assert np.isfinite(T).all()


def test_an_empty_direction_is_free(field):
    points = np.array([[-0.9, 0.3], [-1.2, -0.1]])
    np.testing.assert_allclose(field.query(points, np.zeros(4)), bound(points), rtol=1e-6)


@pytest.mark.parametrize("resolution", [64, 200])
@pytest.mark.parametrize("method", METHODS)
def test_a_closed_cage_is_inf_with_a_hard_wall_and_the_largest_value_with_a_leaky_one(
    method, resolution
):
    hard = GridField(method=method, resolution=resolution, speed=HARD)
    leaky = GridField(method=method, resolution=resolution)
    T_p, dT_dp, dT_dq = hard.gradients(CAGE_POINT[None], CAGE_Q)
    assert T_p[0] == np.inf
    assert (dT_dp == 0).all() and (dT_dq == 0).all()
    drawn = leaky.solve(CAGE_Q)
    enclosed = leaky.query(CAGE_POINT[None], CAGE_Q)[0]
    reachable = np.isfinite(hard.solve(CAGE_Q).T)
    assert drawn.T[reachable].max() < enclosed < np.inf
    assert hard.escape_path(CAGE_POINT, CAGE_Q).shape == (1, 2)


def test_points_in_a_hard_wall_are_inf_and_in_a_leaky_one_slow(field):
    points = np.array([[0.5, 0.0], [0.7, 0.07]])  # inside the straight arm, and 0.02 m from it
    assert (GridField(method=field.method, speed=HARD).query(points, np.zeros(4)) == np.inf).all()
    T = field.query(points, np.zeros(4))
    assert np.isfinite(T).all() and (T - bound(points) > 0).all()


def test_the_wall_of_the_leaky_field_leaves_reachable_points_alone():
    points, q = sample("curled", 20, 100)
    T = GridField(method="marching").query(points, q)
    hard = GridField(method="marching", speed=HARD).query(points, q)
    reachable = np.isfinite(hard)
    assert (np.abs(T - hard)[reachable] <= 0.01 * hard[reachable]).all()


def test_rows_equal_single_queries_bit_for_bit_with_any_number_of_threads(field):
    points, q = sample("curled", 7, 5)
    alone = [field.gradients(p, c) for p, c in zip(points, q, strict=True)]
    for threads in (1, 2, 3):
        batch = GridField(method=field.method, threads=threads).gradients(points, q)
        for together, separate in zip(batch, zip(*alone, strict=True), strict=True):
            assert (together == np.array(separate)).all()
    assert (field.query(points, q) == batch[0]).all()
    for together, expected in zip(field.point_gradients(points, q), batch, strict=False):
        assert (together == expected).all()
    assert field.query(points[:0], q[:0]).shape == (0, 5)


@settings(max_examples=20, deadline=None)
@given(configurations, st.floats(-3, 3))
def test_turning_arm_and_point_together_changes_nothing_but_grid_error(q, turn):
    points = draw_points("planar_arm", "uniform", q[None], 30, np.random.default_rng(0))[0]
    c = np.cos(turn)
    s = np.sin(turn)
    turned = q + np.array([turn, 0, 0, 0])
    rotated = points @ np.array([[c, s], [-s, c]])
    field = GridField(method="marching", resolution=100)
    a = field.query(points, q)
    b = field.query(rotated, turned)
    assert np.median(np.abs(a - b) / a) < 0.01


@settings(max_examples=20, deadline=None)
@given(
    configurations, st.sampled_from(METHODS), st.sampled_from([0.0, 0.05]), st.integers(0, 10**6)
)
def test_escape_time_falls_strictly_along_the_path_to_the_circle(q, method, leak, seed):
    field = GridField(method=method, speed=SpeedModel(leak=leak))
    point = draw_points(
        "planar_arm", "curled", q[None], 1, np.random.default_rng(seed), clearance=0.0
    )[0, 0]
    path = field.escape_path(point, q)
    assert (path[0] == point).all()
    T = field.query(path, q)
    if np.isinf(T[0]):
        assert len(path) == 1
        return
    assert (np.diff(T) < 0).all()
    assert np.hypot(*path[-1]) == pytest.approx(R, rel=1e-12)
    assert T[-1] == 0


def test_time_along_the_path_is_the_escape_time():
    points, q = sample("curled", 10, 5)
    field = GridField(method="marching", resolution=200)
    for p, c in zip(points.reshape(-1, 2), np.repeat(q, 5, axis=0), strict=True):
        path = field.escape_path(p, c)
        fine = np.concatenate(
            [np.linspace(a, b, 20, endpoint=False) for a, b in zip(path, path[1:], strict=False)]
        )
        slow = 1 / field.speed.speed(robot_distance("planar_arm", fine, c))
        length = np.repeat(np.linalg.norm(np.diff(path, axis=0), axis=1) / 20, 20)
        if slow.max() < 1 / (0.2 * U_BAR):  # not through a wall
            assert slow @ length == pytest.approx(field.query(p[None], c)[0], rel=0.02)


def test_point_gradients_have_the_norm_of_the_eikonal_equation_and_the_right_direction(field):
    points, q = sample("curled", 30, 20)
    _, dT_dp = field.point_gradients(points, q)
    norm = np.linalg.norm(dT_dp, axis=-1)
    slow = np.array(
        [
            1 / field.speed.speed(robot_distance("planar_arm", p, c))
            for p, c in zip(points, q, strict=True)
        ]
    )
    np.testing.assert_allclose(norm[norm > 0], slow[norm > 0], rtol=1e-9)
    assert (norm > 0).mean() > 0.99
    fine = GridField(method="marching", resolution=300)
    step = 1e-3 * np.eye(2)
    # (B, k, 2)
    difference = np.stack([fine.query(points + e, q) - fine.query(points - e, q) for e in step], -1)
    cosine = (difference * dT_dp).sum(-1) / np.maximum(
        np.linalg.norm(difference, axis=-1) * norm, 1e-300
    )
    assert np.median(cosine) > 0.98


def test_configuration_gradient_against_central_differences():
    points, q = sample("curled", 15, 10, seed=3)
    field = GridField(method="marching", resolution=200)
    reachable = np.isfinite(
        GridField(method="marching", resolution=200, speed=HARD).query(points, q)
    )
    dT_dq = field.gradients(points, q)[2]
    fine = GridField(method="marching", resolution=300)
    difference = (
        np.stack(
            [fine.query(points, q + e) - fine.query(points, q - e) for e in 1e-3 * np.eye(4)], -1
        )
        / 2e-3
    )
    felt = reachable & (np.linalg.norm(difference, axis=-1) > 0.5)
    a = dT_dq[felt]
    b = difference[felt]
    cosine = (a * b).sum(-1) / (np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1))
    assert np.median(cosine) > 0.99
    assert np.median(np.linalg.norm(a, axis=-1) / np.linalg.norm(b, axis=-1)) == pytest.approx(
        1, abs=0.1
    )


@pytest.mark.parametrize(
    ("method", "resolution"), [("sweeping", 64), ("marching", 64), ("sweeping", 200)]
)
def test_pressing_a_disc_on_one_link_is_no_cage(method, resolution):
    field = GridField(method=method, resolution=resolution)
    ratios = []
    for q in np.random.default_rng(0).uniform(-np.pi, np.pi, 40)[:, None] * [1, 0, 0, 0]:
        along = np.array([np.cos(q[0]), np.sin(q[0])])
        normal = np.array([-along[1], along[0]])
        points = 0.6 * along + np.outer([0.125, 0.15], normal)  # d = 0.075 and 0.1 m
        T = field.query(points, q)
        ratios.append(T[0] / T[1])
    assert max(ratios) < 1.1


def test_marching_at_200_agrees_with_560_where_the_point_is_clear():
    points, q = sample("uniform", 15, 200)
    fine = GridField(method="marching", resolution=560).query(points, q)
    error = np.abs(GridField(method="marching", resolution=200).query(points, q) - fine) / fine
    assert np.median(error) <= 2e-4
    assert np.percentile(error, 99) <= 5e-3


def test_marching_agrees_with_scikit_fmm():
    skfmm = pytest.importorskip("skfmm")
    field = GridField(method="marching", resolution=100)
    for q in draw_configurations("planar_arm", "curled", 4, np.random.default_rng(0)):
        drawn = field.solve(q)
        inside = R - np.hypot(drawn.x[None], drawn.y[:, None])
        T = np.asarray(
            skfmm.travel_time(inside, drawn.speed, dx=float(drawn.x[1] - drawn.x[0]), order=2)
        )
        kept = (inside > 0.05) & (drawn.speed > 0.4 * U_BAR)
        # of which 2e-3 is scikit-fmm's start
        assert np.median(np.abs(drawn.T - T)[kept] / T[kept]) < 3e-3


def test_solve_and_query_agree_at_the_nodes(field):
    q = np.array([0.4, 1.0, -0.8, 1.3])
    drawn = field.solve(q)
    y, x = np.meshgrid(drawn.y, drawn.x, indexing="ij")
    asked = field.query(np.stack([x, y], -1).reshape(-1, 2), q).reshape(x.shape)
    free = drawn.speed > 0.95 * U_BAR
    np.testing.assert_allclose(asked[free], drawn.T[free], rtol=1e-9, atol=1e-9)
    assert drawn.T.shape == drawn.speed.shape == (64, 64)


def test_bad_arguments_are_refused(field):
    with pytest.raises(UnknownNameError, match="sweeping"):
        GridField(method="swept")
    with pytest.raises(InvalidParameterError, match="resolution"):
        GridField(resolution=3)
    with pytest.raises(InvalidStateError, match="points must be"):
        field.query(np.zeros((2, 3)), np.zeros(4))
    with pytest.raises(InvalidStateError, match="points must be"):
        field.query(np.zeros((2, 1, 2)), np.zeros((3, 4)))
    with pytest.raises(InvalidStateError, match="finite"):
        field.query(np.array([[np.nan, 0]]), np.zeros(4))

"""The tabulated field: laws, accuracy of a coarse table, and its file."""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.cache import cache_folder
from piec_envs.errors import InvalidParameterError
from piec_envs.escape import GridField, SpeedModel
from piec_envs.escape.samples import draw_configurations, draw_points, robot_distance
from piec_envs.escape.table import TableField
from piec_envs.world.robots import get_robot

ROBOT = "franka_capsules"
TINY = {"robot_name": ROBOT, "resolution": 16, "spacing": 0.5}
R = 1.0
U_BAR = 0.05


def sample(kind, rows, k, robot_name=ROBOT, seed=0):
    """Configurations and points that are clear of the robot, around its base."""
    rng = np.random.default_rng(seed)
    q = draw_configurations(robot_name, kind, rows, rng)
    base = q[:, : get_robot(robot_name).base_dof].copy()
    q[:, : base.shape[1]] = 0.0
    points = draw_points(robot_name, kind, q, k, rng)
    q[:, : base.shape[1]] = base
    return (points + base[:, None] if base.size else points), q


@pytest.fixture(scope="module")
def field():
    return TableField(ROBOT, resolution=49, spacing=0.15)


def test_a_coarse_table_is_near_the_exact_field(field):
    points, q = sample("curled", 30, 100)
    true = GridField(ROBOT, 130, "marching").query(points, q)
    error = np.abs(field.query(points, q) - true) / true
    assert np.median(error) < 0.008 and np.mean(error) < 0.015 and np.percentile(error, 95) < 0.06


def test_a_finer_table_is_nearer(field):
    points, q = sample("curled", 30, 100)
    exact = GridField(ROBOT, 130, "marching")
    coarse = TableField(ROBOT, resolution=25, spacing=0.3)
    errors = [
        np.abs(kind.query(points, q) - exact.query(points, q)).mean() for kind in (coarse, field)
    ]
    assert errors[1] < 0.5 * errors[0]


def test_no_point_escapes_faster_than_in_a_straight_line(field):
    rng = np.random.default_rng(1)
    q = draw_configurations(ROBOT, "uniform", 50, rng)
    points = rng.uniform(-1.1, 1.1, (50, 100, 2))
    T = field.query(points, q)
    bound = (R - np.hypot(*points.transpose(2, 0, 1))) / U_BAR
    assert (
        np.isfinite(T).all()
        and (T - np.maximum(bound, 0.0) >= 0).all()
        and (T[bound > 0] > 0).all()
    )


def test_pressing_into_the_wall_does_not_pay_as_a_cage_does(field):
    """From just outside the wall to just inside T rises at about the slowness of free space there,
    1 / (0.3 u_bar).
    """
    points, q = sample("curled", 200, 20, seed=3)
    h = 1e-6 * np.eye(2)
    away = (
        np.stack(
            [
                robot_distance(ROBOT, points + e, q) - robot_distance(ROBOT, points - e, q)
                for e in h
            ],
            -1,
        )
        / 2e-6
    )
    depth = robot_distance(ROBOT, points, q)[..., None]
    outer, inner = (points + (d - depth) * away for d in (0.035, 0.015))  # (200, 20, 2)
    clear = np.abs(robot_distance(ROBOT, outer, q) - 0.035) < 1e-3  # of other links
    rise = (field.query(inner, q) - field.query(outer, q))[clear] / 0.02
    exact = GridField(ROBOT, 130, "marching")
    wall = (exact.query(inner, q) - exact.query(outer, q))[clear] / 0.02
    assert np.percentile(rise, 99) < 10 / U_BAR < 0.8 * np.median(wall)


@pytest.mark.parametrize("any_robot", [ROBOT, "sliding_capsules", "turned_capsules"], indirect=True)
def test_gradients_are_finite_differences(any_robot):
    field = TableField(any_robot, resolution=33, spacing=0.3)
    h = 1e-7
    points, q = sample("curled", 100, 2, any_robot)
    T, dT_dp, dT_dq = field.gradients(points, q)
    assert (field.query(points, q) == T).all() and (
        field.point_gradients(points, q)[1] == dT_dp
    ).all()
    for axis in range(2):
        step = h * np.eye(2)[axis]
        slope = (field.query(points + step, q) - field.query(points - step, q)) / (2 * h)
        np.testing.assert_allclose(dT_dp[..., axis], slope, atol=1e-4)
    for joint in range(q.shape[1]):
        step = h * np.eye(q.shape[1])[joint]
        slope = (field.query(points, q + step) - field.query(points, q - step)) / (2 * h)
        np.testing.assert_allclose(dT_dq[..., joint], slope, atol=1e-4)


def test_gradients_point_as_the_exact_ones_do(field):
    points, q = sample("curled", 40, 20)
    found = field.gradients(points, q)
    true = GridField(ROBOT, 130, "marching").gradients(points, q)
    felt = np.linalg.norm(true[2], axis=-1) > 0.5
    for a, b in zip(found[1:], true[1:], strict=True):
        cosine = (a * b).sum(-1) / np.maximum(
            np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1), 1e-12
        )
        assert np.median(cosine[felt]) > 0.99
        length = np.linalg.norm(a, axis=-1) / np.maximum(np.linalg.norm(b, axis=-1), 1e-12)
        assert 0.9 < np.median(length[felt]) < 1.35  # a coarse table's slopes are steep


@pytest.mark.parametrize("any_robot", [ROBOT, "sliding_capsules", "turned_capsules"], indirect=True)
def test_rows_do_not_depend_on_each_other(any_robot):
    one, many = (
        TableField(any_robot, resolution=33, spacing=0.3, threads=threads) for threads in (1, 3)
    )
    points, q = sample("curled", 7, 3, any_robot)
    batch = one.gradients(points, q)
    split = many.gradients(points, q)
    for row in range(len(q)):
        for a, b, c in zip(batch, split, one.gradients(points[row], q[row]), strict=True):
            assert (a[row] == c).all() and (b[row] == c).all()


@pytest.mark.parametrize("any_robot", ["sliding_capsules", "turned_capsules"], indirect=True)
def test_it_is_the_grid_of_the_same_robot(any_robot):
    points, q = sample("curled", 20, 10, any_robot)
    found, true = (make(any_robot, 65).query(points, q) for make in (TableField, GridField))
    clear = (true > 0) & (robot_distance(any_robot, points, q) > 0.05)
    error = np.abs(found - true)[clear] / true[clear]
    assert clear.sum() > 100 and np.median(error) < 0.01 and error.mean() < 0.03


def test_turning_the_arm_and_the_points_changes_nothing(field):
    points, q = sample("curled", 20, 10)
    c = np.cos(0.7)
    s = np.sin(0.7)
    turned = field.query(points @ np.array([[c, s], [-s, c]]), q + np.array([0.7, 0.0, 0.0]))
    np.testing.assert_allclose(turned, field.query(points, q), rtol=1e-12)


def test_beyond_its_limits_a_joint_stays_at_them(field):
    robot = get_robot(ROBOT)
    points, q = sample("curled", 5, 4)
    q[:, 1] = robot.joints[1].lower
    q[:, 2] = robot.joints[2].upper
    beyond = field.gradients(points, q + np.array([0.0, -0.2, 0.2]))
    np.testing.assert_allclose(beyond[0], field.query(points, q), rtol=1e-12)
    assert (beyond[2][..., 1:] == 0).all() and (beyond[2][..., 0] != 0).any()
    assert (field.gradients(points, q)[2][..., 1:] != 0).any()


def test_pictures_show_the_table_and_paths_lead_out(field):
    points, q = sample("curled", 1, 1)
    drawn = field.solve(q[0])
    nodes = np.stack(np.meshgrid(drawn.x, drawn.y), axis=-1)
    free = robot_distance(ROBOT, nodes.reshape(1, -1, 2), q).reshape(drawn.T.shape) > 0.06
    assert (drawn.T[free] == field.query(nodes[free], q[0])).all()
    path = field.escape_path(points[0, 0], q[0])
    assert np.hypot(*path[-1]) >= R and (np.diff(field.query(path, q[0])) < 0.2).all()


@pytest.fixture
def fresh(tmp_path, monkeypatch):
    """An empty cache, and how often a table was solved since."""
    from piec_envs.escape import table

    solved = []
    tabulate = table.tabulate
    monkeypatch.setenv("PIEC_CACHE", str(tmp_path))
    monkeypatch.setattr(table, "tabulate", lambda *args: solved.append(1) or tabulate(*args))
    return tmp_path, solved


def values(field):
    points, q = sample("curled", 5, 5)
    return field.query(points, q)


def test_a_table_is_kept(fresh):
    folder, solved = fresh
    assert cache_folder() == folder
    first = values(TableField(**TINY))
    (kept,) = (folder / "tables").iterdir()
    stamp = kept.stat().st_mtime_ns
    assert (values(TableField(**TINY)) == first).all() and len(solved) == 1
    assert kept.stat().st_mtime_ns == stamp and list((folder / "tables").iterdir()) == [kept]


@pytest.mark.parametrize(
    "change", [{"spacing": 0.4}, {"resolution": 17}, {"speed": SpeedModel(leak=0.1)}]
)
def test_another_table_has_another_file(fresh, change):
    folder, solved = fresh
    for options in (TINY, {**TINY, **change}):
        TableField(**options)
    assert len(solved) == len(list((folder / "tables").iterdir())) == 2


@pytest.mark.parametrize("contact", ["", "_link"])
def test_a_base_that_slides_shares_the_table_of_one_that_stands(fresh, contact):
    folder, solved = fresh
    still, sliding = (
        TableField(**{**TINY, "robot_name": f"{base}franka{contact}_capsules"})
        for base in ("", "mobile_")
    )
    assert len(solved) == len(list((folder / "tables").iterdir())) == 1
    points, q = sample("curled", 20, 10, still.robot_name)
    places = np.random.default_rng(0).uniform(-1.5, 1.5, (20, 2))
    places[0] = 0.0
    moved = sliding.gradients(points + places[:, None], np.column_stack([places, q]))
    for a, b in zip(moved[:2], still.gradients(points, q)[:2], strict=True):
        np.testing.assert_allclose(a, b, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(
        moved[2][..., 2:], still.gradients(points, q)[2], rtol=1e-9, atol=1e-9
    )
    # it moves instead of the point
    np.testing.assert_allclose(moved[2][..., :2], -moved[1], rtol=1e-9, atol=1e-9)
    assert (sliding.query(points + 0.5, np.column_stack([places, q])) != moved[0]).any()


@pytest.mark.parametrize(
    "damage",
    [
        lambda b: b"",
        lambda b: b[:50],
        lambda b: b[:-4],
        lambda b: b[:-1] + bytes([b[-1] ^ 1]),
        lambda b: b"x" + b[1:],
    ],
    ids=["empty", "cut in the header", "cut", "a bit", "header"],
)
def test_a_broken_file_is_replaced(fresh, damage):
    folder, solved = fresh
    first = values(TableField(**TINY))
    (kept,) = (folder / "tables").iterdir()
    whole = kept.read_bytes()
    kept.unlink()
    kept.write_bytes(damage(whole))
    assert (values(TableField(**TINY)) == first).all() and len(solved) == 2
    assert kept.read_bytes() == whole and list((folder / "tables").iterdir()) == [kept]


def test_a_foreign_file_is_replaced(fresh):
    folder, solved = fresh
    TableField(**TINY)
    (kept,) = (folder / "tables").iterdir()
    mine = kept.read_bytes()
    TableField(**{**TINY, "speed": SpeedModel(leak=0.1)})
    (other,) = set((folder / "tables").iterdir()) - {kept}
    other.replace(kept)
    TableField(**TINY)
    assert kept.read_bytes() == mine and len(solved) == 3


def test_without_a_folder_the_table_stays_in_memory(fresh, monkeypatch):
    folder, solved = fresh
    first = values(TableField(**TINY))
    (folder / "file").write_bytes(b"")
    monkeypatch.setenv("PIEC_CACHE", str(folder / "file"))  # no folder can be made there
    assert (values(TableField(**TINY)) == first).all() and len(solved) == 2


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (
            {"robot_name": "planar_arm"},
            "2 turning joints after the first.*has 3.*'network' or 'grid'",
        ),
        ({"speed": SpeedModel(leak=0.0)}, "hard wall"),
        ({"resolution": 15}, "at least 16"),
        ({"spacing": 0.001}, "0.01 and 0.5 rad, got 0.001"),
        ({"spacing": float("nan")}, "got nan"),
        ({"resolution": 2000}, "larger than 1 GB"),
    ],
)
def test_what_cannot_be_tabulated_is_refused(options, words):
    with pytest.raises(InvalidParameterError, match=words):
        TableField(**{**TINY, **options})

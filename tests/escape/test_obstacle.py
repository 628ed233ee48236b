"""The escape time of a point mass among fixed obstacles, and that it is the field of a robot that
stands still.
"""

import numpy as np
import pytest

from piec_envs.errors import InvalidParameterError, InvalidStateError, UnknownNameError
from piec_envs.escape import GridField, SpeedModel
from piec_envs.escape.obstacle import ObstacleField, even_speed
from piec_envs.world.robots import get_robot
from piec_envs.world.shapes import RoundedPolygon, box, capsule, disc

WALLS = [
    RoundedPolygon(np.array([(-a, -b), (a, -b), (a, b), (-a, b)]) + shift)
    for a, b, shift in (
        (0.5, 0.1, (0, 0.4)),
        (0.5, 0.1, (0, -0.4)),
        (0.1, 0.5, (0.4, 0)),
        (0.1, 0.5, (-0.4, 0)),
    )
]  # a square annulus between 0.3 and 0.5
POINTS = np.random.default_rng(0).uniform(-1.1, 1.1, (2000, 2))
ROOM = np.array([0.11, 0.07])  # m, the middle of `room`
RING = np.abs(POINTS).max(axis=1)


@pytest.mark.parametrize("method", ["sweeping", "marching"])
@pytest.mark.parametrize("leak", [0.0, 0.05])
def test_a_robot_that_stands_still_is_an_obstacle(method, leak):
    straight = get_robot("planar_arm")
    speed = SpeedModel(leak=leak)
    starts = np.cumsum([0.0, 0.4, 0.4, 0.4])
    links = [
        capsule((x, 0), (x + length, 0), 0.05)
        for x, length in zip(starts, (0.4, 0.4, 0.4, 0.2), strict=True)
    ]
    fixed = ObstacleField(links, straight.workspace_radius, speed, 64, method)
    robot = GridField("planar_arm", 64, method, speed)
    assert (fixed.query(POINTS) == robot.query(POINTS, np.zeros(4))).all()
    for mine, its in zip(fixed.solve(), robot.solve(np.zeros(4)), strict=True):
        assert (mine == its).all()
    assert (
        fixed.escape_path(np.array([0.5, 0.3]))
        == robot.escape_path(np.array([0.5, 0.3]), np.zeros(4))
    ).all()


@pytest.mark.parametrize("method", ["sweeping", "marching"])
def test_the_cavity_is_the_cage_and_everything_else_has_the_straight_way(method):
    field = ObstacleField(WALLS, 1.0, even_speed(), 100, method)
    T = field.query(POINTS)
    straight = 1.0 - np.hypot(*POINTS.T)
    assert (np.isinf(T) == (RING <= 0.5)).all()
    np.testing.assert_allclose(
        T[RING > 0.5], np.maximum(straight, 0)[RING > 0.5], rtol=2e-3, atol=1e-12
    )
    assert (field.escape_path(np.zeros(2)) == np.zeros((1, 2))).all()


def test_behind_a_leaky_wall_the_time_is_that_of_crossing_it():
    field = ObstacleField(WALLS, 1.0, even_speed(0.1), 400)
    inside = field.query(POINTS[RING < 0.3])
    assert np.isfinite(inside).all() and inside.min() > field.query(POINTS[RING > 0.51]).max()
    # straight through a side
    assert field.query(np.zeros(2)) == pytest.approx(0.8 + 0.2 / 0.1, rel=0.03)
    path = field.escape_path(np.array([0.05, 0.0]))
    assert (np.diff(field.query(path)) < 0).all() and np.hypot(*path[-1]) == pytest.approx(1.0)
    assert (np.abs(path[:, 1]) < 0.02).all()


def test_a_thin_wall_beside_a_gap_is_gone_around():
    """Two discs that leave a gap: the way through it is the shorter one of the two sides."""
    field = ObstacleField([disc(0.3, (0.5, 0.36)), disc(0.3, (0.5, -0.36))], 1.0, even_speed(), 300)
    assert field.query(np.array([0.5, 0.0])) == pytest.approx(0.5, rel=1e-3)
    assert field.query(np.array([0.3, 0.0])) == pytest.approx(0.7, rel=1e-3)


def test_points_on_or_outside_the_circle_have_escaped():
    field = ObstacleField([box(0.4, 0.2)], 0.7)
    angle = np.linspace(0, 2 * np.pi, 9)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    for radius in (0.7 * (1 + 1e-12), 0.8, 30.0):
        assert (field.query(radius * ring) == 0).all()
    assert field.query(np.zeros((3, 5, 2))).shape == (3, 5)
    assert field.h == pytest.approx(np.diff(field.solve().x)[0])


def test_bad_arguments_are_refused():
    square = [box(0.4, 0.2)]
    for shapes, radius, options, error, message in (
        ([], 1.0, {}, InvalidParameterError, "at least one obstacle"),
        (square, np.inf, {}, InvalidParameterError, "radius"),
        (square, -1.0, {}, InvalidParameterError, "radius"),
        (square, 1.0, {"resolution": 15}, InvalidParameterError, "at least 16"),
        (square, 1.0, {"method": "swept"}, UnknownNameError, "sweeping"),
    ):
        with pytest.raises(error, match=message):
            ObstacleField(shapes, radius, **options)
    with pytest.raises(InvalidParameterError, match=r"\[0.0, 1.0\)"):
        even_speed(1.0)
    field = ObstacleField(square, 1.0)
    for points in (np.array([np.nan, 0.0]), np.array([[0.0, np.inf]]), np.zeros(3), np.array(1.0)):
        with pytest.raises(InvalidStateError, match="finite"):
            field.query(points)
        with pytest.raises(InvalidStateError, match="finite"):
            field.escape_path(points)


def room(gap: float, turn: float) -> list[RoundedPolygon]:
    """A square room of capsules with a door of that width."""
    edge = gap / 2 + 0.05
    c = np.cos(turn)
    s = np.sin(turn)
    sides = [
        (-1, -1, -1, 1),
        (-1, 1, 1, 1),
        (-1, -1, 1, -1),
        (1, 1, 1, edge / 0.3),
        (1, -edge / 0.3, 1, -1),
    ]
    ends = 0.3 * np.array(sides).reshape(-1, 2, 2) @ np.array([[c, s], [-s, c]]) + ROOM
    return [capsule(a, b, 0.05) for a, b in ends]


@pytest.mark.parametrize("turn", [0.0, 0.3, np.pi / 4])
@pytest.mark.parametrize("gap", [0.062, 0.065, 0.08])
def test_a_door_narrower_than_a_cell_is_neither_closed_nor_missed(gap, turn):
    # Walls are 0.03 m thick on both sides, so 0.062 leaves 2 mm; a cell of 100 nodes a side has 29
    # mm.
    shapes = room(gap, turn)
    fine = ObstacleField(shapes, 1.4, SpeedModel(), 1000).query(ROOM)
    assert abs(ObstacleField(shapes, 1.4, SpeedModel(), 100).query(ROOM) / fine - 1) < 0.06
    shut = ObstacleField(room(0.05, turn), 1.4, SpeedModel(), 100).query(ROOM)
    assert shut > 1.2 * fine

"""Proposition 1: mean over key points <= largest over key points <= escape time of the rigid body.

The rigid time is that of Dijkstra on a grid of poses (x, y, theta). An edge is a straight motion
with constant turning. It takes the integral of the largest |dp_i| / u(p_i) over the key points,
since all of them keep to their speed limit at once, and ends where the last of them crosses the
circle. Such a path is one of those that the proposition ranges over, so the finite neighbourhood
makes the rigid time too long and never too short, and so do the sums, in which each part of an edge
counts at its slower end.

What is left is the error of the field: half a per cent, and near the circle, where T is small, a
tenth of the time that free space takes for a cell. Poses with a key point in the wall are left out:
the object would overlap the robot there, and T in the wall is off by as much as a cell takes at the
leak's speed.
"""

from functools import cache, partial
from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
from scipy.sparse import coo_matrix
from scipy.sparse.csgraph import dijkstra

from piec_envs.escape import GridField, SpeedModel, key_points_world, object_escape_time
from piec_envs.escape.samples import draw_configurations, robot_distance
from piec_envs.world.objects import OBJECTS
from piec_envs.world.robots import get_robot

ROBOT = "planar_arm"
RADIUS = get_robot(ROBOT).workspace_radius
# m; headings in a full turn; parts of an edge
H = 0.065
HEADINGS = 24
STEPS = 6
FIELD = GridField(ROBOT, 200, "marching")
# of the field's error; 0.03 s
RELATIVE = 0.005
ABSOLUTE = 0.1 * 2 * RADIUS / 195 / FIELD.u_bar
HARD = GridField(ROBOT, 200, "marching", SpeedModel(leak=0.0))

# Turned by a whole share of a full turn the key points are the same set: fewer headings are enough.
BODIES = {
    "three discs": (OBJECTS["three_discs"].key_points, 3),
    "two discs": (np.array([(-0.06, 0.0), (0.06, 0.0)]), 2),
}
_RNG = np.random.default_rng(1)
POSTURES = {
    **{f"curled {k}": q for k, q in enumerate(draw_configurations(ROBOT, "curled", 2, _RNG))},
    "uniform": draw_configurations(ROBOT, "uniform", 1, _RNG)[0],
    "straight": np.zeros(4),
    "cage": np.array([-0.5, 1.75, 1.6, 1.6]),  # closes a ring around (0.27, 0.08)
}


class Poses(NamedTuple):
    """A grid of poses: x and y in cells, heading in steps, which go round."""

    poses: np.ndarray  # (N, N, headings, 3)
    index: np.ndarray  # (N, N, headings)
    turn: float  # rad between two headings


def pose_grid(key_points: np.ndarray, symmetry: int) -> Poses:
    reach = np.hypot(*key_points.T).max()
    count = int(np.ceil((RADIUS + reach) / H)) + 2
    axis = H * np.arange(-count, count + 1)
    turn = 2 * np.pi / HEADINGS
    grid = np.meshgrid(axis, axis, turn * np.arange(HEADINGS // symmetry), indexing="ij")
    poses = np.stack(grid, -1)
    return Poses(poses, np.arange(poses[..., 0].size).reshape(poses.shape[:3]), turn)


def motions() -> list[tuple[int, int, int]]:
    """Every direction to a cell at most two away, with and without turning, one of each opposite
    pair.
    """
    steps = [(i, j, k) for i in range(-2, 3) for j in range(-2, 3) for k in (-1, 0, 1)]
    return [step for step in steps if step > (0, 0, 0) and np.gcd(step[0], step[1]) <= 1]


def ends(grid: Poses, motion: tuple[int, int, int]) -> tuple[np.ndarray, np.ndarray]:
    """Indices of the poses where a motion begins, and where it ends, shape (E,)."""

    def part(first: bool):
        return tuple(
            slice(max(0, -step if first else step), n - max(0, step if first else -step))
            for step, n in zip(motion[:2], grid.index.shape[:2], strict=True)
        )

    return grid.index[part(True)].ravel(), np.roll(
        grid.index[part(False)], -motion[2], axis=2
    ).ravel()


def edge_times(points: np.ndarray, q: np.ndarray) -> np.ndarray:
    """How long edges take, shape (E,): key points along them are (E, STEPS + 1, k, 2)."""
    distance = robot_distance(ROBOT, points.reshape(1, -1, 2), q[None]).reshape(points.shape[:-1])
    slow = 1 / FIELD.speed.speed(distance)
    length = np.linalg.norm(np.diff(points, axis=1), axis=-1)  # (E, STEPS, k)
    time = (length * np.maximum(slow[:, 1:], slow[:, :-1])).max(axis=-1)  # (E, STEPS)
    # (E, STEPS + 1), of the last one in
    depth = RADIUS - np.hypot(points[..., 0], points[..., 1]).min(axis=-1)
    before = depth[:, :-1]
    after = depth[:, 1:]
    inside = np.maximum(before, 0) + np.maximum(after, 0)
    share = np.where(
        (before > 0) & (after > 0), 1.0, inside / np.maximum(np.abs(after - before), 1e-12)
    )
    return (time * np.minimum(share, 1.0)).sum(axis=1)


def rigid_times(
    key_points: np.ndarray, symmetry: int, q: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Escape time of a rigid body from every pose of a grid where it is not out yet: (B, 3) and
    (B,).
    """
    grid = pose_grid(key_points, symmetry)
    poses = grid.poses.reshape(-1, 3)
    points = key_points_world(key_points, poses)
    out = (np.hypot(points[..., 0], points[..., 1]) >= RADIUS).all(axis=1)
    beside = np.linspace(0, 1, STEPS + 1)[:, None]
    starts = []
    stops = []
    times = []
    for motion in motions():
        start, stop = ends(grid, motion)
        kept = ~(out[start] & out[stop])
        start = start[kept]
        stop = stop[kept]
        # (E, STEPS + 1, 3)
        along = poses[start][:, None] + beside * (np.array(motion) * [H, H, grid.turn])
        starts = [*starts, start]
        stops = [*stops, stop]
        times.append(edge_times(key_points_world(key_points, along), q))
    ways = np.concatenate(starts), np.concatenate(stops)
    graph = coo_matrix(
        (np.maximum(np.concatenate(times), 1e-12), ways), shape=(len(poses),) * 2
    ).tocsr()
    T = dijkstra(graph, directed=False, indices=np.flatnonzero(out), min_only=True)
    return poses[~out], T[~out]


def longest(rigid: np.ndarray) -> np.ndarray:
    """What a lower bound computed from the field may reach, s."""
    return rigid * (1 + RELATIVE) + ABSOLUTE


class Scene(NamedTuple):
    """All poses of a grid with no key point in the wall, and the escape times from there."""

    key_points: np.ndarray  # (k, 2)
    q: np.ndarray  # (n,)
    poses: np.ndarray  # (B, 3)
    times: np.ndarray  # (B, k) of the key points
    rigid: np.ndarray  # (B,) of the body
    enclosed: np.ndarray  # (B,) whether no key point leads out past a hard wall


@cache
def make_scene(body: str, posture: str) -> Scene:
    (key_points, symmetry) = BODIES[body]
    q = POSTURES[posture]
    poses, rigid = rigid_times(key_points, symmetry, q)
    points = key_points_world(key_points, poses)  # (B, k, 2)

    def asked(answer):
        return answer(points.reshape(1, -1, 2), q[None]).reshape(points.shape[:2])

    clear = (asked(partial(robot_distance, ROBOT)) > FIELD.speed.d0).all(axis=1)
    enclosed = np.isinf(asked(HARD.query)).all(axis=1)
    return Scene(
        key_points, q, poses[clear], asked(FIELD.query)[clear], rigid[clear], enclosed[clear]
    )


@pytest.fixture(params=product(BODIES, POSTURES), ids=", ".join)
def scene(request):
    return make_scene(*request.param)


def test_key_points_bound_the_escape_time_of_the_body_from_below(scene):
    assert len(scene.poses) > 5000 and np.isfinite(scene.rigid).all()
    mean = scene.times.mean(axis=1)
    most = scene.times.max(axis=1)
    assert (mean <= most).all() and (most <= longest(scene.rigid)).all()


def test_the_object_time_is_that_bound(scene):
    some = np.linspace(0, len(scene.poses) - 1, 12).astype(int)
    q = np.tile(scene.q, (len(some), 1))
    for reduce in ("mean", "max"):
        time = object_escape_time(FIELD, scene.key_points, scene.poses[some], q, reduce)
        np.testing.assert_allclose(time, getattr(scene.times[some], reduce)(axis=1), rtol=1e-12)
        assert (time <= longest(scene.rigid[some])).all()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda times: 1.2 * times.max(axis=1),
        lambda times: 1.05 * times.max(axis=1),
        lambda times: times.sum(axis=1),
    ],
    ids=["a fifth more", "a twentieth more", "sum"],
)
def test_what_is_no_bound_is_refuted(scene, wrong):
    """The body's time is so close to the largest of its key points that a wrong bound
    exceeds it.
    """
    assert (wrong(scene.times) > longest(scene.rigid)).mean() > 0.3


@pytest.mark.parametrize("body", BODIES)
def test_in_a_cage_both_times_stand_above_those_of_all_reachable_poses(body):
    scene = make_scene(body, "cage")
    assert scene.enclosed.sum() > 10
    for time in (scene.times.max(axis=1), scene.rigid):
        assert time[scene.enclosed].min() > time[~scene.enclosed].max()

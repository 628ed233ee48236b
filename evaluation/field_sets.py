"""The held-out sets on which escape fields are judged, with the exact answer at every point.

H: curled configurations, points around the arm's centroid; `hard` are those of H where the arm
costs more than 5 % over the straight way. C: one point, many curled configurations turned towards
it. U: uniform configurations, points anywhere in the disc. P: states along plans. All points are
more than 0.05 m from the robot, and no seed is one of training.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import (
    GridField,
    SpeedModel,
    check_name,
    draw_configurations,
    draw_points,
    get_robot,
    robot_distance,
    robot_vertices,
)

SEEDS = {"H": 30_001, "C": 30_002, "U": 30_003}
CLEARANCE = 0.05  # m
# m, the point of set C: where cages can be
RANK_POINTS = {"planar_arm": (0.35, 0.1), "franka": (0.2, 0.06)}
HARD_RATIO = 1.05  # T / T_0 beyond which a point of H is hard
RESOLUTION = 200  # of the second-order grid that is taken for the truth


@dataclass(frozen=True, eq=False)
class PointSet:
    """Points, configurations and the truth there.

    Args:
        q: configurations, shape (B, n).
        points: shape (B, k, 2), m.
        T: exact escape time, shape (B, k), s.
        bound: T_0 there, shape (B, k), s.
        reachable: whether a way leads out under the hard wall, shape (B, k).
    """

    q: np.ndarray
    points: np.ndarray
    T: np.ndarray
    bound: np.ndarray
    reachable: np.ndarray


def least_time(robot_name: str, points: np.ndarray) -> np.ndarray:
    """T_0 = (R - |p|) / u_bar.

    Args:
        robot_name: a row of the table of robots.
        points: relative to a base that stands, shape (..., 2), m.

    Returns:
        Shape (...), s.
    """
    return (
        get_robot(robot_name).workspace_radius - np.hypot(points[..., 0], points[..., 1])
    ) / SpeedModel().u_bar


def solved_set(
    robot_name: str, q: np.ndarray, points: np.ndarray, threads: int | None = None
) -> PointSet:
    """A set with the answers of the exact fields, leaky and hard.

    Args:
        robot_name: a row of the table of robots.
        q: configurations, shape (B, n), rad or m.
        points: shape (B, k, 2), m.
        threads: over the configurations; None takes all cores.

    Returns:
        The set.
    """
    hard = GridField(robot_name, RESOLUTION, "marching", SpeedModel(leak=0.0), threads)
    return PointSet(
        q=q,
        points=points,
        T=exact_field(robot_name, threads).query(points, q),
        bound=least_time(robot_name, points),
        reachable=np.isfinite(hard.query(points, q)),
    )


def exact_field(robot_name: str, threads: int | None = None) -> GridField:
    """The field that is taken for the truth: second-order marching on 200 x 200 nodes.

    Args:
        robot_name: a row of the table of robots.
        threads: over the rows of a batch; None takes all cores.

    Returns:
        The field.
    """
    return GridField(robot_name, RESOLUTION, "marching", threads=threads)


def curled_set(
    robot_name: str, rows: int = 50, k: int = 400, threads: int | None = None
) -> PointSet:
    """Set H.

    Args:
        robot_name: a row of the table of robots.
        rows: configurations.
        k: points of each.
        threads: for the exact fields; None takes all cores.

    Returns:
        The set, always the same for the same numbers.
    """
    return _drawn_set(robot_name, "curled", SEEDS["H"], rows, k, threads)


def uniform_set(
    robot_name: str, rows: int = 50, k: int = 400, threads: int | None = None
) -> PointSet:
    """Set U.

    Args:
        robot_name, rows, k, threads: as in `curled_set`.

    Returns:
        The set, always the same for the same numbers.
    """
    return _drawn_set(robot_name, "uniform", SEEDS["U"], rows, k, threads)


def _drawn_set(robot_name, kind, seed, rows, k, threads) -> PointSet:
    rng = np.random.default_rng(seed)
    q = draw_configurations(robot_name, kind, rows, rng)
    return solved_set(robot_name, q, draw_points(robot_name, kind, q, k, rng, CLEARANCE), threads)


def ranking_set(robot_name: str, rows: int = 1500, threads: int | None = None) -> PointSet:
    """Set C: curled configurations turned towards one point, which is clear of them.

    Args:
        robot_name: a row of RANK_POINTS, which has the point.
        rows: configurations.
        threads: for the exact fields; None takes all cores.

    Returns:
        The set, of one point for each configuration; the robot's centroid lies in its direction.

    Raises:
        UnknownNameError: for a robot without such a point.
    """
    check_name("robot with a point of set C", robot_name, RANK_POINTS)
    rng = np.random.default_rng(SEEDS["C"])
    point = np.array(RANK_POINTS[robot_name])
    kept = np.empty((0, get_robot(robot_name).dof))
    while len(kept) < rows:
        q = draw_configurations(robot_name, "curled", rows, rng)
        q[:, 0] = 0.0
        x, y = robot_vertices(robot_name, q).mean(axis=1).T
        turn = np.arctan2(point[1], point[0]) - np.arctan2(y, x)
        q[:, 0] = (turn + np.pi) % (2 * np.pi) - np.pi
        clear = (
            robot_distance(robot_name, np.repeat(point[None, None], rows, axis=0), q)[:, 0]
            > CLEARANCE
        )
        kept = np.concatenate([kept, q[clear]])
    return solved_set(robot_name, kept[:rows], np.repeat(point[None, None], rows, axis=0), threads)


def plan_set(
    robot_name: str,
    states: Sequence[tuple[np.ndarray, np.ndarray]],
    key_points: np.ndarray,
    threads: int | None = None,
) -> PointSet:
    """Set P: the key points of the object in all states of some plans, as far as they are clear of
    the robot.

    Args:
        robot_name: a row of the table of robots.
        states: for each plan the object's poses (N, 3) and the joint positions (N, n).
        key_points: in the object's frame, shape (k, 2), m.
        threads: for the exact fields.

    Returns:
        The set, of k points for each state.
    """
    from piec_envs import key_points_world

    q = np.concatenate([joints for _, joints in states])
    points = key_points_world(key_points, np.concatenate([poses for poses, _ in states]))
    clear = (robot_distance(robot_name, points, q) > CLEARANCE).all(axis=1)
    return solved_set(robot_name, q[clear], points[clear], threads)


def thinned(chosen: PointSet, count: int, fine: GridField) -> PointSet:
    """Evenly spaced configurations of a set, one point each, with the answers of a finer grid.

    Args:
        chosen: the set.
        count: configurations.
        fine: the field that answers.

    Returns:
        The smaller set; `bound` and `reachable` are those of the larger one.
    """
    rows = np.unique(np.linspace(0, len(chosen.q) - 1, count).astype(int))
    q = chosen.q[rows]
    points = np.ascontiguousarray(chosen.points[rows, :1])
    bound = chosen.bound[rows, :1]
    reachable = chosen.reachable[rows, :1]
    return PointSet(q, points, fine.query(points, q), bound, reachable)

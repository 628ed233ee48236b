"""Robots and objects, packed into flat arrays for the compiled kernels."""

from __future__ import annotations

from functools import cache
from itertools import combinations
from typing import NamedTuple

import numpy as np

from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot
from piec_envs.world.shapes import RoundedPolygon


class PackedShapes(NamedTuple):
    """Rounded polygons of one body or chain; shape s owns vertices[first[s]:first[s + 1]]."""

    first: np.ndarray  # (S + 1,) int64
    vertices: np.ndarray  # (V, 2) m, in the frame of the shape
    radius: np.ndarray  # (S,) m
    frame: np.ndarray  # (S,) int64, the frame that the shape is fixed in
    link: np.ndarray  # (S,) int64, the link that the shape belongs to
    centre: np.ndarray  # (S, 2) m, bounding circle in the frame of the shape
    bound: np.ndarray  # (S,) m, bounding circle's radius


class PackedRobot(NamedTuple):
    """Everything that the kernels know of a robot."""

    joint_origin: np.ndarray  # (n, 3) x, y, angle in the parent frame
    joint_axis: np.ndarray  # (n, 3) planar screw axis
    lower: np.ndarray  # (n,) joint limits
    upper: np.ndarray  # (n,)
    speed_limit: np.ndarray  # (n,) v_max
    max_lead: np.ndarray  # (n,)
    stiffness: np.ndarray  # (n,) K
    reach: np.ndarray  # (n,) largest lever arm of each joint, m (1 for a sliding joint)
    shapes: PackedShapes  # of all links, each in the frame of its link
    links: int  # how many
    apart: np.ndarray  # (P, 2) int64, pairs of links that could collide


class PackedObject(NamedTuple):
    """Everything that the kernels know of an object."""

    shapes: PackedShapes  # in the object's frame
    key_points: np.ndarray  # (k, 2) m, whose escape times are averaged
    gyration: float  # m


class Scene(NamedTuple):
    """One robot and one object."""

    robot: PackedRobot  # as `pack_robot` packs it
    object: PackedObject  # as `pack_object` packs it


def pack_shapes(parts: list[tuple[RoundedPolygon, int, int]]) -> PackedShapes:
    """Pack (shape, frame, link) triples into flat arrays."""
    shapes = [part[0] for part in parts]
    circles = [shape.bounding_circle for shape in shapes]
    return PackedShapes(
        first=np.cumsum([0] + [len(shape.vertices) for shape in shapes]).astype(np.int64),
        vertices=np.ascontiguousarray(np.concatenate([shape.vertices for shape in shapes])),
        radius=np.array([shape.radius for shape in shapes]),
        frame=np.array([part[1] for part in parts], dtype=np.int64),
        link=np.array([part[2] for part in parts], dtype=np.int64),
        centre=np.array([centre for centre, _ in circles]),
        bound=np.array([bound for _, bound in circles]),
    )


def _reach(robot) -> np.ndarray:
    """Largest distance from each turning joint to any point of the robot beyond it, shape (n,)."""
    reach = np.ones(robot.dof)
    for j, joint in enumerate(robot.joints):
        if joint.axis[2] == 0:
            continue
        best = 0.0
        for link in robot.links:
            if link.frame <= j:
                continue
            chain = sum(np.hypot(*inner.origin[:2]) for inner in robot.joints[j + 1 : link.frame])
            tip = max(
                float(np.linalg.norm(s.vertices, axis=1).max()) + s.radius for s in link.shapes
            )
            best = max(best, chain + tip)
        reach[j] = best
    return reach


def _links_apart(robot) -> np.ndarray:
    """Pairs of links with at least two joints between them, shape (P, 2).

    The two sides of one joint are made to move on each other within its limits, although convex
    shapes of them may overlap.
    """
    frames = [link.frame for link in robot.links]
    pairs = [
        (i, k) for i, k in combinations(range(len(frames)), 2) if abs(frames[k] - frames[i]) >= 2
    ]
    return np.array(pairs, dtype=np.int64).reshape(-1, 2)


@cache
def pack_robot(name: str) -> PackedRobot:
    """Pack a row of the table of robots into flat arrays, to be treated as read-only.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    robot = get_robot(name)
    return PackedRobot(
        joint_origin=robot.joint_array("origin"),
        joint_axis=robot.joint_array("axis"),
        lower=robot.joint_array("lower"),
        upper=robot.joint_array("upper"),
        speed_limit=robot.joint_array("speed_limit"),
        max_lead=robot.joint_array("max_lead"),
        stiffness=robot.joint_array("stiffness"),
        reach=_reach(robot),
        shapes=pack_shapes(
            [(shape, link.frame, i) for i, link in enumerate(robot.links) for shape in link.shapes]
        ),
        links=len(robot.links),
        apart=_links_apart(robot),
    )


@cache
def pack_object(name: str) -> PackedObject:
    """Pack a row of the table of objects into flat arrays, to be treated as read-only.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    item = get_object(name)
    return PackedObject(
        shapes=pack_shapes([(shape, 0, 0) for shape in item.shapes]),
        key_points=np.ascontiguousarray(item.key_points, dtype=float),
        gyration=item.gyration,
    )


@cache
def pack_scene(robot_name: str, object_name: str) -> Scene:
    """A robot and an object together.

    Args:
        robot_name: a row of the table of robots.
        object_name: a row of the table of objects.

    Returns:
        Both, to be treated as read-only.

    Raises:
        UnknownNameError: if a table has no such row.
    """
    return Scene(pack_robot(robot_name), pack_object(object_name))

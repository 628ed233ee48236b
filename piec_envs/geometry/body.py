"""Signed distances and closest points between points, bodies and the links of a robot.

Every distance is that of the cores (the polygons without rounding, see `polygon`) minus the radii.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.geometry.kinematics import link_frames, place_shapes, pose_frame
from piec_envs.geometry.polygon import closest_on_polygon, core_distance, front_of
from piec_envs.kernels import batch_kernel, inlined_kernel, kernel

SLACK = 1e-6  # m; more than rounding, and cores touching at corners, take from a lower bound


class Placed(NamedTuple):
    """A scene in the world: scratch of one thread, so that no state allocates."""

    # (n + 1, 4) x, y, cos, sin of the robot's base and of the frame after each joint
    frames: np.ndarray
    robot_vertices: np.ndarray  # (V, 2) m
    robot_centres: np.ndarray  # (S, 2) m, of the shapes' bounding circles
    object_frame: np.ndarray  # (1, 4)
    object_vertices: np.ndarray  # (W, 2) m
    object_centres: np.ndarray  # (K, 2) m
    pairs: np.ndarray  # (S, K, 3) `core_distance` of robot and object shapes; see `link_distances`
    nearest: np.ndarray  # (S,) int64, the object shape that was nearest: where to look first


@batch_kernel
def make_placed(scene):
    """Room for one scene."""
    arm, item = scene.robot.shapes, scene.object.shapes
    return Placed(
        np.empty((scene.robot.stiffness.shape[0] + 1, 4)),
        np.empty_like(arm.vertices),
        np.empty_like(arm.centre),
        np.empty((1, 4)),
        np.empty_like(item.vertices),
        np.empty_like(item.centre),
        np.empty((arm.radius.shape[0], item.radius.shape[0], 3)),
        np.zeros(arm.radius.shape[0], dtype=np.int64),
    )


@inlined_kernel
def place_robot(robot, q, placed):
    """Frames and shapes of a robot.

    Args:
        robot: a `PackedRobot`.
        q: joint positions, shape (n,), rad or m.
        placed: a `Placed`; the robot's part is written.
    """
    link_frames(robot, q, placed.frames)
    place_shapes(robot.shapes, placed.frames, placed.robot_vertices, placed.robot_centres)


@inlined_kernel
def place_object(item, pose, placed):
    """Frame and shapes of an object.

    Args:
        item: a `PackedObject`.
        pose: its x, y, angle, shape (3,), m and rad.
        placed: a `Placed`; the object's part is written.
    """
    pose_frame(pose, placed.object_frame)
    place_shapes(item.shapes, placed.object_frame, placed.object_vertices, placed.object_centres)


@inlined_kernel
def place_scene(scene, q, pose, placed, distances):
    """World geometry of one state, and its link distances.

    Args:
        scene: a `Scene`.
        q: joint positions, shape (n,), rad or m.
        pose: the object's x, y, angle, shape (3,), m and rad.
        placed: output, a `Placed`.
        distances: output, signed distance of each link to the object, shape (links,), m.
    """
    place_robot(scene.robot, q, placed)
    place_object(scene.object, pose, placed)
    link_distances(scene, placed, distances)


@inlined_kernel
def measure_pair(scene, i, k, placed):
    """`core_distance` of two shapes.

    Args:
        scene: a `Scene`.
        i, k: numbers of the robot's and the object's shape.
        placed: a `Placed`; `pairs[i, k]` is written.
    """
    arm, item, pair = scene.robot.shapes, scene.object.shapes, placed.pairs[i, k]
    pair[0], pair[1], pair[2] = core_distance(
        placed.robot_vertices, arm.first[i], arm.first[i + 1],
        placed.object_vertices, item.first[k], item.first[k + 1],
    )  # fmt: skip


@inlined_kernel
def _floor_under(scene, i, k, front, n_x, n_y, placed):
    """Lower bound of the core distance of two shapes, m, where the robot's has no point beyond
    `front` along n.
    """
    x, y = placed.object_centres[k, 0], placed.object_centres[k, 1]
    item = scene.object.shapes
    return x * n_x + y * n_y - front - SLACK - item.bound[k] + item.radius[k]


@inlined_kernel
def link_distances(scene, placed, distances):
    """Signed distance from each link to the object.

    The distance to one object shape and its normal say where a robot shape ends in that direction.
    An object shape that lies beyond by more than the link's least distance is passed over: its pair
    is a lower bound with the normal (0, 0), until `measure_pair` is asked for it.

    Args:
        scene: a `Scene`.
        placed: a `Placed`, whose `pairs` and `nearest` are written; its `nearest` changes no
            distance.
        distances: output, shape (links,), m.
    """
    arm, item, shapes = scene.robot.shapes, scene.object.shapes, scene.object.shapes.radius.shape[0]
    for link in range(distances.shape[0]):
        distances[link] = np.inf
    for i in range(arm.radius.shape[0]):
        link, best, front, n_x, n_y = arm.link[i], np.inf, 0.0, 0.0, 0.0
        first = placed.nearest[i]
        for turn in range(shapes):
            k = first + turn if first + turn < shapes else first + turn - shapes
            pair, radii = placed.pairs[i, k], arm.radius[i] + item.radius[k]
            if turn > 0:
                floor = _floor_under(scene, i, k, front, n_x, n_y, placed)
                if floor - radii >= distances[link]:
                    pair[0], pair[1], pair[2] = floor, 0.0, 0.0
                    continue
            measure_pair(scene, i, k, placed)
            gap = pair[0] - arm.radius[i] - item.radius[k]
            distances[link] = min(distances[link], gap)
            if gap < best and shapes > 1:
                best, n_x, n_y, placed.nearest[i] = gap, pair[1], pair[2], k
                front = (
                    front_of(placed.object_vertices, item.first[k], item.first[k + 1], n_x, n_y)
                    - pair[0]
                )


@kernel
def point_distance(shapes, robot_vertices, x, y):
    """Signed distance from a point to the whole robot.

    Args:
        shapes: the robot's `PackedShapes`.
        robot_vertices: world vertices from `place_shapes`.
        x, y: the point, m.

    Returns:
        (distance, shape, c_x, c_y, n_x, n_y): the nearest shape, the closest point of its
        surface, and the normal there, which is also the distance's gradient in the point.
    """
    best, shape, s_x, s_y, n_x, n_y = np.inf, -1, 0.0, 0.0, 1.0, 0.0
    for i in range(shapes.radius.shape[0]):
        core, c_x, c_y, d_x, d_y, _ = closest_on_polygon(
            robot_vertices, shapes.first[i], shapes.first[i + 1], x, y
        )
        gap = core - shapes.radius[i]
        if gap < best:
            best, shape, n_x, n_y = gap, i, d_x, d_y
            s_x, s_y = c_x + shapes.radius[i] * d_x, c_y + shapes.radius[i] * d_y
    return best, shape, s_x, s_y, n_x, n_y


@kernel
def least_distance(shapes, vertices, centres, x, y):
    """Signed distance from a point to the whole robot: `point_distance` without the closest point.

    Shapes whose bounding circles are farther away than the nearest shape so far are passed over.

    Args:
        shapes: the robot's `PackedShapes`.
        vertices, centres: of its shapes, from `place_shapes`.
        x, y: the point, m.

    Returns:
        The distance, m.
    """
    best = np.inf
    for i in range(shapes.radius.shape[0]):
        d_x, d_y, far = x - centres[i, 0], y - centres[i, 1], best + shapes.bound[i]
        if far > 0.0 and d_x * d_x + d_y * d_y >= far * far:
            continue
        core = closest_on_polygon(vertices, shapes.first[i], shapes.first[i + 1], x, y)[0]
        best = min(best, core - shapes.radius[i])
    return best


@kernel
def self_distance(robot, robot_vertices):
    """Least signed distance between two links that could collide.

    Args:
        robot: a `PackedRobot`.
        robot_vertices: its shapes' vertices from `place_shapes`.

    Returns:
        The distance, m; inf if there are no such links.
    """
    shapes = robot.shapes
    best = np.inf
    for p in range(robot.apart.shape[0]):
        for i in range(shapes.radius.shape[0]):
            for k in range(shapes.radius.shape[0]):
                if shapes.link[i] != robot.apart[p, 0] or shapes.link[k] != robot.apart[p, 1]:
                    continue
                a, a_end, b, b_end = (
                    shapes.first[i],
                    shapes.first[i + 1],
                    shapes.first[k],
                    shapes.first[k + 1],
                )
                core, _, _ = core_distance(robot_vertices, a, a_end, robot_vertices, b, b_end)
                best = min(best, core - shapes.radius[i] - shapes.radius[k])
    return best


@batch_kernel
def scene_distances(scene, q, pose, distances):
    """Distances of every link to the object at one state, and the robot's distance to itself.

    Args:
        scene: a `Scene`.
        q: joint positions, shape (n,).
        pose: the object's x, y, angle, shape (3,).
        distances: output, signed distance of each link to the object, shape (links,), m.

    Returns:
        The least distance between two links that could collide, m.
    """
    placed = make_placed(scene)
    place_scene(scene, q, pose, placed, distances)
    return self_distance(scene.robot, placed.robot_vertices)

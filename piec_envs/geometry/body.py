"""Distances of whole bodies: a scene in the world, links to the object, a point to the robot, the robot to itself."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.geometry.distance import closest_on_polygon, core_distance
from piec_envs.geometry.kinematics import link_frames, place_shapes, pose_frame
from piec_envs.kernels import batch_kernel, inlined_kernel, kernel


class Placed(NamedTuple):
    """A scene in the world: scratch of one thread, so that no state allocates."""

    frames: np.ndarray  # (n + 1, 4) x, y, cos, sin of the robot's base and of the frame after each joint
    robot_vertices: np.ndarray  # (V, 2) m
    robot_centres: np.ndarray  # (S, 2) m, of the shapes' bounding circles
    object_frame: np.ndarray  # (1, 4)
    object_vertices: np.ndarray  # (W, 2) m
    object_centres: np.ndarray  # (K, 2) m
    pairs: np.ndarray  # (S, K, 3) `core_distance` of each robot shape and object shape


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
    )


@inlined_kernel
def place_robot(robot, q, placed):
    """Frames and shapes of a robot at joint positions (n,)."""
    link_frames(robot, q, placed.frames)
    place_shapes(robot.shapes, placed.frames, placed.robot_vertices, placed.robot_centres)


@inlined_kernel
def place_object(item, pose, placed):
    """Frame and shapes of an object at a pose (3,)."""
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
def link_distances(scene, placed, distances):
    """Signed distance from each link to the object.

    Args:
        scene: a `Scene`.
        placed: a `Placed`, whose `pairs` are written.
        distances: output, shape (links,), m.
    """
    arm, item = scene.robot.shapes, scene.object.shapes
    for k in range(distances.shape[0]):
        distances[k] = np.inf
    for i in range(arm.radius.shape[0]):
        for k in range(item.radius.shape[0]):
            core, n_x, n_y = core_distance(
                placed.robot_vertices, arm.first[i], arm.first[i + 1],
                placed.object_vertices, item.first[k], item.first[k + 1],
            )  # fmt: skip
            pair = placed.pairs[i, k]
            pair[0], pair[1], pair[2] = core, n_x, n_y
            gap = core - arm.radius[i] - item.radius[k]
            distances[arm.link[i]] = min(distances[arm.link[i]], gap)


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
        core, c_x, c_y, d_x, d_y, _ = closest_on_polygon(robot_vertices, shapes.first[i], shapes.first[i + 1], x, y)
        gap = core - shapes.radius[i]
        if gap < best:
            best, shape, n_x, n_y = gap, i, d_x, d_y
            s_x, s_y = c_x + shapes.radius[i] * d_x, c_y + shapes.radius[i] * d_y
    return best, shape, s_x, s_y, n_x, n_y


@kernel
def least_distance(shapes, vertices, centres, x, y):
    """Signed distance from a point to the whole robot, m: `point_distance` without the closest point.

    Shapes whose bounding circles are farther away than the nearest shape so far are passed over.

    Args:
        shapes: the robot's `PackedShapes`.
        vertices, centres: of its shapes, from `place_shapes`.
        x, y: the point, m.
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
    """Least signed distance between two links that could collide, m (inf if there are none)."""
    shapes = robot.shapes
    best = np.inf
    for p in range(robot.apart.shape[0]):
        for i in range(shapes.radius.shape[0]):
            for k in range(shapes.radius.shape[0]):
                if shapes.link[i] != robot.apart[p, 0] or shapes.link[k] != robot.apart[p, 1]:
                    continue
                a, a_end, b, b_end = shapes.first[i], shapes.first[i + 1], shapes.first[k], shapes.first[k + 1]
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

"""Signed distances and closest points between points, rounded polygons and bodies.

Every distance is that of the cores (the polygons without rounding) minus the radii. Two disjoint
convex cores are nearest at a vertex of one of them, so vertices against edges are all it takes;
overlapping cores are measured by their least separating translation.
"""

from __future__ import annotations

import numpy as np

from piec_envs.geometry.kinematics import link_frames, place_shapes, pose_frame
from piec_envs.kernels import batch_kernel, kernel

ON_BOUNDARY = 1e-9  # m; nearer than this the offset to the closest point has no direction


@kernel
def closest_on_polygon(vertices, first, last, x, y):
    """Closest point of a polygon's boundary to a point, and the signed core distance.

    Args:
        vertices: world vertices, shape (V, 2), m; the polygon owns rows first to last - 1.
        first, last: row range.
        x, y: the point, m.

    Returns:
        (distance, c_x, c_y, n_x, n_y, vertex): distance is negative inside a polygon with area;
        n points from the polygon to the point; vertex is the row of the closest corner, or -1
        where the closest point lies within an edge.
    """
    count = last - first
    best = np.inf
    c_x, c_y, vertex = vertices[first, 0], vertices[first, 1], first
    b_x, b_y = 1.0, 0.0  # normal of a point on the boundary itself
    deepest, i_x, i_y, inside_x, inside_y = -np.inf, 0.0, 0.0, 0.0, 0.0
    for i in range(first, last if count > 2 else max(last - 1, first + 1)):
        j = i + 1 if i + 1 < last else first
        a_x, a_y = vertices[i, 0], vertices[i, 1]
        e_x, e_y = vertices[j, 0] - a_x, vertices[j, 1] - a_y
        d_x, d_y = x - a_x, y - a_y
        length2 = e_x * e_x + e_y * e_y
        t = (d_x * e_x + d_y * e_y) / length2 if length2 > 0.0 else 0.0
        corner = -1
        if t <= 0.0:
            t, corner = 0.0, i
        elif t >= 1.0:
            t, corner = 1.0, j
        r_x, r_y = d_x - t * e_x, d_y - t * e_y
        square = r_x * r_x + r_y * r_y
        if square < best:
            best, c_x, c_y, vertex = square, x - r_x, y - r_y, corner
            if square <= ON_BOUNDARY * ON_BOUNDARY and length2 > 0.0:
                b_x, b_y = e_y / np.sqrt(length2), -e_x / np.sqrt(length2)
        if count > 2:
            length = np.sqrt(length2)
            plane = (d_x * e_y - d_y * e_x) / length  # > 0 outside this edge
            if plane > deepest:
                deepest, i_x, i_y = plane, e_y / length, -e_x / length
                inside_x, inside_y = x - plane * i_x, y - plane * i_y
    if count > 2 and deepest <= 0.0:
        return deepest, inside_x, inside_y, i_x, i_y, -1
    distance = np.sqrt(best)
    if distance > ON_BOUNDARY:
        return distance, c_x, c_y, (x - c_x) / distance, (y - c_y) / distance, vertex
    return distance, c_x, c_y, b_x, b_y, vertex


@kernel
def _separation(a, a_first, a_last, b, b_first, b_last):
    """Largest gap between b and an edge line of a, with that edge's outward normal (-inf for a point)."""
    count = a_last - a_first
    best, n_x, n_y = -np.inf, 1.0, 0.0
    if count < 2:
        return best, n_x, n_y
    for i in range(a_first, a_last):
        j = i + 1 if i + 1 < a_last else a_first
        e_x, e_y = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
        length = np.sqrt(e_x * e_x + e_y * e_y)
        o_x, o_y = e_y / length, -e_x / length
        least = np.inf
        for v in range(b_first, b_last):
            least = min(least, (b[v, 0] - a[i, 0]) * o_x + (b[v, 1] - a[i, 1]) * o_y)
        if least > best:
            best, n_x, n_y = least, o_x, o_y
    return best, n_x, n_y


@kernel
def core_distance(a, a_first, a_last, b, b_first, b_last):
    """Signed distance of two convex cores and the normal from a to b.

    Args:
        a, a_first, a_last: world vertices of the first polygon and their row range.
        b, b_first, b_last: the same of the second.

    Returns:
        (distance, n_x, n_y); the distance is minus the least separating translation on overlap.
    """
    if b_last - b_first == 1:
        d, _, _, n_x, n_y, _ = closest_on_polygon(a, a_first, a_last, b[b_first, 0], b[b_first, 1])
        return d, n_x, n_y
    gap_a, a_x, a_y = _separation(a, a_first, a_last, b, b_first, b_last)
    gap_b, b_x, b_y = _separation(b, b_first, b_last, a, a_first, a_last)
    if gap_a < gap_b:
        a_x, a_y = -b_x, -b_y  # normal of the least separating translation, from a to b
    if max(gap_a, gap_b) < 0.0:
        return max(gap_a, gap_b), a_x, a_y
    best, n_x, n_y = np.inf, 1.0, 0.0
    for v in range(b_first, b_last):
        d, _, _, d_x, d_y, _ = closest_on_polygon(a, a_first, a_last, b[v, 0], b[v, 1])
        if d < best:
            best, n_x, n_y = d, d_x, d_y
    for v in range(a_first, a_last):
        d, _, _, d_x, d_y, _ = closest_on_polygon(b, b_first, b_last, a[v, 0], a[v, 1])
        if d < best:
            best, n_x, n_y = d, -d_x, -d_y
    if best <= ON_BOUNDARY:  # touching cores: a corner alone does not know which way is out
        return best, a_x, a_y
    return best, n_x, n_y


@kernel
def link_distances(scene, robot_vertices, object_vertices, distances):
    """Signed distance from each link to the object.

    Args:
        scene: a `PackedScene`.
        robot_vertices, object_vertices: world vertices from `place_shapes`.
        distances: output, shape (links,), m.
    """
    robot, item = scene.robot, scene.object
    for k in range(scene.links):
        distances[k] = np.inf
    for i in range(robot.radius.shape[0]):
        for k in range(item.radius.shape[0]):
            core, _, _ = core_distance(
                robot_vertices, robot.first[i], robot.first[i + 1], object_vertices, item.first[k], item.first[k + 1]
            )
            gap = core - robot.radius[i] - item.radius[k]
            distances[robot.link[i]] = min(distances[robot.link[i]], gap)


@kernel
def point_distance(robot, robot_vertices, x, y):
    """Signed distance from a point to the whole robot.

    Args:
        robot: the robot's `PackedShapes`.
        robot_vertices: world vertices from `place_shapes`.
        x, y: the point, m.

    Returns:
        (distance, shape, c_x, c_y, n_x, n_y): the nearest shape, the closest point of its
        surface, and the normal there, which is also the distance's gradient in the point.
    """
    best, shape, s_x, s_y, n_x, n_y = np.inf, -1, 0.0, 0.0, 1.0, 0.0
    for i in range(robot.radius.shape[0]):
        core, c_x, c_y, d_x, d_y, _ = closest_on_polygon(robot_vertices, robot.first[i], robot.first[i + 1], x, y)
        gap = core - robot.radius[i]
        if gap < best:
            best, shape, n_x, n_y = gap, i, d_x, d_y
            s_x, s_y = c_x + robot.radius[i] * d_x, c_y + robot.radius[i] * d_y
    return best, shape, s_x, s_y, n_x, n_y


@kernel
def least_distance(robot, vertices, centres, x, y):
    """Signed distance from a point to the whole robot, m: `point_distance` without the closest point.

    Shapes whose bounding circles are farther away than the nearest shape so far are passed over.

    Args:
        robot: the robot's `PackedShapes`.
        vertices, centres: of its shapes, from `place_shapes`.
        x, y: the point, m.
    """
    best = np.inf
    for i in range(robot.radius.shape[0]):
        d_x, d_y, far = x - centres[i, 0], y - centres[i, 1], best + robot.bound[i]
        if far > 0.0 and d_x * d_x + d_y * d_y >= far * far:
            continue
        core = closest_on_polygon(vertices, robot.first[i], robot.first[i + 1], x, y)[0]
        best = min(best, core - robot.radius[i])
    return best


@kernel
def self_distance(scene, robot_vertices):
    """Least signed distance between two links that could collide, m (inf if there are none)."""
    robot = scene.robot
    best = np.inf
    for p in range(scene.apart.shape[0]):
        for i in range(robot.radius.shape[0]):
            for k in range(robot.radius.shape[0]):
                if robot.link[i] != scene.apart[p, 0] or robot.link[k] != scene.apart[p, 1]:
                    continue
                a, a_end, b, b_end = robot.first[i], robot.first[i + 1], robot.first[k], robot.first[k + 1]
                core, _, _ = core_distance(robot_vertices, a, a_end, robot_vertices, b, b_end)
                best = min(best, core - robot.radius[i] - robot.radius[k])
    return best


@batch_kernel
def scene_distances(scene, q, pose, distances):
    """Distances of every link to the object at one state, and the robot's distance to itself.

    Args:
        scene: a `PackedScene`.
        q: joint positions, shape (n,).
        pose: the object's x, y, angle, shape (3,).
        distances: output, signed distance of each link to the object, shape (links,), m.

    Returns:
        The least distance between two links that could collide, m.
    """
    frames = np.empty((q.shape[0] + 1, 4))
    object_frame = np.empty((1, 4))
    robot_vertices, object_vertices = np.empty_like(scene.robot.vertices), np.empty_like(scene.object.vertices)
    robot_centres, object_centres = np.empty_like(scene.robot.centre), np.empty_like(scene.object.centre)
    link_frames(scene, q, frames)
    place_shapes(scene.robot, frames, robot_vertices, robot_centres)
    pose_frame(pose, object_frame)
    place_shapes(scene.object, object_frame, object_vertices, object_centres)
    link_distances(scene, robot_vertices, object_vertices, distances)
    return self_distance(scene, robot_vertices)

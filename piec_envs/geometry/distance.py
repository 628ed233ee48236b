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

    Outside a convex polygon the strips in front of its edges and the wedges in front of its corners
    do not overlap: a point in the strip of an edge is nearest to that edge, any other to a corner.

    Args:
        vertices: world vertices, shape (V, 2), m; the polygon owns rows first to last - 1.
        first, last: row range.
        x, y: the point, m.

    Returns:
        (distance, c_x, c_y, n_x, n_y, vertex): distance is negative inside a polygon with area;
        n points from the polygon to the point; vertex is the row of the closest corner, or -1
        where the closest point lies within an edge.
    """
    best, corner, inside = np.inf, first, True
    i = last - 1
    for j in range(first, last):  # a segment is seen from either side: once as edge 0 to 1, once as 1 to 0
        d_x, d_y = x - vertices[i, 0], y - vertices[i, 1]
        e_x, e_y = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
        plane = d_x * e_y - d_y * e_x  # >= 0 outside this edge
        if plane >= 0.0:
            inside = False
            along, length2 = d_x * e_x + d_y * e_y, e_x * e_x + e_y * e_y
            if 0.0 < along < length2:
                length = np.sqrt(length2)
                distance, n_x, n_y = plane / length, e_y / length, -e_x / length
                return distance, x - distance * n_x, y - distance * n_y, n_x, n_y, -1
        square = d_x * d_x + d_y * d_y
        if square < best:
            best, corner = square, i
        i = j
    if inside:
        depth, n_x, n_y = _nearest_side(vertices, first, last, x, y)
        return depth, x - depth * n_x, y - depth * n_y, n_x, n_y, -1
    c_x, c_y, distance = vertices[corner, 0], vertices[corner, 1], np.sqrt(best)
    if distance > ON_BOUNDARY:
        return distance, c_x, c_y, (x - c_x) / distance, (y - c_y) / distance, corner
    n_x, n_y = _corner_normal(vertices, first, last, corner)
    return distance, c_x, c_y, n_x, n_y, corner


@kernel
def _nearest_side(vertices, first, last, x, y):
    """Largest signed distance from a point to an edge's line, and that edge's outward normal."""
    best, n_x, n_y = -np.inf, 1.0, 0.0
    i = last - 1
    for j in range(first, last):
        e_x, e_y = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
        length = np.sqrt(e_x * e_x + e_y * e_y)
        plane = ((x - vertices[i, 0]) * e_y - (y - vertices[i, 1]) * e_x) / length
        if plane > best:
            best, n_x, n_y = plane, e_y / length, -e_x / length
        i = j
    return best, n_x, n_y


@kernel
def _corner_normal(vertices, first, last, i):
    """Outward normal of the edge that begins at a corner ((1, 0) of a lone point)."""
    if last - first == 1:
        return 1.0, 0.0
    j = i + 1 if i + 1 < last else first
    e_x, e_y = vertices[j, 0] - vertices[i, 0], vertices[j, 1] - vertices[i, 1]
    length = np.sqrt(e_x * e_x + e_y * e_y)
    return e_y / length, -e_x / length


@kernel
def _separation(a, a_first, a_last, b, b_first, b_last):
    """Largest gap between b and an edge line of a (-inf for a point), and whether it is their distance.

    Returns:
        (gap, n_x, n_y, met): the edge's outward normal; met where the vertex of b nearest to its line
        lies in front of the edge itself.
    """
    best, n_x, n_y, met = -np.inf, 1.0, 0.0, False
    if a_last - a_first < 2:
        return best, n_x, n_y, met
    i = a_last - 1
    for j in range(a_first, a_last):
        e_x, e_y = a[j, 0] - a[i, 0], a[j, 1] - a[i, 1]
        length2 = e_x * e_x + e_y * e_y
        length = np.sqrt(length2)
        least, nearest = np.inf, -1
        for v in range(b_first, b_last):
            plane = (b[v, 0] - a[i, 0]) * e_y - (b[v, 1] - a[i, 1]) * e_x
            if plane < least:
                least, nearest = plane, v
                if least <= best * length:
                    break  # another edge has a larger gap already
        if least > best * length:
            best, n_x, n_y = least / length, e_y / length, -e_x / length
            along = (b[nearest, 0] - a[i, 0]) * e_x + (b[nearest, 1] - a[i, 1]) * e_y
            met = 0.0 <= along <= length2
        i = j
    return best, n_x, n_y, met


@kernel
def front_of(vertices, first, last, n_x, n_y):
    """Least coordinate of a polygon's vertices along n, m."""
    front = np.inf
    for v in range(first, last):
        front = min(front, vertices[v, 0] * n_x + vertices[v, 1] * n_y)
    return front


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
    gap, g_x, g_y, met = _separation(a, a_first, a_last, b, b_first, b_last)
    gap_b, b_x, b_y, met_b = _separation(b, b_first, b_last, a, a_first, a_last)
    if gap < gap_b:
        gap, g_x, g_y, met = gap_b, -b_x, -b_y, met_b  # the normal points from a to b
    if gap < 0.0 or met:
        return gap, g_x, g_y
    front = front_of(b, b_first, b_last, g_x, g_y)
    best, n_x, n_y = np.inf, 1.0, 0.0
    for v in range(b_first, b_last):
        if b[v, 0] * g_x + b[v, 1] * g_y - front + gap >= best:
            continue  # as far as that from the line along a
        d, _, _, d_x, d_y, _ = closest_on_polygon(a, a_first, a_last, b[v, 0], b[v, 1])
        if d < best:
            best, n_x, n_y = d, d_x, d_y
    for v in range(a_first, a_last):
        if front - a[v, 0] * g_x - a[v, 1] * g_y >= best:
            continue
        d, _, _, d_x, d_y, _ = closest_on_polygon(b, b_first, b_last, a[v, 0], a[v, 1])
        if d < best:
            best, n_x, n_y = d, -d_x, -d_y
    if best <= ON_BOUNDARY:  # touching cores: a corner alone does not know which way is out
        return best, g_x, g_y
    return best, n_x, n_y


@kernel
def link_distances(scene, robot_vertices, object_vertices, pairs, distances):
    """Signed distance from each link to the object.

    Args:
        scene: a `PackedScene`.
        robot_vertices, object_vertices: world vertices from `place_shapes`.
        pairs: output, `core_distance` of each robot shape and object shape, shape (S, K, 3).
        distances: output, shape (links,), m.
    """
    robot, item = scene.robot, scene.object
    for k in range(scene.links):
        distances[k] = np.inf
    for i in range(robot.radius.shape[0]):
        for k in range(item.radius.shape[0]):
            core, n_x, n_y = core_distance(
                robot_vertices, robot.first[i], robot.first[i + 1], object_vertices, item.first[k], item.first[k + 1]
            )
            pairs[i, k, 0], pairs[i, k, 1], pairs[i, k, 2] = core, n_x, n_y
            gap = core - robot.radius[i] - item.radius[k]
            distances[robot.link[i]] = min(distances[robot.link[i]], gap)


@batch_kernel
def make_pairs(scene):
    """Room for `pairs` of `link_distances`."""
    return np.empty((scene.robot.radius.shape[0], scene.object.radius.shape[0], 3))


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
    link_distances(scene, robot_vertices, object_vertices, make_pairs(scene), distances)
    return self_distance(scene, robot_vertices)

"""Signed distances and closest points of points and convex polygons: the cores of rounded shapes.

Two disjoint convex cores are nearest at a vertex of one of them, so vertices against edges are all
it takes; overlapping cores are measured by their least separating translation.
"""

from __future__ import annotations

import numpy as np

from piec_envs.kernels import kernel

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
    # a segment is seen from either side: once as edge 0 to 1, once as 1 to 0
    for j in range(first, last):
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
    """Largest gap between b and an edge line of a (-inf for a point), and whether it is their
    distance.

    Returns:
        (gap, n_x, n_y, met): the edge's outward normal; met where the vertex of b nearest to its
        line lies in front of the edge itself.
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
    """Least coordinate of a polygon's vertices along a direction.

    Args:
        vertices: shape (V, 2), m; the polygon owns rows first to last - 1.
        first, last: row range.
        n_x, n_y: the direction, of length 1.

    Returns:
        The coordinate, m.
    """
    front = np.inf
    for v in range(first, last):
        front = min(front, vertices[v, 0] * n_x + vertices[v, 1] * n_y)
    return front


@kernel
def core_distance(a, a_first, a_last, b, b_first, b_last):
    """Signed distance of two convex cores and the normal from a to b.

    Args:
        a, b: world vertices of the two polygons, shape (V, 2) each, m.
        a_first, a_last: row range of the first.
        b_first, b_last: row range of the second.

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

"""The escape time between the nodes of the grid.

Where the point and the four nodes around it lie on the same side of the wall, T - T_0 is
interpolated bilinearly (it is zero wherever nothing is in the way). Elsewhere some of the nodes lie
behind a jump of T, and the point takes Bellman's step instead: T(p) = min over y of T(y) + the time
from p straight to y at the true speed, with y on the four nodes and the ring of twelve around them,
as far as they lie outside the wall. A disc pressed on a link is so not taken for an enclosed one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.escape.speed import PackedSpeed, slowness
from piec_envs.escape.sweeping import FAR
from piec_envs.geometry.polygon import closest_on_polygon
from piec_envs.kernels import kernel

SAMPLES = 4  # of the slowness along a straight step
# (13, 2) the nodes around cell (0, 0) and its corners, in a closed loop: row, column
RING = np.array(
    [
        (-1, -1),
        (-1, 0),
        (-1, 1),
        (-1, 2),
        (0, 2),
        (1, 2),
        (2, 2),
        (2, 1),
        (2, 0),
        (2, -1),
        (1, -1),
        (0, -1),
        (-1, -1),
    ]
)


class Field(NamedTuple):
    """One solved configuration; everything is relative to the robot's base."""

    radius: float  # m
    h: float  # m
    start: float  # coordinate of the first grid line, m
    speed: PackedSpeed  # the numbers of a `SpeedModel`
    # (S + 1,) shapes of the robot, as in `PackedShapes`; S = 0: only `distance` is known
    first: np.ndarray
    round: np.ndarray  # (S,) their radius, m
    vertices: np.ndarray  # (V, 2) m
    time: np.ndarray  # (N, N) s
    distance: np.ndarray  # (N, N) m


@kernel
def _interpolated(field, x, y):
    """Signed distance at (x, y), bilinearly between the nodes, m."""
    across, along = (x - field.start) / field.h, (y - field.start) / field.h
    i, j, d = int(along), int(across), field.distance
    a, b = across - j, along - i
    low, high = (
        d[i, j] + a * (d[i, j + 1] - d[i, j]),
        d[i + 1, j] + a * (d[i + 1, j + 1] - d[i + 1, j]),
    )
    return low + b * (high - low)


@kernel
def distance_at(field, x, y):
    """Signed distance from a point to the robot: `point_distance` without the closest point.

    Args:
        field: a `Field`.
        x, y: the point, m.

    Returns:
        The distance, m; between the nodes of `field.distance` where the field has no shapes.
    """
    if field.round.shape[0] == 0:
        return _interpolated(field, x, y)
    first, radius, corners = field.first, field.round, field.vertices
    best = np.inf
    for i in range(radius.shape[0]):
        a, b = first[i], first[i + 1] - 1
        if b - a > 1:
            d = closest_on_polygon(corners, a, b + 1, x, y)[0]
        else:
            e_x, e_y = corners[b, 0] - corners[a, 0], corners[b, 1] - corners[a, 1]
            d_x, d_y = x - corners[a, 0], y - corners[a, 1]
            length2 = e_x * e_x + e_y * e_y
            t = min(max((d_x * e_x + d_y * e_y) / length2, 0.0), 1.0) if length2 > 0.0 else 0.0
            d = np.sqrt((d_x - t * e_x) ** 2 + (d_y - t * e_y) ** 2)
        best = min(best, d - radius[i])
    return best


@kernel
def _straight_time(field, x, y, to_x, to_y):
    """Time of the straight line between two points at the true speed, s."""
    total = 0.0
    for k in range(SAMPLES):
        w = (k + 0.5) / SAMPLES
        total += slowness(field.speed, distance_at(field, x + w * (to_x - x), y + w * (to_y - y)))
    return total / SAMPLES * np.hypot(to_x - x, to_y - y)


@kernel
def _best_share(gap, along, across, h, slow):
    """Minimiser over w in [0, 1] of w gap + slow |(along - w h, across)|, the point of an edge to
    aim at.
    """
    if gap >= slow * h:
        return 0.0
    if gap <= -slow * h:
        return 1.0
    w = along / h - gap * across / (h * np.sqrt(slow * slow * h * h - gap * gap))
    return min(max(w, 0.0), 1.0)


@kernel
def _usable(field, i, j, walled):
    """T of node (i, j), or FAR where it lies in the wall and the wall is not to be used."""
    return field.time[i, j] if walled or field.distance[i, j] > field.speed.d0 else FAR


@kernel
def _better(field, x, y, start, to_x, to_y, best):
    """The lesser of `best` = (T, to_x, to_y) and the straight step to a point where T is
    `start`.
    """
    if start + np.hypot(to_x - x, to_y - y) / field.speed.u_bar >= best[0]:
        return best
    t = start + _straight_time(field, x, y, to_x, to_y)
    return (t, to_x, to_y) if t < best[0] else best


@kernel
def _bellman(field, x, y, i, j, walled):
    """(T, to_x, to_y): the best straight step from a point in cell (i, j) to the nodes and edges
    around it.
    """
    h, best = field.h, (FAR, x, y)
    slow = slowness(field.speed, distance_at(field, x, y))
    for k in range(12):
        i_a, j_a, i_b, j_b = i + RING[k, 0], j + RING[k, 1], i + RING[k + 1, 0], j + RING[k + 1, 1]
        a, b = _usable(field, i_a, j_a, walled), _usable(field, i_b, j_b, walled)
        a_x, a_y, e_x, e_y = field.start + j_a * h, field.start + i_a * h, j_b - j_a, i_b - i_a
        if a < FAR and b < FAR:
            along = (x - a_x) * e_x + (y - a_y) * e_y
            across = abs((x - a_x) * e_y - (y - a_y) * e_x)
            w = _best_share(b - a, along, across, h, slow)
            best = _better(field, x, y, a + w * (b - a), a_x + w * e_x * h, a_y + w * e_y * h, best)
        elif a < FAR:  # the other end comes with the next edge or came with the one before
            best = _better(field, x, y, a, a_x, a_y, best)
    for k in range(4):
        i_a, j_a = i + k // 2, j + k % 2
        a = _usable(field, i_a, j_a, walled)
        if a < FAR:
            best = _better(field, x, y, a, field.start + j_a * h, field.start + i_a * h, best)
    return best


@kernel
def _bilinear(field, x, y, i, j, r):
    """(T, dT/dx, dT/dy) in cell (i, j): T_0 plus the bilinear interpolation of T - T_0."""
    h, u_bar = field.h, field.speed.u_bar
    x_0, y_0 = field.start + j * h, field.start + i * h
    v_00 = field.time[i, j] - (field.radius - np.hypot(x_0, y_0)) / u_bar
    v_01 = field.time[i, j + 1] - (field.radius - np.hypot(x_0 + h, y_0)) / u_bar
    v_10 = field.time[i + 1, j] - (field.radius - np.hypot(x_0, y_0 + h)) / u_bar
    v_11 = field.time[i + 1, j + 1] - (field.radius - np.hypot(x_0 + h, y_0 + h)) / u_bar
    a, b = (x - x_0) / h, (y - y_0) / h
    low, high = v_00 + a * (v_01 - v_00), v_10 + a * (v_11 - v_10)
    slope_x = ((v_01 - v_00) + b * ((v_11 - v_10) - (v_01 - v_00))) / h
    slope_y = (high - low) / h
    scale = 1.0 / (r * u_bar) if r > 0.0 else 0.0
    return (
        (field.radius - r) / u_bar + low + b * (high - low),
        slope_x - x * scale,
        slope_y - y * scale,
    )


@kernel
def _even(field, i, j, in_wall):
    """Whether the four nodes of cell (i, j) are reachable and all on the stated side of the
    wall.
    """
    for k in range(4):
        a, b = i + k // 2, j + k % 2
        if (field.distance[a, b] <= field.speed.d0) != in_wall or field.time[a, b] >= FAR:
            return False
    return True


@kernel
def value(field, x, y):
    """Escape time at a point and the direction in which it falls fastest.

    Args:
        field: a `Field`.
        x, y: the point relative to the base, m.

    Returns:
        (T, e_x, e_y): s and a unit vector; (0, 0, 0) outside the disc, (inf, 0, 0) where nothing
        leads out.
    """
    r = np.hypot(x, y)
    if r >= field.radius:
        return 0.0, 0.0, 0.0
    in_wall = distance_at(field, x, y) <= field.speed.d0
    if in_wall and field.speed.leak == 0.0:
        return np.inf, 0.0, 0.0
    i, j = int((y - field.start) / field.h), int((x - field.start) / field.h)
    if _even(field, i, j, in_wall):
        t, g_x, g_y = _bilinear(field, x, y, i, j, r)
        e_x, e_y = -g_x, -g_y
    else:
        t, e_x, e_y = _bellman(field, x, y, i, j, in_wall)
        # a pocket without a free node: out through the wall
        if t >= FAR and field.speed.leak > 0.0:
            t, e_x, e_y = _bellman(field, x, y, i, j, not in_wall)
        if t >= FAR:
            return np.inf, 0.0, 0.0
        e_x, e_y = e_x - x, e_y - y
    norm = np.hypot(e_x, e_y)
    scale = 1.0 / norm if norm > 0.0 else 0.0
    return max(t, (field.radius - r) / field.speed.u_bar), e_x * scale, e_y * scale


@kernel
def point_gradient(field, x, y, t, e_x, e_y):
    """dT/dp at a point: against the descent, of norm 1/u; 0 where T is 0 or inf.

    Args:
        field: a `Field`.
        x, y: the point relative to the base, m.
        t, e_x, e_y: its `value`.

    Returns:
        (g_x, g_y), s/m.
    """
    if not 0.0 < t < np.inf:
        return 0.0, 0.0
    slow = slowness(field.speed, distance_at(field, x, y))
    return -e_x * slow, -e_y * slow

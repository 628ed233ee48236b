"""Fastest escape paths, and the gradient of the escape time in q_r by integration along them.

T is the integral of the slowness kappa(d(p, q_r)) along the fastest path, and that path is optimal,
so only the medium's change counts (envelope theorem):

    dT/dq = integral of kappa'(d) dd/dq ds,    dd/dq = -n . J of the closest surface point.

Where the only way out leads through a leaky wall, the motion of the wall's edges is left out: a
path enters and leaves one link by two jumps that nearly cancel, and their difference on a grid is
noise.
"""

from __future__ import annotations

import numpy as np

from piec_envs.escape.between import distance_at, value
from piec_envs.escape.speed import slowness, slowness_slope
from piec_envs.escape.sweeping import FAR
from piec_envs.geometry.body import point_distance
from piec_envs.geometry.kinematics import point_velocity
from piec_envs.kernels import batch_kernel, kernel

PATH_STEP = 0.5  # length of a step, in cells, of a path to be shown
GRADIENT_STEP = 1.0  # and of one to be integrated along
MAX_STEPS_PER_NODE = 40  # a path has at most this many steps per grid line


@kernel
def _lower_node(field, x, y, t):
    """The node around a point that is lower than t and quickest to leave by, as (T, x, y)."""
    i, j = int((y - field.start) / field.h), int((x - field.start) / field.h)
    best, b_t, b_x, b_y = np.inf, FAR, x, y
    for k in range(16):
        a, b = i - 1 + k // 4, j - 1 + k % 4
        n_t, n_x, n_y = field.time[a, b], field.start + b * field.h, field.start + a * field.h
        if n_t < t:
            total = n_t + np.hypot(n_x - x, n_y - y) * slowness(
                field.speed, distance_at(field, x, y)
            )
            if total < best:
                best, b_t, b_x, b_y = total, n_t, n_x, n_y
    return b_t, b_x, b_y


@kernel
def _clip_to_circle(radius, x, y, to_x, to_y):
    """The point where the segment from (x, y), inside, to an outside point meets the circle."""
    d_x, d_y = to_x - x, to_y - y
    a, b, c = d_x * d_x + d_y * d_y, x * d_x + y * d_y, x * x + y * y - radius * radius
    w = (-b + np.sqrt(b * b - a * c)) / a
    n_x, n_y = x + w * d_x, y + w * d_y
    # on the outer side of rounding, where T is 0
    scale = radius * (1.0 + 1e-15) / np.hypot(n_x, n_y)
    return scale * n_x, scale * n_y


@kernel
def advance(field, length, x, y, t, e_x, e_y):
    """One step down the field: along the descent, or to a lower node where that does not go down.

    Args:
        field: a `Field`.
        length: of the step, m.
        x, y, t, e_x, e_y: a point inside the disc and its `value`.

    Returns:
        The same five of the next point; T = 0 on the circle, T = inf if there is no way down.
    """
    for _ in range(3 if e_x != 0.0 or e_y != 0.0 else 0):
        _, m_x, m_y = value(field, x + 0.5 * length * e_x, y + 0.5 * length * e_y)  # midpoint rule
        if m_x == 0.0 and m_y == 0.0:
            m_x, m_y = e_x, e_y
        n_x, n_y = x + length * m_x, y + length * m_y
        if np.hypot(n_x, n_y) >= field.radius:
            n_x, n_y = _clip_to_circle(field.radius, x, y, n_x, n_y)
            return n_x, n_y, 0.0, 0.0, 0.0
        n_t, n_ex, n_ey = value(field, n_x, n_y)
        if n_t < t:
            return n_x, n_y, n_t, n_ex, n_ey
        length *= 0.5
    n_t, n_x, n_y = _lower_node(field, x, y, t)
    if n_t >= FAR:
        return x, y, np.inf, 0.0, 0.0
    if n_t <= 0.0:
        n_x, n_y = _clip_to_circle(field.radius, x, y, n_x, n_y)
        return n_x, n_y, 0.0, 0.0, 0.0
    n_t, n_ex, n_ey = value(field, n_x, n_y)
    return n_x, n_y, n_t, n_ex, n_ey


@kernel
def trace(field, x, y, path):
    """Fastest path from a point to the circle.

    Args:
        field: a `Field`.
        x, y: the start relative to the base, m.
        path: output, shape (m, 2), m; MAX_STEPS_PER_NODE rows per grid line are enough.

    Returns:
        The number of points written: 1 where nothing leads out or the start is outside.
    """
    path[0, 0], path[0, 1] = x, y
    count = 1
    t, e_x, e_y = value(field, x, y)
    while 0.0 < t < np.inf and count < path.shape[0]:
        x, y, t, e_x, e_y = advance(field, PATH_STEP * field.h, x, y, t, e_x, e_y)
        if t < np.inf:
            path[count, 0], path[count, 1] = x, y
            count += 1
    return count


@kernel
def _add_segment(robot, base, frames, field, x, y, to_x, to_y, out):
    """Add one segment's share of dT/dq to `out`, shape (n,)."""
    length = np.hypot(to_x - x, to_y - y)
    d, shape, s_x, s_y, n_x, n_y = point_distance(
        robot.shapes, field.vertices, 0.5 * (x + to_x), 0.5 * (y + to_y)
    )
    weight = slowness_slope(field.speed, d) * length
    for j in range(base, robot.shapes.frame[shape]):
        v_x, v_y = point_velocity(robot, frames, j, s_x, s_y)
        out[j] -= weight * (n_x * v_x + n_y * v_y)


@batch_kernel
def configuration_gradient(robot, base, frames, field, point, out):
    """dT/dq_r at a point, by the envelope theorem along its escape path.

    Args:
        robot: a `PackedRobot`.
        base: number of leading joints that only move the base.
        frames: relative to the base, shape (n + 1, 4).
        field: a `Field`.
        point: (x, y) relative to the base, m.
        out: output, shape (n,), s/rad or s/m; zero where T is 0 or inf, and for the base's joints.
    """
    out[:] = 0.0
    x, y = point
    t, e_x, e_y = value(field, x, y)
    steps = MAX_STEPS_PER_NODE * field.time.shape[0]
    while 0.0 < t < np.inf and steps > 0:
        steps -= 1
        to_x, to_y, t, e_x, e_y = advance(field, GRADIENT_STEP * field.h, x, y, t, e_x, e_y)
        _add_segment(robot, base, frames, field, x, y, to_x, to_y, out)
        x, y = to_x, to_y

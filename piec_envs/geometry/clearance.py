"""Clearances of a posture and their gradients in the joints: link to object shape, link to link.

The distance of two bodies changes as n . (v_b - v_a), where n points from a to b and v are the
velocities of either body at one common point of the line of contact: any point of that line will
do, since moving along n changes no turning body's velocity in the direction of n. So rounding plays
no part, and overlapping bodies need nothing of their own.
"""

from __future__ import annotations

import numpy as np

from piec_envs.geometry.body import make_placed, place_object, place_robot
from piec_envs.geometry.kinematics import point_velocity
from piec_envs.geometry.polygon import core_distance
from piec_envs.kernels import batch_kernel, kernel

FLUSH = 1e-9  # m; vertices this far behind the foremost one still count as touching


@kernel
def _support(vertices, first, last, n_x, n_y):
    """Mean of the foremost vertices of a polygon in direction n, and how many they are."""
    front = -np.inf
    for v in range(first, last):
        front = max(front, vertices[v, 0] * n_x + vertices[v, 1] * n_y)
    x, y, count = 0.0, 0.0, 0
    for v in range(first, last):
        if vertices[v, 0] * n_x + vertices[v, 1] * n_y >= front - FLUSH:
            x, y, count = x + vertices[v, 0], y + vertices[v, 1], count + 1
    return x / count, y / count, count


@kernel
def _witness(a, a_first, a_last, b, b_first, b_last, n_x, n_y):
    """A point of the line along n through the closest points: a corner of a, or else of b."""
    x, y, count = _support(a, a_first, a_last, n_x, n_y)
    if count > 1:
        x, y, _ = _support(b, b_first, b_last, -n_x, -n_y)
    return x, y


@kernel
def _add_motion(robot, frames, frame, x, y, n_x, n_y, slope):
    """Add n . (velocity of the point (x, y) of a link in that frame) for every joint, shape
    (n,).
    """
    for j in range(frame):
        v_x, v_y = point_velocity(robot, frames, j, x, y)
        slope[j] += n_x * v_x + n_y * v_y


@kernel
def _object_clearances(scene, placed, phi, slope):
    """Fill the first links * shapes entries of phi (m,) and, where it has columns, slope (m, n)."""
    arm, item = scene.robot.shapes, scene.object.shapes
    vertices, object_vertices = placed.robot_vertices, placed.object_vertices
    for i in range(arm.radius.shape[0]):
        a, a_end = arm.first[i], arm.first[i + 1]
        for k in range(item.radius.shape[0]):
            b, b_end = item.first[k], item.first[k + 1]
            core, n_x, n_y = core_distance(vertices, a, a_end, object_vertices, b, b_end)
            gap = core - arm.radius[i] - item.radius[k]
            row = arm.link[i] * item.radius.shape[0] + k
            if gap >= phi[row]:
                continue
            phi[row] = gap
            if slope.shape[1] > 0:
                x, y = _witness(vertices, a, a_end, object_vertices, b, b_end, n_x, n_y)
                slope[row] = 0.0
                _add_motion(scene.robot, placed.frames, arm.frame[i], x, y, -n_x, -n_y, slope[row])


@kernel
def _self_clearances(scene, placed, pairs, phi, slope):
    """Fill the last entries of phi, one for each pair of links (P, 2), and of slope likewise."""
    arm, before, vertices = scene.robot.shapes, phi.shape[0] - pairs.shape[0], placed.robot_vertices
    for p in range(pairs.shape[0]):
        for i in range(arm.radius.shape[0]):
            for k in range(arm.radius.shape[0]):
                if arm.link[i] != pairs[p, 0] or arm.link[k] != pairs[p, 1]:
                    continue
                a, a_end, b, b_end = arm.first[i], arm.first[i + 1], arm.first[k], arm.first[k + 1]
                core, n_x, n_y = core_distance(vertices, a, a_end, vertices, b, b_end)
                gap = core - arm.radius[i] - arm.radius[k]
                if gap >= phi[before + p]:
                    continue
                phi[before + p] = gap
                if slope.shape[1] > 0:
                    x, y = _witness(vertices, a, a_end, vertices, b, b_end, n_x, n_y)
                    slope[before + p] = 0.0
                    _add_motion(
                        scene.robot,
                        placed.frames,
                        arm.frame[i],
                        x,
                        y,
                        -n_x,
                        -n_y,
                        slope[before + p],
                    )
                    _add_motion(
                        scene.robot, placed.frames, arm.frame[k], x, y, n_x, n_y, slope[before + p]
                    )


@batch_kernel
def clearance_rows(lo, hi, scene, pairs, pose, q, phi, slope):
    """Signed distances of rows lo to hi - 1.

    Args:
        lo, hi: row range.
        scene: a `Scene`.
        pairs: links to hold apart, shape (P, 2), such as `scene.robot.apart`.
        pose: object poses, shape (B, 3), m and rad.
        q: joint positions, shape (B, n).
        phi: output, shape (B, links * shapes + P), m: link by link the distance to each of the
            object's shapes, then the pairs; negative on overlap.
        slope: output, dphi_dq, shape (B, links * shapes + P, n), or without columns to leave it
            out.
    """
    placed = make_placed(scene)
    for row in range(lo, hi):
        place_robot(scene.robot, q[row], placed)
        place_object(scene.object, pose[row], placed)
        phi[row] = np.inf
        _object_clearances(scene, placed, phi[row], slope[row])
        _self_clearances(scene, placed, pairs, phi[row], slope[row])

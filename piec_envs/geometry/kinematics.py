"""Poses of the robot's frames and of every vertex, and Jacobians of points on the robot."""

from __future__ import annotations

import numpy as np

from piec_envs.kernels import inlined_kernel, kernel


@inlined_kernel
def link_frames(robot, q, frames):
    """Pose of the base and of the frame after each joint.

    Args:
        robot: a `PackedRobot`.
        q: joint positions, shape (n,), rad or m.
        frames: output, shape (n + 1, 4): x, y, cos, sin of each frame.
    """
    x, y, angle = 0.0, 0.0, 0.0
    frames[0, 0], frames[0, 1], frames[0, 2], frames[0, 3] = x, y, 1.0, 0.0
    for j in range(q.shape[0]):
        c, s = frames[j, 2], frames[j, 3]
        origin, axis = robot.joint_origin[j], robot.joint_axis[j]
        x += c * origin[0] - s * origin[1]
        y += s * origin[0] + c * origin[1]
        angle += origin[2] + axis[2] * q[j]
        c, s = np.cos(angle), np.sin(angle)
        x += (c * axis[0] - s * axis[1]) * q[j]
        y += (s * axis[0] + c * axis[1]) * q[j]
        frames[j + 1, 0], frames[j + 1, 1], frames[j + 1, 2], frames[j + 1, 3] = x, y, c, s


@inlined_kernel
def place_shapes(shapes, frames, vertices, centres):
    """Vertices and bounding-circle centres of packed shapes in the world.

    Args:
        shapes: a `PackedShapes`.
        frames: poses of the frames that the shapes are fixed in, shape (F, 4).
        vertices: output, shape (V, 2), m.
        centres: output, shape (S, 2), m.
    """
    for i in range(shapes.radius.shape[0]):
        f = shapes.frame[i]
        x, y, c, s = frames[f, 0], frames[f, 1], frames[f, 2], frames[f, 3]
        centres[i, 0] = x + c * shapes.centre[i, 0] - s * shapes.centre[i, 1]
        centres[i, 1] = y + s * shapes.centre[i, 0] + c * shapes.centre[i, 1]
        for v in range(shapes.first[i], shapes.first[i + 1]):
            vertices[v, 0] = x + c * shapes.vertices[v, 0] - s * shapes.vertices[v, 1]
            vertices[v, 1] = y + s * shapes.vertices[v, 0] + c * shapes.vertices[v, 1]


@inlined_kernel
def pose_frame(pose, frames):
    """Frame of a pose.

    Args:
        pose: x, y, angle, shape (3,), m and rad.
        frames: output, x, y (m), cos and sin, shape (1, 4).
    """
    frames[0, 0], frames[0, 1] = pose[0], pose[1]
    frames[0, 2], frames[0, 3] = np.cos(pose[2]), np.sin(pose[2])


@inlined_kernel
def point_velocity(robot, frames, j, x, y):
    """Velocity of a point fixed beyond joint j per unit speed of that joint.

    Args:
        robot: a `PackedRobot`.
        frames: from `link_frames`.
        j: joint index.
        x, y: the point in the world, m.

    Returns:
        The j-th column (v_x, v_y) of the point's Jacobian, m/rad or m/m.
    """
    axis = robot.joint_axis[j]
    c, s = frames[j + 1, 2], frames[j + 1, 3]
    v_x = c * axis[0] - s * axis[1] - axis[2] * (y - frames[j + 1, 1])
    v_y = s * axis[0] + c * axis[1] + axis[2] * (x - frames[j + 1, 0])
    return v_x, v_y


@kernel
def base_gradient(robot, frames, base, p_x, p_y, dq):
    """Gradient in the joints that move the base, against whose motion a point moves relative to it.

    Args:
        robot: a `PackedRobot`.
        frames: from `link_frames`, up to that after the leading joints at least.
        base: number of leading joints that move the base.
        p_x, p_y: gradient in the point.
        dq: output, shape (n,); the first `base` entries are written.
    """
    for j in range(base):
        axis, c, s = robot.joint_axis[j], frames[j + 1, 2], frames[j + 1, 3]
        dq[j] = -p_x * (c * axis[0] - s * axis[1]) - p_y * (s * axis[0] + c * axis[1])

"""Contact points of the arm and the object, and their Jacobians."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.geometry.body import measure_pair
from piec_envs.geometry.kinematics import point_velocity
from piec_envs.geometry.polygon import closest_on_polygon, front_of
from piec_envs.kernels import batch_kernel, inlined_kernel

MAX_CONTACTS = 32  # the nearest ones are kept; a step has at most about ten within its margin


class Contacts(NamedTuple):
    """Contact points of one state; the first `number[0]` rows are valid."""

    number: np.ndarray  # (1,) int64
    gap: np.ndarray  # (C,) signed distance phi, m
    normal: np.ndarray  # (C, 2) from the robot to the object
    on_robot: np.ndarray  # (C, 2) m
    on_object: np.ndarray  # (C, 2) m
    frame: np.ndarray  # (C,) int64, robot frame of the touching shape
    link: np.ndarray  # (C,) int64


@batch_kernel
def make_contacts():
    """Empty contact buffers."""
    return Contacts(
        np.zeros(1, dtype=np.int64),
        np.empty(MAX_CONTACTS),
        np.empty((MAX_CONTACTS, 2)),
        np.empty((MAX_CONTACTS, 2)),
        np.empty((MAX_CONTACTS, 2)),
        np.empty(MAX_CONTACTS, dtype=np.int64),
        np.empty(MAX_CONTACTS, dtype=np.int64),
    )


@inlined_kernel
def _add_contact(contacts, gap, r_x, r_y, o_x, o_y, n_x, n_y, frame, link):
    """Store a contact; when the buffers are full it replaces the farthest one if it is nearer."""
    i = contacts.number[0]
    if i == MAX_CONTACTS:
        i = int(np.argmax(contacts.gap))
        if gap >= contacts.gap[i]:
            return
    else:
        contacts.number[0] += 1
    contacts.gap[i] = gap
    contacts.normal[i, 0], contacts.normal[i, 1] = n_x, n_y
    contacts.on_robot[i, 0], contacts.on_robot[i, 1] = r_x, r_y
    contacts.on_object[i, 0], contacts.on_object[i, 1] = o_x, o_y
    contacts.frame[i], contacts.link[i] = frame, link


@inlined_kernel
def _object_vertices(scene, i, k, placed, nearest, front, reach, contacts):
    """Vertices of object shape k on edges of robot shape i, and mutual vertex-to-vertex pairs."""
    robot, item = scene.robot.shapes, scene.object.shapes
    robot_vertices, object_vertices = placed.robot_vertices, placed.object_vertices
    first, last, r_a, r_b = item.first[k], item.first[k + 1], robot.radius[i], item.radius[k]
    for v in range(first, last):
        x, y = object_vertices[v, 0], object_vertices[v, 1]
        if x * nearest[1] + y * nearest[2] - front + nearest[0] >= reach:
            continue
        d, c_x, c_y, n_x, n_y, corner = closest_on_polygon(
            robot_vertices, robot.first[i], robot.first[i + 1], x, y
        )
        if d >= reach:
            continue
        if corner >= 0:
            back = closest_on_polygon(object_vertices, first, last, c_x, c_y)
            if back[5] != v:
                continue  # the corner is nearer to another part of the object
        _add_contact(
            contacts, d - r_a - r_b, c_x + r_a * n_x, c_y + r_a * n_y, x - r_b * n_x, y - r_b * n_y,
            n_x, n_y, robot.frame[i], robot.link[i],
        )  # fmt: skip


@inlined_kernel
def _robot_vertices(scene, i, k, placed, nearest, front, reach, contacts):
    """Vertices of robot shape i on edges of object shape k."""
    robot, item = scene.robot.shapes, scene.object.shapes
    robot_vertices, object_vertices = placed.robot_vertices, placed.object_vertices
    first, last, r_a, r_b = item.first[k], item.first[k + 1], robot.radius[i], item.radius[k]
    for v in range(robot.first[i], robot.first[i + 1]):
        x, y = robot_vertices[v, 0], robot_vertices[v, 1]
        if front - x * nearest[1] - y * nearest[2] >= reach:
            continue
        d, c_x, c_y, n_x, n_y, corner = closest_on_polygon(object_vertices, first, last, x, y)
        if d >= reach or corner >= 0:
            continue  # vertex-to-vertex pairs are found from the object's side
        _add_contact(
            contacts, d - r_a - r_b, x - r_a * n_x, y - r_a * n_y, c_x + r_b * n_x, c_y + r_b * n_y,
            -n_x, -n_y, robot.frame[i], robot.link[i],
        )  # fmt: skip


@inlined_kernel
def _disc_contact(scene, i, k, placed, nearest, contacts):
    """The one contact of robot shape i and a disc, which has no edges."""
    robot, item = scene.robot.shapes, scene.object.shapes
    core, n_x, n_y = nearest
    x, y = placed.object_vertices[item.first[k], 0], placed.object_vertices[item.first[k], 1]
    r_a, r_b = robot.radius[i], item.radius[k]
    to_robot = core - r_a
    _add_contact(
        contacts, core - r_a - r_b, x - to_robot * n_x, y - to_robot * n_y,
        x - r_b * n_x, y - r_b * n_y, n_x, n_y, robot.frame[i], robot.link[i],
    )  # fmt: skip


@inlined_kernel
def find_contacts(scene, placed, margin, contacts):
    """Fill `contacts` with all contact points nearer than `margin`: vertices on edges, and mutual
    pairs of vertices.

    The normal of two shapes' distance is that of a line between them, and a vertex is as far from
    the other shape as from its front at least: most need no search.

    Args:
        scene: a `Scene`.
        placed: from `place_scene`.
        margin: m.
        contacts: output buffers from `make_contacts`.
    """
    robot, item = scene.robot.shapes, scene.object.shapes
    contacts.number[0] = 0
    for i in range(robot.radius.shape[0]):
        for k in range(item.radius.shape[0]):
            pair, reach = placed.pairs[i, k], margin + robot.radius[i] + item.radius[k]
            if pair[0] >= reach:
                continue
            if pair[1] == 0.0 and pair[2] == 0.0:  # a lower bound
                measure_pair(scene, i, k, placed)
                if pair[0] >= reach:
                    continue
            nearest = pair[0], pair[1], pair[2]
            first, last = item.first[k], item.first[k + 1]
            if last - first == 1:
                _disc_contact(scene, i, k, placed, nearest, contacts)
                continue
            front = front_of(placed.object_vertices, first, last, nearest[1], nearest[2])
            _object_vertices(scene, i, k, placed, nearest, front, reach, contacts)
            _robot_vertices(scene, i, k, placed, nearest, front, reach, contacts)


@inlined_kernel
def contact_rows(scene, frames, pose, contacts, friction, rows):
    """Constraint rows J_n -/+ mu J_t of eq. 11, two for each contact.

    Args:
        scene: a `Scene`.
        frames: the robot's frames from `link_frames`.
        pose: the object's x, y, angle, shape (3,), m and rad.
        contacts: from `find_contacts`.
        friction: mu.
        rows: output, shape (2 number, n + 3) at least; columns are the joints, then x, y, angle.
    """
    n = scene.robot.stiffness.shape[0]
    for i in range(contacts.number[0]):
        n_x, n_y = friction * contacts.normal[i, 0], friction * contacts.normal[i, 1]
        r_x, r_y = contacts.on_robot[i, 0], contacts.on_robot[i, 1]
        arm_x, arm_y = contacts.on_object[i, 0] - pose[0], contacts.on_object[i, 1] - pose[1]
        # J_n +/- mu J_t project on the normal plus or minus mu times the tangent (-n_y, n_x)
        a_x, a_y = contacts.normal[i, 0] + n_y, contacts.normal[i, 1] - n_x
        b_x, b_y = contacts.normal[i, 0] - n_y, contacts.normal[i, 1] + n_x
        a, b = rows[2 * i], rows[2 * i + 1]
        moved = contacts.frame[i]  # joints before it move the contact point
        for j in range(moved):
            v_x, v_y = point_velocity(scene.robot, frames, j, r_x, r_y)
            a[j], b[j] = -(a_x * v_x + a_y * v_y), -(b_x * v_x + b_y * v_y)
        for j in range(moved, n):
            a[j] = b[j] = 0.0
        a[n], a[n + 1], a[n + 2] = a_x, a_y, a_y * arm_x - a_x * arm_y
        b[n], b[n + 1], b[n + 2] = b_x, b_y, b_y * arm_x - b_x * arm_y

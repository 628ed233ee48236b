"""The compiled quasi-dynamic step and rollout (paper eq. 11)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.active_set import DualScratch, make_dual, solve_dual
from piec_envs.dynamics.base import CONTROL_PERIOD, POSITION_LIMIT, TOUCH_DISTANCE
from piec_envs.dynamics.contacts import MAX_CONTACTS, Contacts, contact_rows, find_contacts, make_contacts
from piec_envs.dynamics.rigid import FAILED
from piec_envs.geometry.distance import link_distances, make_pairs
from piec_envs.geometry.kinematics import link_frames, place_shapes, pose_frame
from piec_envs.kernels import batch_kernel, kernel

MASS_MATRIX = (0.1, 0.1, 0.042)  # M_o: the QP's regulariser, not a physical inertia
REGULARISER = 10.0  # epsilon
MARGIN_FACTOR = 1.5  # contacts nearer than this many times the largest motion of a step are kept
SHORT_LEVER = 0.02  # m; at which joints can push an overlap out where nothing gives
ROUNDING = 1e-6  # of the energy of a step


class ContactModel(NamedTuple):
    """Settings of the quasi-dynamic model.

    Args:
        own_inertia: whether the object turns as an even solid of its shape, M_o,theta = M_o,x rho^2 with rho its
            radius of gyration, instead of with the paper's 0.042, which is far stiffer for all our objects;
            each row's plant says so.
        compliance: c relative to the largest diagonal entry of the dual matrix; 0 is rigid.
        push_out: largest overlap that one step resolves, m.
        state_noise: whether a displacement moves the pose before the QP (the paper's literal
            reading) instead of entering the QP as the object's free motion.
        unlimited_lead: whether the command may run ahead of a stalled joint without limit.
    """

    compliance: float = 1e-4
    push_out: float = 0.01
    state_noise: bool = False
    unlimited_lead: bool = False
    own_inertia: bool = False


PAPER_MODEL = ContactModel(compliance=0.0, unlimited_lead=True)


class _Workspace(NamedTuple):
    """Scratch of one thread, so that no step allocates."""

    frames: np.ndarray  # (n + 1, 4)
    object_frame: np.ndarray  # (1, 4)
    robot_vertices: np.ndarray
    robot_centres: np.ndarray
    object_vertices: np.ndarray
    object_centres: np.ndarray
    pairs: np.ndarray  # of `link_distances`
    contacts: Contacts
    weight: np.ndarray  # (n + 3,) diagonal of Q
    free: np.ndarray  # (n + 3,) Q^-1 b
    rows: np.ndarray  # (2 C, n + 3) A
    value: np.ndarray  # (2 C,) A Q^-1 b + phi
    dual: DualScratch


@batch_kernel
def make_workspace(scene, model):
    """Scratch for one scene and model."""
    n, m = scene.stiffness.shape[0], 2 * MAX_CONTACTS
    weight = np.empty(n + 3)
    weight[:n] = scene.stiffness
    for i in range(3):
        weight[n + i] = REGULARISER * MASS_MATRIX[i] / CONTROL_PERIOD**2
    if model.own_inertia:
        weight[n + 2] = weight[n] * scene.gyration**2
    return _Workspace(
        np.empty((n + 1, 4)),
        np.empty((1, 4)),
        np.empty_like(scene.robot.vertices),
        np.empty_like(scene.robot.centre),
        np.empty_like(scene.object.vertices),
        np.empty_like(scene.object.centre),
        make_pairs(scene),
        make_contacts(),
        weight,
        np.empty(n + 3),
        np.empty((m, n + 3)),
        np.empty(m),
        make_dual(weight, m),
    )


@kernel
def place(scene, q, pose, work, distance):
    """World geometry of one state, and its link distances (links,), m."""
    link_frames(scene, q, work.frames)
    place_shapes(scene.robot, work.frames, work.robot_vertices, work.robot_centres)
    pose_frame(pose, work.object_frame)
    place_shapes(scene.object, work.object_frame, work.object_vertices, work.object_centres)
    link_distances(scene, work.robot_vertices, work.object_vertices, work.pairs, distance)


@kernel
def advance_command(scene, model, target, absolute, q, q_cmd, action, new_cmd):
    """q_cmd <- q_cmd + h u, at most max_lead from the joint and within the joint limits."""
    for j in range(q.shape[0]):
        a = target[j]
        if absolute:
            a = (target[j] - q_cmd[j]) / (CONTROL_PERIOD * scene.speed_limit[j])
        a = min(max(a, -1.0), 1.0)
        action[j] = a
        command = q_cmd[j] + CONTROL_PERIOD * (a * scene.speed_limit[j])
        if not model.unlimited_lead:
            command = min(max(command, q[j] - scene.max_lead[j]), q[j] + scene.max_lead[j])
        new_cmd[j] = min(max(command, scene.lower[j]), scene.upper[j])


@kernel
def assemble(scene, model, friction, q, q_cmd, pose, w_x, w_y, work):
    """Contacts, rows A and values A Q^-1 b + phi of this step; returns the number of rows."""
    n = q.shape[0]
    margin = np.sqrt(w_x * w_x + w_y * w_y)
    for j in range(n):
        work.free[j] = q_cmd[j] - q[j]
        margin += scene.reach[j] * max(abs(work.free[j]), CONTROL_PERIOD * scene.speed_limit[j])
    work.free[n], work.free[n + 1], work.free[n + 2] = w_x, w_y, 0.0
    find_contacts(scene, work.robot_vertices, work.object_vertices, work.pairs, MARGIN_FACTOR * margin, work.contacts)
    contact_rows(scene, work.frames, pose, work.contacts, friction, work.rows)
    for i in range(2 * work.contacts.number[0]):
        value = max(work.contacts.gap[i // 2], -model.push_out)
        for j in range(n + 3):
            value += work.rows[i, j] * work.free[j]
        work.value[i] = value
    return 2 * work.contacts.number[0]


@kernel
def is_physical(model, m, work, gain, push):
    """Whether lead, displacement and push-out can bring a step: contacts alone bring none, but for overlaps.

    The step d is the minimum of 1/2 |d - f|^2 + g(d), with f = `work.free` and g the cost of the slacks, so that
    <d - f, d> <= g(0). A row's share of g(0) is gap^2 / (2 c), and c >= compliance / Q_x, since its part in the
    object's x and y is at least 1. Without compliance <d - f, d> <= |d - f| |e| for every e that pushes the
    overlaps out: we grant what the joints need at a short lever.

    Args:
        model: a `ContactModel`.
        m: number of rows.
        work: scratch in which the step was assembled.
        gain: <d - f, d>, with <a, b> = a^T Q b.
        push: <d - f, d - f>.
    """
    n, overlap, free, stiffest = work.weight.shape[0] - 3, 0.0, 0.0, 0.0
    for i in range(m // 2):
        gap = max(work.contacts.gap[i], -model.push_out)
        if gap < 0.0:
            overlap += gap * gap
    for j in range(n + 3):
        free += work.weight[j] * work.free[j] * work.free[j]
    for j in range(n):
        stiffest = max(stiffest, work.weight[j])
    if model.compliance > 0.0:
        bound = overlap * work.weight[n] / model.compliance  # of two rows for each contact
    else:
        granted = overlap + TOUCH_DISTANCE * TOUCH_DISTANCE if overlap > 0.0 else 0.0
        bound = np.sqrt(push * granted * stiffest) / SHORT_LEVER
    return gain <= bound + ROUNDING * (free + bound) + ROUNDING * ROUNDING  # not if it is not a number


@kernel
def is_within_bounds(pose):
    """Whether an object is where observations reach; what is not finite is not."""
    return abs(pose[0]) <= POSITION_LIMIT and abs(pose[1]) <= POSITION_LIMIT and abs(pose[2]) < np.inf


@kernel
def _solve_and_move(model, m, work, q_cmd, pose, new_q, new_pose, touched):
    """Solve the QP and integrate; returns the number of positive multipliers, FAILED where no answer is to be had."""
    n = q_cmd.shape[0]
    for k in range(touched.shape[0]):
        touched[k] = False
    active = 0
    for i in range(m):
        if work.value[i] < 0.0:
            # Of the rows that a displacement violates most leave again; of the others nearly all press.
            calm = work.free[n] == 0.0 and work.free[n + 1] == 0.0
            active = solve_dual(work.rows, m, model.compliance, work.value, calm, work.dual)
            break
    passive, multipliers = work.dual.passive, work.dual.multipliers
    gain, pushed = 0.0, 0.0
    for j in range(n + 3):
        force = 0.0
        for i in range(active):
            force += work.rows[passive[i], j] * multipliers[passive[i]]
        push = force / work.weight[j]
        gain += force * (work.free[j] + push)
        pushed += force * push
        if j < n:
            new_q[j] = q_cmd[j] + push  # q + dq with dq = (q_cmd - q) + K^-1 A^T lambda
        else:
            new_pose[j - n] = pose[j - n] + (work.free[j] + push)
    for i in range(active):
        touched[work.contacts.link[passive[i] // 2]] = True
    if not gain <= 0.0 and not is_physical(model, m, work, gain, pushed):
        return FAILED
    return active if is_within_bounds(new_pose) else FAILED


@kernel
def _touch(distance, contact):
    """Add the links within touching distance to those in contact."""
    for k in range(distance.shape[0]):
        contact[k] = contact[k] or distance[k] <= TOUCH_DISTANCE


@kernel
def _rollout_row(scene, model, values, absolute, displacement, friction, work, motion):
    """Simulate one row; arguments as in `rollout_rows` without the row axis."""
    q_r, q_cmd, pose, actions, distance, contact, active = motion
    place(scene, q_r[0], pose[0], work, distance[0])
    for k in range(scene.links):
        contact[0, k] = False
    active[0] = 0
    _touch(distance[0], contact[0])
    for t in range(values.shape[0]):
        w_x, w_y = 0.0, 0.0
        if displacement.shape[0] > 0:
            w_x, w_y = displacement[t, 0], displacement[t, 1]
        here = pose[t + 1]
        for j in range(3):
            here[j] = pose[t, j]
        if model.state_noise and (w_x != 0.0 or w_y != 0.0):
            here[0] += w_x
            here[1] += w_y
            w_x, w_y = 0.0, 0.0
            place(scene, q_r[t], here, work, distance[t + 1])  # overwritten at the end of the step
        advance_command(scene, model, values[t], absolute, q_r[t], q_cmd[t], actions[t], q_cmd[t + 1])
        m = assemble(scene, model, friction, q_r[t], q_cmd[t + 1], here, w_x, w_y, work)
        active[t + 1] = _solve_and_move(model, m, work, q_cmd[t + 1], here, q_r[t + 1], here, contact[t + 1])
        if active[t + 1] == FAILED:
            break
        place(scene, q_r[t + 1], here, work, distance[t + 1])
        _touch(distance[t + 1], contact[t + 1])


@batch_kernel
def rollout_rows(lo, hi, rows, scene, model, values, absolute, displacement, friction, motion):
    """Simulate rows `rows[lo:hi]`; the start stands at time index 0 of the motion's arrays.

    Args:
        lo, hi: range of entries of `rows`.
        rows: row numbers that share this scene, shape (R,).
        scene: a `PackedScene`.
        model: a `ContactModel`.
        values, absolute, displacement: as in `Commands`; displacement may have no steps.
        friction: mu of every row, shape (B,).
        motion: a `Motion`'s arrays as a tuple, filled in place as far as a row goes: `active` is FAILED at a step
            that has no answer, or none to be believed, and the row ends there.
    """
    q_r, q_cmd, pose, actions, distance, contact, active = motion
    work = make_workspace(scene, model)
    for r in range(lo, hi):
        i = rows[r]
        row = (q_r[i], q_cmd[i], pose[i], actions[i], distance[i], contact[i], active[i])
        _rollout_row(scene, model, values[i], absolute, displacement[i], friction[i], work, row)

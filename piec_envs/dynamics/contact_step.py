"""The compiled quasi-dynamic step (paper eq. 11)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.active_set import DualScratch, make_dual, solve_dual
from piec_envs.dynamics.contacts import (
    MAX_CONTACTS,
    Contacts,
    contact_rows,
    find_contacts,
    make_contacts,
)
from piec_envs.dynamics.protocol import CONTROL_PERIOD, POSITION_LIMIT, TOUCH_DISTANCE
from piec_envs.dynamics.rigid import FAILED
from piec_envs.geometry.body import Placed, make_placed
from piec_envs.kernels import batch_kernel, inlined_kernel

MASS_MATRIX = (0.1, 0.1, 0.042)  # M_o: the QP's regulariser, not a physical inertia
REGULARISER = 10.0  # epsilon
MARGIN_FACTOR = 1.5  # contacts nearer than this many times the largest motion of a step are kept
SHORT_LEVER = 0.02  # m; at which joints can push an overlap out where nothing gives
ROUNDING = 1e-6  # of the energy of a step


class Workspace(NamedTuple):
    """Scratch of one thread, so that no step allocates."""

    placed: Placed  # the scene of the state in hand
    contacts: Contacts  # its contact points
    weight: np.ndarray  # (n + 3,) diagonal of Q
    free: np.ndarray  # (n + 3,) Q^-1 b
    rows: np.ndarray  # (2 C, n + 3) A
    value: np.ndarray  # (2 C,) A Q^-1 b + phi
    dual: DualScratch  # scratch of the QP


@batch_kernel
def make_workspace(scene, model):
    """Scratch for one scene and model.

    Args:
        scene: a `Scene`.
        model: a `ContactModel`.

    Returns:
        A `Workspace`.
    """
    n, m = scene.robot.stiffness.shape[0], 2 * MAX_CONTACTS
    weight = np.empty(n + 3)
    for j in range(n):  # assigning the slice would compile a message about shapes for seconds
        weight[j] = scene.robot.stiffness[j]
    for i in range(3):
        weight[n + i] = REGULARISER * MASS_MATRIX[i] / CONTROL_PERIOD**2
    if model.own_inertia:
        weight[n + 2] = weight[n] * scene.object.gyration**2
    return Workspace(
        make_placed(scene),
        make_contacts(),
        weight,
        np.empty(n + 3),
        np.empty((m, n + 3)),
        np.empty(m),
        make_dual(weight, m),
    )


@inlined_kernel
def advance_command(scene, model, target, absolute, q, q_cmd, action, new_cmd):
    """q_cmd <- q_cmd + h u, at most max_lead from the joint and within the joint limits.

    Args:
        scene: a `Scene`.
        model: a `ContactModel`.
        target: an action in [-1, 1], or joint positions to command, shape (n,).
        absolute: whether it is the latter.
        q, q_cmd: joint positions and those commanded, shape (n,), rad or m.
        action: output, the action that was taken, shape (n,).
        new_cmd: output, the next command, shape (n,), rad or m.
    """
    for j in range(q.shape[0]):
        a = target[j]
        if absolute:
            a = (target[j] - q_cmd[j]) / (CONTROL_PERIOD * scene.robot.speed_limit[j])
        a = min(max(a, -1.0), 1.0)
        action[j] = a
        command = q_cmd[j] + CONTROL_PERIOD * (a * scene.robot.speed_limit[j])
        if not model.unlimited_lead:
            command = min(
                max(command, q[j] - scene.robot.max_lead[j]), q[j] + scene.robot.max_lead[j]
            )
        new_cmd[j] = min(max(command, scene.robot.lower[j]), scene.robot.upper[j])


@inlined_kernel
def assemble(scene, model, friction, q, q_cmd, pose, w_x, w_y, work):
    """Contacts, rows A and values A Q^-1 b + phi of this step.

    Args:
        scene: a `Scene`.
        model: a `ContactModel`.
        friction: mu.
        q, q_cmd: joint positions and those commanded, shape (n,), rad or m.
        pose: the object's x, y, angle, shape (3,), m and rad.
        w_x, w_y: displacement that is added to the object's free step, m.
        work: a `Workspace` with the state placed; `contacts`, `free`, `rows` and `value` are
            written.

    Returns:
        The number of rows.
    """
    n = q.shape[0]
    margin = np.sqrt(w_x * w_x + w_y * w_y)
    for j in range(n):
        work.free[j] = q_cmd[j] - q[j]
        margin += scene.robot.reach[j] * max(
            abs(work.free[j]), CONTROL_PERIOD * scene.robot.speed_limit[j]
        )
    work.free[n], work.free[n + 1], work.free[n + 2] = w_x, w_y, 0.0
    find_contacts(scene, work.placed, MARGIN_FACTOR * margin, work.contacts)
    contact_rows(scene, work.placed.frames, pose, work.contacts, friction, work.rows)
    for i in range(2 * work.contacts.number[0]):
        value = max(work.contacts.gap[i // 2], -model.push_out)
        for j in range(n + 3):
            value += work.rows[i, j] * work.free[j]
        work.value[i] = value
    return 2 * work.contacts.number[0]


@inlined_kernel
def is_physical(model, m, work, gain, push):
    """Whether lead, displacement and push-out can bring a step: contacts alone bring none, but for
    overlaps.

    The step d is the minimum of 1/2 |d - f|^2 + g(d), with f = `work.free` and g the cost of the
    slacks, so that <d - f, d> <= g(0). A row's share of g(0) is gap^2 / (2 c), and c >= compliance
    / Q_x, since its part in the object's x and y is at least 1. Without compliance <d - f, d> <= |d
    - f| |e| for every e that pushes the overlaps out: we grant what the joints need at a short
      lever.

    Args:
        model: a `ContactModel`.
        m: number of rows.
        work: scratch in which the step was assembled.
        gain: <d - f, d>, with <a, b> = a^T Q b.
        push: <d - f, d - f>.

    Returns:
        Whether the step may be believed; not where a number is not finite.
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
    # not if it is not a number
    return gain <= bound + ROUNDING * (free + bound) + ROUNDING * ROUNDING


@inlined_kernel
def is_within_bounds(pose):
    """Whether an object is where observations reach; what is not finite is not."""
    return (
        abs(pose[0]) <= POSITION_LIMIT and abs(pose[1]) <= POSITION_LIMIT and abs(pose[2]) < np.inf
    )


@inlined_kernel
def solve_and_move(model, m, work, q_cmd, pose, new_q, new_pose, touched):
    """Solve the QP and integrate.

    Args:
        model: a `ContactModel`.
        m: number of rows.
        work: a `Workspace` after `assemble`.
        q_cmd: joint positions commanded, shape (n,), rad or m.
        pose: the object's x, y, angle, shape (3,), m and rad.
        new_q, new_pose: output, the state after the step, shape (n,) and (3,).
        touched: output, which links press, shape (links,).

    Returns:
        The number of positive multipliers, FAILED where no answer is to be had.
    """
    n = q_cmd.shape[0]
    for k in range(touched.shape[0]):
        touched[k] = False
    active = 0
    for i in range(m):
        if work.value[i] < 0.0:
            # Of the rows that a displacement violates most leave again; of the others nearly all
            # press.
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

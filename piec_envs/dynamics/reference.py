"""The quasi-dynamic rollout in plain NumPy and OSQP: the readable reference of the compiled one."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.contact_qp import ContactProblem, solve_osqp
from piec_envs.dynamics.contact_step import (
    advance_command,
    assemble,
    is_physical,
    is_within_bounds,
    make_workspace,
)
from piec_envs.dynamics.protocol import TOUCH_DISTANCE
from piec_envs.geometry.body import place_scene


def rollout_rows_osqp(lo, hi, rows, scene, model, values, absolute, displacement, friction, motion):
    """The same as `rollout_rows` in plain NumPy, one OSQP problem set up per step: the reference.

    Args:
        lo, hi, rows, scene, model: as in `rollout_rows`.
        values, absolute, displacement: as in `rollout_rows`.
        friction, motion: as in `rollout_rows`.
    """
    q_r, q_cmd, pose, actions, distance, contact, active, diverged = motion
    work = make_workspace(scene, model)
    n = q_r.shape[2]
    for i in rows[lo:hi]:
        place_scene(scene, q_r[i, 0], pose[i, 0], work.placed, distance[i, 0])
        contact[i, 0] = distance[i, 0] <= TOUCH_DISTANCE
        active[i, 0] = 0
        for t in range(values.shape[1]):
            w = displacement[i, t] if displacement.shape[1] else np.zeros(2)
            here = pose[i, t].copy()
            if model.state_noise:
                here[:2] += w
                w = np.zeros(2)
            # overwritten at the end of the step
            place_scene(scene, q_r[i, t], here, work.placed, distance[i, t + 1])
            advance_command(
                scene,
                model,
                values[i, t],
                absolute,
                q_r[i, t],
                q_cmd[i, t],
                actions[i, t],
                q_cmd[i, t + 1],
            )
            problem = assemble_problem(
                scene, model, friction[i], q_r[i, t], q_cmd[i, t + 1], here, w, work
            )
            solution = solve_osqp(problem)
            if not _is_believable(model, problem, solution, here, work):
                for array in (q_r, q_cmd, pose, distance, contact):
                    array[i, t + 1 :] = array[i, t]
                actions[i, t:] = 0.0
                active[i, t + 1 :] = 0
                diverged[i, t + 1 :] = True
                break
            pushed = solution.multipliers > 1e-9
            q_r[i, t + 1] = q_r[i, t] + solution.step[:n]
            pose[i, t + 1] = here + solution.step[n:]
            active[i, t + 1] = pushed.sum()
            place_scene(scene, q_r[i, t + 1], pose[i, t + 1], work.placed, distance[i, t + 1])
            contact[i, t + 1] = distance[i, t + 1] <= TOUCH_DISTANCE
            contact[i, t + 1, work.contacts.link[np.flatnonzero(pushed) // 2]] = True


def _is_believable(model, problem, solution, pose, work) -> bool:
    """Whether the step is an answer that lead, displacement and push-out can bring, to a place
    within bounds.
    """
    moved = solution.step - problem.free  # by the contacts
    gain, push = (float((problem.weight * moved) @ other) for other in (solution.step, moved))
    physical = is_physical(model, len(problem.gap), work, gain, push)
    return solution.solved and physical and is_within_bounds(pose + solution.step[-3:])


def assemble_problem(
    scene, model, friction, q, q_cmd, pose, displacement, work=None
) -> ContactProblem:
    """The contact QP of one step as a value object.

    Args:
        scene: a `Scene`.
        model: a `ContactModel`.
        friction: mu.
        q, q_cmd: joints and this step's command, shape (n,).
        pose: object pose, shape (3,).
        displacement: the object's free displacement, shape (2,), m.
        work: scratch in which this state has been placed; made when None.

    Returns:
        The problem, independent of the scratch.
    """
    if work is None:
        work = make_workspace(scene, model)
        place_scene(scene, q, pose, work.placed, np.empty(scene.robot.links))
    m = assemble(scene, model, friction, q, q_cmd, pose, displacement[0], displacement[1], work)
    gap = np.maximum(np.repeat(work.contacts.gap[: m // 2], 2), -model.push_out)
    return ContactProblem(
        work.weight.copy(), work.free.copy(), work.rows[:m].copy(), gap, model.compliance
    )

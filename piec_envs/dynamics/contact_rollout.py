"""The compiled quasi-dynamic rollout: step after step of the rows that share a scene."""

from __future__ import annotations

from typing import NamedTuple

from piec_envs.dynamics.contact_model import ContactModel
from piec_envs.dynamics.contact_step import (
    Workspace,
    advance_command,
    assemble,
    make_workspace,
    solve_and_move,
)
from piec_envs.dynamics.protocol import TOUCH_DISTANCE
from piec_envs.dynamics.rigid import FAILED
from piec_envs.geometry.body import place_scene
from piec_envs.held import Held
from piec_envs.kernels import batch_kernel, inlined_kernel, kernel
from piec_envs.world.packed import Scene


@inlined_kernel
def _touch(distance, contact):
    """Add the links within touching distance to those in contact."""
    for k in range(distance.shape[0]):
        contact[k] = contact[k] or distance[k] <= TOUCH_DISTANCE


@kernel
def _hold(t, motion):
    """Let a row that has found no answer for step t rest in its state from then on, diverged."""
    q_r, q_cmd, pose, actions, distance, contact, active, diverged = motion
    for later in range(t + 1, q_r.shape[0]):
        for j in range(q_r.shape[1]):
            q_r[later, j], q_cmd[later, j], actions[later - 1, j] = q_r[t, j], q_cmd[t, j], 0.0
        for k in range(3):
            pose[later, k] = pose[t, k]
        for k in range(distance.shape[1]):
            distance[later, k], contact[later, k] = distance[t, k], contact[t, k]
        active[later], diverged[later] = 0, True


@inlined_kernel
def _rollout_row(scene, model, values, absolute, displacement, friction, work, motion):
    """Simulate one row; arguments as in `rollout_rows` without the row axis."""
    q_r, q_cmd, pose, actions, distance, contact, active, _ = motion
    place_scene(scene, q_r[0], pose[0], work.placed, distance[0])
    for k in range(scene.robot.links):
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
            # overwritten at the end of the step
            place_scene(scene, q_r[t], here, work.placed, distance[t + 1])
        advance_command(
            scene, model, values[t], absolute, q_r[t], q_cmd[t], actions[t], q_cmd[t + 1]
        )
        m = assemble(scene, model, friction, q_r[t], q_cmd[t + 1], here, w_x, w_y, work)
        active[t + 1] = solve_and_move(
            model, m, work, q_cmd[t + 1], here, q_r[t + 1], here, contact[t + 1]
        )
        if active[t + 1] == FAILED:
            _hold(t, motion)
            break
        place_scene(scene, q_r[t + 1], here, work.placed, distance[t + 1])
        _touch(distance[t + 1], contact[t + 1])


class World(NamedTuple):
    """What a thread simulates with."""

    scene: Scene  # robot and object
    model: ContactModel  # settings of the contacts
    work: Workspace  # scratch of one thread


@batch_kernel
def make_world(scene, model):
    """A `World`, held: a scene, the settings, and scratch of one thread.

    Args:
        scene: a `Scene`.
        model: a `ContactModel`.

    Returns:
        For `rollout_rows`.
    """
    return Held(World(scene, model, make_workspace(scene, model)))


@batch_kernel
def rollout_rows(lo, hi, rows, world, values, absolute, displacement, friction, motion):
    """Simulate rows `rows[lo:hi]`; the start stands at time index 0 of the motion's arrays.

    Args:
        lo, hi: range of entries of `rows`.
        rows: row numbers that share this world, shape (R,).
        world: from `make_world`.
        values, absolute, displacement: as in `Commands`; displacement may have no steps.
        friction: mu of every row, shape (B,).
        motion: a `Motion`'s arrays as a tuple, filled in place. A row rests, diverged, from a step
            on that has no answer, or none to be believed.
    """
    q_r, q_cmd, pose, actions, distance, contact, active, diverged = motion
    scene, model, work = world.value
    for r in range(lo, hi):
        i = rows[r]
        row = (
            q_r[i],
            q_cmd[i],
            pose[i],
            actions[i],
            distance[i],
            contact[i],
            active[i],
            diverged[i],
        )
        _rollout_row(scene, model, values[i], absolute, displacement[i], friction[i], work, row)

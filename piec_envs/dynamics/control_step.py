"""What happens around the engine's own steps: commands, displacements, distances. Compiled, over
rows.
"""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.contact_step import advance_command
from piec_envs.dynamics.protocol import TOUCH_DISTANCE
from piec_envs.geometry.body import (
    link_distances,
    make_placed,
    place_object,
    place_robot,
    place_scene,
)
from piec_envs.kernels import batch_kernel, kernel

# a displacement is tried in this many equal parts, each shorter than any link is thick
SHIFT_STEPS = 8
# from the first part that meets the robot on the parts are halved, until so many more have
SHIFT_FAILURES = 8
SHIFT_TRIES = 60  # in all, which bounds the search where no try meets it


@kernel
def _distance_at(scene, x, y, angle, pose, placed, distances):
    """Least distance of the object at a pose to the placed robot; fills `distances` (links,)."""
    pose[0], pose[1], pose[2] = x, y, angle
    place_object(scene.object, pose, placed)
    link_distances(scene, placed, distances)
    least = np.inf
    for k in range(distances.shape[0]):
        least = min(least, distances[k])
    return least


@batch_kernel
def command_rows(lo, hi, rows, t, scene, model, values, absolute, motion, late, ctrl):
    """Commands of step t, as every dynamics takes them, by `advance_command`.

    A late command leaves the one before in force until it arrives.

    Args:
        lo, hi: range of entries of `rows`.
        rows: row numbers, shape (R,).
        t: index of the step.
        scene: a `Scene`.
        model: a `ContactModel`.
        values, absolute: as in `Commands`.
        motion: (q_r, q_cmd, actions) of a `Motion`; q_cmd at t + 1 and the actions at t are
            written.
        late: engine steps from a command to the drives, shape (hi - lo,).
        ctrl: output, what the drives get in each of the engine's steps, shape (hi - lo, M, n).
    """
    q_r, q_cmd, actions = motion
    for r in range(lo, hi):
        i = rows[r]
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
        for m in range(ctrl.shape[1]):
            for j in range(ctrl.shape[2]):
                ctrl[r - lo, m, j] = q_cmd[i, t, j] if m < late[r - lo] else q_cmd[i, t + 1, j]


@batch_kernel
def shift_rows(lo, hi, rows, t, scene, displacement, q_r, pose, shifted):
    """Displace the object by w, cut where it would meet the robot (or press on it more than it
    does).

    Args:
        lo, hi: range of entries of `rows`.
        rows: row numbers, shape (R,).
        t: index of the step.
        scene: a `Scene`.
        displacement: w, shape (B, N, 2), m.
        q_r, pose: of a `Motion`, at time index t.
        shifted: output, object x and y, shape (hi - lo, 2), m.
    """
    moved, placed, distances = np.empty(3), make_placed(scene), np.empty(scene.robot.links)
    for r in range(lo, hi):
        i = rows[r]
        x, y, angle = pose[i, t, 0], pose[i, t, 1], pose[i, t, 2]
        w_x, w_y = displacement[i, t, 0], displacement[i, t, 1]
        share = 0.0
        if w_x != 0.0 or w_y != 0.0:
            place_robot(scene.robot, q_r[i, t], placed)
            here = _distance_at(scene, x, y, angle, moved, placed, distances)
            free, part = min(here, 0.0), 1.0 / SHIFT_STEPS
            failures = 0
            for _ in range(SHIFT_TRIES):
                if share >= 1.0 or failures > SHIFT_FAILURES:
                    break
                tried = min(share + part, 1.0)
                there = _distance_at(
                    scene, x + tried * w_x, y + tried * w_y, angle, moved, placed, distances
                )
                if there >= free:
                    share = tried
                else:
                    failures += 1
                if failures > 0:
                    part *= 0.5
        shifted[r - lo, 0], shifted[r - lo, 1] = x + share * w_x, y + share * w_y


@batch_kernel
def measure_motion_rows(lo, hi, rows, scene, q_r, pose, distance, contact, active):
    """Link distances of every state of a motion, and which links touch or press.

    Args:
        lo, hi: range of entries of `rows`.
        rows: row numbers, shape (R,).
        scene: a `Scene`.
        q_r: shape (B, T, n).
        pose: shape (B, T, 3).
        distance: output, shape (B, T, links), m.
        contact: output, whether nearer than the touching distance, shape (B, T, links).
        active: output, links that press, shape (B, T); 0 at the start.
    """
    placed = make_placed(scene)
    for r in range(lo, hi):
        i = rows[r]
        for t in range(q_r.shape[1]):
            place_scene(scene, q_r[i, t], pose[i, t], placed, distance[i, t])
            active[i, t] = 0
            for k in range(scene.robot.links):
                contact[i, t, k] = distance[i, t, k] <= TOUCH_DISTANCE
                if t > 0 and distance[i, t, k] < 0.0:  # a soft contact pushes where bodies overlap
                    active[i, t] += 1

"""MuJoCo as a contact dynamics: second order, the object resting on a table, batched over rows and threads.

A control step of 0.1 s is 50 engine steps under one command. Each begins with a cold solver, so that
nothing but the physical state has to be remembered, and stepping, rollouts and restored states agree
bit for bit.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

from piec_envs.dynamics.base import CONTROL_PERIOD, Commands, Motion, Plant, blank_motion, check_shapes
from piec_envs.dynamics.contact_step import ContactModel
from piec_envs.dynamics.control_step import command_rows, measure_motion_rows, shift_rows
from piec_envs.dynamics.mjcf import TIMESTEP, get_model
from piec_envs.parallel import run_rows
from piec_envs.world.objects import get_object
from piec_envs.world.scene import PackedScene, pack_scene

ENGINE_STEPS = round(CONTROL_PERIOD / TIMESTEP)  # in a control step
SETTLE_ROUNDS, SETTLE_ENGINE_STEPS = 100, 2  # in which an overlap is relaxed
SETTLED = 1e-4  # m; an overlap that counts as none
SMALL_BATCH = 64  # row-steps below which a second thread costs more than it brings to measuring
_PHYSICS = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
_CONTROL = int(mujoco.mjtState.mjSTATE_CTRL)


class MujocoDynamics:
    """The MuJoCo backend.

    A row's memory is MuJoCo's physics state: time, positions, velocities. Where the engine warns (NaN,
    infinite or huge values, full buffers), the row has diverged and rests in its last good state.

    Args:
        threads: threads over rows; None takes all cores.
        model: settings of the quasi-dynamic model, of which the lead of the commands holds here too.
    """

    name = "mujoco"

    def __init__(self, threads: int | None = None, model: ContactModel | None = None):
        self.threads, self.model = threads, model or ContactModel()

    def rollout(
        self,
        q_r: np.ndarray,
        q_cmd: np.ndarray,
        pose: np.ndarray,
        commands: Commands,
        plant: Plant,
        memory: Sequence[np.ndarray] | None = None,
    ) -> Motion:
        """Simulate N steps for B rows; see `Dynamics.rollout`."""
        return self._rollout(q_r, q_cmd, pose, commands, plant, memory, ENGINE_STEPS)

    def settle(self, q_r: np.ndarray, pose: np.ndarray, plant: Plant) -> np.ndarray:
        """Where the contacts push an overlapping object while the arm is held; see `Dynamics.settle`.

        It is brought to rest again and again, or an overlap of millimetres would throw it.
        """
        settled, n = pose.copy(), q_r.shape[1]
        for _ in range(SETTLE_ROUNDS):
            looked = self.rollout(q_r, q_r, settled, Commands(np.zeros((len(pose), 0, n))), plant)
            pressed = np.flatnonzero(looked.link_distance[:, 0].min(axis=1) < -SETTLED)
            if len(pressed) == 0:
                break
            q, hold = q_r[pressed], Commands(np.zeros((len(pressed), 1, n)))
            pushed = self._rollout(q, q, settled[pressed], hold, plant.take(pressed), None, SETTLE_ENGINE_STEPS)
            settled[pressed] = pushed.pose[:, -1]
        return settled

    def _rollout(self, q_r, q_cmd, pose, commands, plant, memory, engine_steps) -> Motion:
        check_shapes(q_r, q_cmd, pose, commands, plant)
        batch, steps, _ = commands.values.shape
        groups = [(name, rows, pack_scene(plant.robot, name)) for name, rows in plant.rows_by_object.items()]
        motion = blank_motion(q_r, q_cmd, pose, steps, groups[0][2].links)
        motion.memory[:] = memory or motion.memory
        for name, rows, scene in groups:
            job = _Job(name, rows, scene, self.model, plant, commands, motion, engine_steps)
            run_rows(_simulate, len(rows), self.threads, job)
            run_rows(
                measure_motion_rows, len(rows), 1 if batch * steps < SMALL_BATCH else self.threads, rows, scene,
                motion.q_r, motion.pose, motion.link_distance, motion.contact, motion.active,
            )  # fmt: skip
        for row in np.flatnonzero(motion.diverged[:, -1]):
            motion.hold(int(row), int(motion.diverged[row].argmax()) - 1)
        return motion


@dataclass(frozen=True, eq=False)
class _Job:
    """Rows that share an object, to be simulated into a motion."""

    object_name: str
    rows: np.ndarray
    scene: PackedScene
    model: ContactModel
    plant: Plant
    commands: Commands
    motion: Motion
    engine_steps: int  # for each control step


class _Engines(threading.local):
    """What each thread simulates with: the engine's loop, and its data for each scene."""

    def __init__(self):
        self.loop = mujoco.rollout.Rollout(nthread=0)
        self.data: dict[tuple[str, str], Any] = {}

    def data_for(self, robot_name: str, object_name: str, model: Any) -> Any:
        """Scratch for models of this scene, whatever their friction."""
        key = (robot_name, object_name)
        if key not in self.data:
            self.data[key] = mujoco.MjData(model)
        return self.data[key]


_engines = _Engines()


def _simulate(lo: int, hi: int, job: _Job) -> None:
    """Simulate rows `job.rows[lo:hi]`, one control step after the other for all of them."""
    rows, motion, commands = job.rows[lo:hi], job.motion, job.commands
    if len(rows) == 0 or commands.values.shape[1] == 0:
        return
    models = [get_model(job.plant.robot, job.object_name, float(job.plant.friction[i])) for i in rows]
    data = _engines.data_for(job.plant.robot, job.object_name, models[0])
    batch, n, nq = len(rows), motion.q_r.shape[2], models[0].nq
    state = np.stack([_start(models[0], job.object_name, motion, i) for i in rows])  # (batch, S)
    ctrl, after = (np.empty((batch, job.engine_steps, width)) for width in (n, state.shape[1]))
    position = state[:, 1 : 1 + nq]  # (batch, nq)
    for t in range(commands.values.shape[1]):
        if commands.displacement is not None:
            shift_rows(lo, hi, job.rows, t, job.scene, commands.displacement, motion.q_r, motion.pose,
                       position[:, n : n + 2])  # fmt: skip
        command_rows(lo, hi, job.rows, t, job.scene, job.model, commands.values, commands.absolute,
                     (motion.q_r, motion.q_cmd, motion.actions), ctrl)  # fmt: skip
        state[:, 0] = 0.0  # time: the engine stops it where it warns
        _engines.loop.rollout(
            models, [data], state, ctrl, control_spec=_CONTROL, skip_checks=True, nstep=job.engine_steps, state=after
        )
        good = (after[:, -1, 0] > (job.engine_steps - 0.5) * TIMESTEP) & np.isfinite(after[:, -1]).all(axis=1)
        state[good] = after[good, -1]
        motion.diverged[rows, t + 1] = motion.diverged[rows, t] | ~good
        motion.q_r[rows, t + 1] = position[:, :n]
        motion.pose[rows, t + 1] = _planar(position[:, n:], motion.pose[rows, t, 2])
    for row, last in zip(rows, state, strict=True):
        motion.memory[row] = last.copy()


def _start(model: Any, object_name: str, motion: Motion, row: int) -> np.ndarray:
    """The row's physics state: what it remembers if that fits joints and pose, else at rest, shape (S,)."""
    q_r, pose, memory = motion.q_r[row, 0], motion.pose[row, 0], motion.memory[row]
    n, nq, size = len(q_r), model.nq, mujoco.mj_stateSize(model, _PHYSICS)
    if memory.shape == (size,):
        known = _planar(memory[None, 1 + n : 1 + nq], pose[None, 2])[0]
        if (memory[1 : 1 + n] == q_r).all() and (known[:2] == pose[:2]).all() and abs(known[2] - pose[2]) < 1e-9:
            return memory
    state, height = np.zeros(size), get_object(object_name).height / 2
    state[1 : 1 + n] = q_r
    state[1 + n : 1 + nq] = (*pose[:2], height, np.cos(pose[2] / 2), 0, 0, np.sin(pose[2] / 2))
    return state


def _planar(free: np.ndarray, before: np.ndarray) -> np.ndarray:
    """Poses x, y, angle of free bodies.

    Args:
        free: position and quaternion, shape (B, 7).
        before: earlier angles, shape (B,); of all equal angles the nearest is taken.

    Returns:
        Shape (B, 3).
    """
    w, x, y, z = free[:, 3:].T
    heading = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    turn = (heading - before + np.pi) % (2 * np.pi) - np.pi
    return np.column_stack([free[:, :2], before + turn])

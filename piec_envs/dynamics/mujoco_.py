"""MuJoCo as a contact dynamics: second order, the object resting on a table, batched over rows and
threads.

A control step of 0.1 s is 50 engine steps under one command. Each begins with a cold solver, so
that nothing but the physical state has to be remembered, and stepping, rollouts and restored states
agree bit for bit.
"""

from __future__ import annotations

import threading
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mujoco
import mujoco.rollout
import numpy as np

from piec_envs.dynamics.by_row import DynamicsOptions
from piec_envs.dynamics.contact_model import ContactModel
from piec_envs.dynamics.control_step import command_rows, measure_motion_rows, shift_rows
from piec_envs.dynamics.free_bodies import (
    PLACE,
    places_in,
    planar,
    poses_at_start,
    remembered_places,
    rest_state,
)
from piec_envs.dynamics.mjcf import TIMESTEP, mujoco_model
from piec_envs.dynamics.protocol import (
    CONTROL_PERIOD,
    NO_MEMORY,
    POSITION_LIMIT,
    Commands,
    Motion,
    Plant,
    blank_motion,
    check_shapes,
)
from piec_envs.parallel import run_rows
from piec_envs.world.objects import get_object
from piec_envs.world.packed import Scene, pack_scene

ENGINE_STEPS = round(CONTROL_PERIOD / TIMESTEP)  # in a control step
# in which an overlap is relaxed
SETTLE_ROUNDS = 100
SETTLE_ENGINE_STEPS = 2
SETTLED = 1e-4  # m; an overlap that counts as none
LARGEST_MOVE = 0.5  # m or rad in a control step; a hundred times what the drives bring
MEASURE_WORK = 2.0  # us of a state, about
_PHYSICS = int(mujoco.mjtState.mjSTATE_FULLPHYSICS)
_CONTROL = int(mujoco.mjtState.mjSTATE_CTRL)


class MujocoDynamics:
    """The MuJoCo backend.

    A row's memory is MuJoCo's physics state: time, positions, velocities. Where the engine warns
    (NaN, infinite or huge values, full buffers), or something moves as nothing there can move it,
    the row has diverged and rests in its last good state.

    Args:
        threads: threads over rows; None takes all cores.
        model: settings of the quasi-dynamic model, of which the lead of the commands holds here
            too.
    """

    name = "mujoco"

    def __init__(self, threads: int | None = None, model: ContactModel | None = None):
        self.threads = threads
        self.model = model or ContactModel()

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

    def settle(
        self, q_r: np.ndarray, pose: np.ndarray, plant: Plant
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Where the contacts push overlapping bodies while the arm is held; see `Dynamics.settle`.

        They are brought to rest again and again, or an overlap of millimetres would throw them.
        """
        items = [get_object(name) for name in plant.objects]
        poses = [poses_at_start(item, row) for item, row in zip(items, pose, strict=True)]
        at_rest = [rest_state(*row) for row in zip(items, q_r, poses, strict=True)]
        for _ in range(SETTLE_ROUNDS):
            pressed = np.flatnonzero(
                self._overlap(q_r, np.array([row[0] for row in poses]), plant, at_rest) > SETTLED
            )
            if len(pressed) == 0:
                break
            q = q_r[pressed]
            hold = Commands(np.zeros((len(pressed), 1, q_r.shape[1])))
            settled = np.array([poses[i][0] for i in pressed])
            memory = [at_rest[i] for i in pressed]
            pushed = self._rollout(
                q, q, settled, hold, plant.take(pressed), memory, SETTLE_ENGINE_STEPS
            )
            for i, state in zip(pressed, pushed.memory, strict=True):
                poses[i] = planar(places_in(state, q_r.shape[1], len(poses[i])), poses[i][:, 2])
                at_rest[i] = rest_state(items[i], q_r[i], poses[i])
        kept = [
            state if item.loose else NO_MEMORY for item, state in zip(items, at_rest, strict=True)
        ]
        return np.array([row[0] for row in poses]), kept

    def _overlap(
        self, q_r: np.ndarray, pose: np.ndarray, plant: Plant, at_rest: list[np.ndarray]
    ) -> np.ndarray:
        """How far anything overlaps but the table, shape (B,), m; loose bodies by the engine's own
        contacts.
        """
        looked = self.rollout(
            q_r, q_r, pose, Commands(np.zeros((len(pose), 0, q_r.shape[1]))), plant
        )
        overlap = -looked.link_distance[:, 0].min(axis=1)
        for i, name in enumerate(plant.objects):
            if get_object(name).loose:
                overlap[i] = max(overlap[i], _deepest_contact(plant, i, at_rest[i]))
        return overlap

    def _rollout(self, q_r, q_cmd, pose, commands, plant, memory, engine_steps) -> Motion:
        check_shapes(q_r, q_cmd, pose, commands, plant)
        steps = commands.values.shape[1]
        groups = [
            (name, rows, pack_scene(plant.robot, name))
            for name, rows in plant.rows_by_object.items()
        ]
        motion = blank_motion(q_r, q_cmd, pose, steps, groups[0][2].robot.links)
        motion.memory[:] = memory or motion.memory
        for name, rows, scene in groups:
            job = _Job(name, rows, scene, self.model, plant, commands, motion, engine_steps)
            run_rows(_simulate, len(rows), self.threads, job)
            run_rows(
                measure_motion_rows, len(rows), self.threads, rows, scene, motion.q_r, motion.pose,
                motion.link_distance, motion.contact, motion.active,
                work=MEASURE_WORK * len(rows) * (steps + 1),
            )  # fmt: skip
        motion.hold_diverged(motion.diverged)
        return motion


def mujoco_dynamics(options: DynamicsOptions) -> MujocoDynamics:
    """The MuJoCo row of the table of dynamics."""
    return MujocoDynamics(options.threads, options.model)


@dataclass(frozen=True, eq=False)
class _Job:
    """Rows that share an object, to be simulated into a motion."""

    object_name: str
    rows: np.ndarray
    scene: Scene
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
        """Scratch for models of this scene, whatever their friction and mass."""
        key = (robot_name, object_name)
        if key not in self.data:
            self.data[key] = mujoco.MjData(model)
        return self.data[key]


_engines = _Engines()


def _row_model(plant: Plant, row: int) -> Any:
    """The model of one row."""
    mass = 1.0 if plant.mass is None else float(plant.mass[row])
    return mujoco_model(plant.robot, plant.objects[row], float(plant.friction[row]), mass)


def _deepest_contact(plant: Plant, row: int, state: np.ndarray) -> float:
    """Depth of a row's deepest contact but those with the table, m; 0 where there is none."""
    model = _row_model(plant, row)
    data = _engines.data_for(plant.robot, plant.objects[row], model)
    mujoco.mj_setState(model, data, state, _PHYSICS)
    mujoco.mj_fwdPosition(model, data)
    above = (model.geom_bodyid[data.contact.geom] > 0).all(axis=1)  # (contacts,)
    return -float(data.contact.dist[above].min(initial=0.0))


def _simulate(lo: int, hi: int, job: _Job) -> None:
    """Simulate rows `job.rows[lo:hi]`, one control step after the other for all of them."""
    rows = job.rows[lo:hi]
    motion = job.motion
    commands = job.commands
    if len(rows) == 0 or commands.values.shape[1] == 0:
        return
    models = [_row_model(job.plant, i) for i in rows]
    data = _engines.data_for(job.plant.robot, job.object_name, models[0])
    batch = len(rows)
    n = motion.q_r.shape[2]
    nq = models[0].nq
    state = np.stack([_start(job.object_name, motion, i) for i in rows])  # (batch, S)
    # (batch,)
    late = np.zeros(batch) if job.plant.delay is None else np.rint(job.plant.delay[rows] / TIMESTEP)
    ctrl, after = (np.empty((batch, job.engine_steps, width)) for width in (n, state.shape[1]))
    position = state[:, 1 : 1 + nq]  # (batch, nq)
    for t in range(commands.values.shape[1]):
        if commands.displacement is not None:
            shift_rows(
                lo, hi, job.rows, t, job.scene, commands.displacement, motion.q_r, motion.pose,
                position[:, n : n + 2],
            )  # fmt: skip
        command_rows(
            lo, hi, job.rows, t, job.scene, job.model, commands.values, commands.absolute,
            (motion.q_r, motion.q_cmd, motion.actions), late, ctrl,
        )  # fmt: skip
        state[:, 0] = 0.0  # time: the engine stops it where it warns
        _engines.loop.rollout(
            models,
            [data],
            state,
            ctrl,
            control_spec=_CONTROL,
            skip_checks=True,
            nstep=job.engine_steps,
            state=after,
        )
        good = (after[:, -1, 0] > (job.engine_steps - 0.5) * TIMESTEP) & _are_believable(
            state, after[:, -1], n
        )
        state[good] = after[good, -1]
        motion.diverged[rows, t + 1] = motion.diverged[rows, t] | ~good
        motion.q_r[rows, t + 1] = position[:, :n]
        motion.pose[rows, t + 1] = planar(position[:, n : n + PLACE], motion.pose[rows, t, 2])
    for row, last in zip(rows, state, strict=True):
        motion.memory[row] = last.copy()


def _are_believable(before: np.ndarray, after: np.ndarray, n: int) -> np.ndarray:
    """Whether drives and contacts can bring the motion of a control step, to where observations
    reach, shape (B,).

    Args:
        before, after: physics states, shape (B, S).
        n: number of joints.
    """
    moved = np.abs(after - before)[:, 1 : 1 + n + 3].max(axis=1)  # joints, and the object's place
    reached = np.abs(after[:, 1 + n : 1 + n + 2]).max(axis=1)
    return np.isfinite(after).all(axis=1) & (moved <= LARGEST_MOVE) & (reached <= POSITION_LIMIT)


def _start(object_name: str, motion: Motion, row: int) -> np.ndarray:
    """The row's physics state: what it remembers if that fits joints and pose, else at rest, shape
    (S,).
    """
    item = get_object(object_name)
    q_r = motion.q_r[row, 0]
    pose = motion.pose[row, 0]
    if remembered_places(item, q_r, pose, motion.memory[row]) is not None:
        return motion.memory[row]
    return rest_state(item, q_r, poses_at_start(item, pose))

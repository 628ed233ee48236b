"""Quasi-dynamic contact dynamics (paper eq. 11), batched over rows."""

from __future__ import annotations

import threading
from collections.abc import Sequence
from typing import Any

import numpy as np

from piec_envs.dynamics.by_row import DynamicsOptions, check_moves, check_varies
from piec_envs.dynamics.contact_model import ContactModel
from piec_envs.dynamics.contact_rollout import make_world, rollout_rows
from piec_envs.dynamics.protocol import (
    INERTIAS,
    NO_MEMORY,
    Commands,
    Motion,
    Plant,
    blank_motion,
    check_shapes,
)
from piec_envs.dynamics.reference import rollout_rows_osqp
from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.parallel import run_rows
from piec_envs.world.packed import pack_robot, pack_scene

STEP_WORK = 1.5  # us of a row's step, about: 0.7 out of contact, 3 in it
Key = tuple[str, str, ContactModel]  # robot, object, settings


class _Worlds(threading.local):
    """What each thread simulates with, for each robot, object and settings."""

    def __init__(self):
        self.made = dict[Key, Any]()


_worlds = _Worlds()


def _rollout_fast(lo: int, hi: int, rows: np.ndarray, key: Key, *arrays: Any) -> None:
    """`rollout_rows` in this thread's world."""
    world = _worlds.made.get(key)
    if world is None:
        robot, item, model = key
        world = _worlds.made[key] = make_world(pack_scene(robot, item), model)
    rollout_rows(lo, hi, rows, world, *arrays)


def _rollout_osqp(lo: int, hi: int, rows: np.ndarray, key: Key, *arrays: Any) -> None:
    """The plain reference."""
    robot, item, model = key
    rollout_rows_osqp(lo, hi, rows, pack_scene(robot, item), model, *arrays)


SOLVERS = {"fast": _rollout_fast, "osqp": _rollout_osqp}


class QuasiDynamics:
    """The quasi-dynamic backend.

    Args:
        solver: "fast" (compiled) or "osqp" (the plain reference).
        model: settings of the contact model.
        threads: threads over rows; None takes all cores.

    Raises:
        UnknownNameError: if there is no such solver.
        InvalidParameterError: if the compliance or the push-out limit is negative.
    """

    name = "quasi_dynamic"

    def __init__(
        self, solver: str = "fast", model: ContactModel | None = None, threads: int | None = None
    ):
        check_name("solver", solver, SOLVERS)
        model = model or ContactModel()
        if model.compliance < 0 or model.push_out < 0:
            raise InvalidParameterError(f"compliance and push_out must be at least 0, got {model}")
        self._models = {name: model._replace(own_inertia=name == "own") for name in INERTIAS}
        self.solver = solver  # not the kernel itself, which a copy would compile anew
        self.threads = threads

    def rollout(
        self,
        q_r: np.ndarray,
        q_cmd: np.ndarray,
        pose: np.ndarray,
        commands: Commands,
        plant: Plant,
        memory: Sequence[np.ndarray] | None = None,
    ) -> Motion:
        """Simulate N steps for B rows; see `Dynamics.rollout`.

        A first-order model remembers nothing, and knows neither the object's mass nor what its row
        of the table says.
        """
        check_shapes(q_r, q_cmd, pose, commands, plant)
        if self.name not in plant.accepted:
            self._check_plant(plant)
        batch, steps, _ = commands.values.shape
        motion = blank_motion(q_r, q_cmd, pose, steps, pack_robot(plant.robot).links)
        arrays = (
            motion.q_r, motion.q_cmd, motion.pose, motion.actions, motion.link_distance,
            motion.contact, motion.active, motion.diverged,
        )  # fmt: skip
        displacement = (
            np.zeros((batch, 0, 2)) if commands.displacement is None else commands.displacement
        )
        for (name, inertia), rows in plant.rows_by_object_and_inertia.items():
            run_rows(
                SOLVERS[self.solver], len(rows), self.threads,
                rows, (plant.robot, name, self._models[inertia]),
                commands.values, commands.absolute, displacement, plant.friction, arrays,
                work=STEP_WORK * len(rows) * steps,
            )  # fmt: skip
        return motion

    def _check_plant(self, plant: Plant) -> None:
        """Refuse a plant that a first-order model cannot follow."""
        check_varies(
            self.name, "delay", 0.0 if plant.delay is None else float(plant.delay.max()), 0.0, " s"
        )
        for name, _ in plant.rows_by_object_and_inertia:
            check_moves(self.name, name)
        plant.accepted.add(self.name)

    def settle(
        self, q_r: np.ndarray, pose: np.ndarray, plant: Plant
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """The pose itself: the first steps push an overlap out; see `Dynamics.settle`."""
        return pose, [NO_MEMORY] * len(pose)


def quasi_dynamics(options: DynamicsOptions) -> QuasiDynamics:
    """The quasi-dynamic row of the table of dynamics."""
    return QuasiDynamics(*options)

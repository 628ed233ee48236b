"""Quasi-dynamic contact dynamics (paper eq. 11), batched over rows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piec_envs.dynamics.base import INERTIAS, NO_MEMORY, Commands, Motion, Plant, blank_motion, check_shapes
from piec_envs.dynamics.contact_step import ContactModel, rollout_rows
from piec_envs.dynamics.reference import rollout_rows_osqp
from piec_envs.dynamics.rigid import FAILED
from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.parallel import run_rows
from piec_envs.world.objects import get_object
from piec_envs.world.scene import pack_scene

SOLVERS = {"fast": rollout_rows, "osqp": rollout_rows_osqp}
SMALL_BATCH = 64  # row-steps below which a second thread costs more than it brings


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

    def __init__(self, solver: str = "fast", model: ContactModel | None = None, threads: int | None = None):
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

        A first-order model remembers nothing, and knows neither the object's mass nor what `check_first_order` refuses.
        """
        check_shapes(q_r, q_cmd, pose, commands, plant)
        for name, _ in plant.rows_by_object_and_inertia:
            check_first_order(name, 0.0 if plant.delay is None else float(plant.delay.max()))
        batch, steps, _ = commands.values.shape
        groups = [
            (pack_scene(plant.robot, name), self._models[inertia], rows)
            for (name, inertia), rows in plant.rows_by_object_and_inertia.items()
        ]
        motion = blank_motion(q_r, q_cmd, pose, steps, groups[0][0].links)
        arrays = (motion.q_r, motion.q_cmd, motion.pose, motion.actions, motion.link_distance, motion.contact,
                  motion.active)  # fmt: skip
        displacement = np.zeros((batch, 0, 2)) if commands.displacement is None else commands.displacement
        threads = 1 if batch * steps < SMALL_BATCH else self.threads
        for scene, model, rows in groups:
            run_rows(
                SOLVERS[self.solver], len(rows), threads, rows, scene, model,
                commands.values, commands.absolute, displacement, plant.friction, arrays,
            )  # fmt: skip
        motion.hold_diverged(motion.active == FAILED)
        return motion

    def settle(self, q_r: np.ndarray, pose: np.ndarray, plant: Plant) -> tuple[np.ndarray, list[np.ndarray]]:
        """The pose itself: the first steps push an overlap out."""
        return pose, [NO_MEMORY] * len(pose)


def check_first_order(object_name: str, delay: float) -> None:
    """Refuse what a first-order model of one object cannot follow.

    Args:
        object_name: a row of the table of objects.
        delay: from a command to the drives, s.

    Raises:
        InvalidParameterError: for an object with loose bodies, or a delay.
    """
    if delay > 0:
        raise InvalidParameterError(
            f"delay must be 0 under dynamics='quasi_dynamic', whose step is a whole control step; got {delay:g} s "
            "(take dynamics='mujoco', given together with the delay)"
        )
    if get_object(object_name).loose:
        raise InvalidParameterError(
            f"object {object_name!r} has loose bodies, which dynamics='quasi_dynamic' cannot move: it knows one object "
            "and no table; take dynamics='mujoco', given together with the object, or an object without loose bodies"
        )

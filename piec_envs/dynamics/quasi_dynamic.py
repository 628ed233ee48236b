"""Quasi-dynamic contact dynamics (paper eq. 7), batched over rows."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.base import Commands, Motion, Plant
from piec_envs.dynamics.contact_step import ContactModel, rollout_rows
from piec_envs.dynamics.reference import rollout_rows_osqp
from piec_envs.errors import InvalidParameterError, InvalidStateError, check_name
from piec_envs.parallel import run_rows
from piec_envs.world.robots import get_robot
from piec_envs.world.scene import pack_scene

SOLVERS = ("fast", "osqp")
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
        self.model = model
        self.threads = threads
        self._kernel = rollout_rows if solver == "fast" else rollout_rows_osqp

    def rollout(self, q_r: np.ndarray, q_cmd: np.ndarray, pose: np.ndarray, commands: Commands, plant: Plant) -> Motion:
        """Simulate N steps for B rows; see `Dynamics.rollout`."""
        batch, steps, n = commands.values.shape
        _check_shapes(q_r, q_cmd, pose, commands, plant)
        groups = [(rows, pack_scene(plant.robot, name)) for name, rows in plant.rows_by_object.items()]
        links, times = groups[0][1].links, steps + 1
        arrays = (
            np.empty((batch, times, n)),
            np.empty((batch, times, n)),
            np.empty((batch, times, 3)),
            np.empty((batch, steps, n)),
            np.empty((batch, times, links)),
            np.empty((batch, times, links), dtype=np.bool_),
            np.empty((batch, times), dtype=np.int64),
        )
        arrays[0][:, 0], arrays[1][:, 0], arrays[2][:, 0] = q_r, q_cmd, pose
        displacement = np.zeros((batch, 0, 2)) if commands.displacement is None else commands.displacement
        threads = 1 if batch * steps < SMALL_BATCH else self.threads
        for rows, scene in groups:
            run_rows(
                self._kernel, len(rows), threads, rows, scene, self.model,
                commands.values, commands.absolute, displacement, plant.friction, arrays,
            )  # fmt: skip
        return Motion(*arrays)


def _check_shapes(q_r: np.ndarray, q_cmd: np.ndarray, pose: np.ndarray, commands: Commands, plant: Plant) -> None:
    """Refuse arrays that do not fit together: the kernels do not check their bounds.

    Raises:
        InvalidStateError: if a shape differs from that of the commands.
    """
    batch, steps, n = commands.values.shape
    for name, array, shape in (
        ("q_r", q_r, (batch, n)),
        ("q_cmd", q_cmd, (batch, n)),
        ("pose", pose, (batch, 3)),
        ("friction", plant.friction, (batch,)),
        ("displacement", commands.displacement, (batch, steps, 2)),
    ):
        if array is not None and array.shape != shape:
            raise InvalidStateError(f"{name} must have shape {shape}, got {array.shape}")
    if len(plant.objects) != batch or get_robot(plant.robot).dof != n:
        raise InvalidStateError(
            f"{batch} rows of {n} joints do not fit {len(plant.objects)} objects and robot {plant.robot!r}"
        )

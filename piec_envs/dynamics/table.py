"""The table of contact dynamics, and the batch whose rows may each have another one."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.base import NO_MEMORY, Commands, Dynamics, Motion, Plant, blank_motion
from piec_envs.dynamics.contact_step import ContactModel
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.errors import check_name


class DynamicsOptions(NamedTuple):
    """What the rows of the table are made with; each takes what concerns it.

    Args:
        solver: "fast" or "osqp", of the quasi-dynamic model.
        model: settings of the quasi-dynamic model.
        threads: threads over rows; None takes all cores.
    """

    solver: str = "fast"
    model: ContactModel | None = None
    threads: int | None = None


def _quasi_dynamic(options: DynamicsOptions) -> Dynamics:
    """First order: one small quadratic program in each step (paper eq. 11)."""
    return QuasiDynamics(*options)


def _mujoco(options: DynamicsOptions) -> Dynamics:
    """Second order: MuJoCo, the object resting on a table."""
    from piec_envs.dynamics.mujoco_ import MujocoDynamics  # MuJoCo is loaded by those who use it alone

    return MujocoDynamics(options.threads, options.model)


DYNAMICS: dict[str, Callable[[DynamicsOptions], Dynamics]] = {"quasi_dynamic": _quasi_dynamic, "mujoco": _mujoco}


class DynamicsByRow:
    """Simulates each row of a batch under the dynamics that its plant names.

    Args:
        options: what the dynamics are made with, each on first use.
    """

    name = "by row"

    def __init__(self, options: DynamicsOptions | None = None):
        self._options, self._made = options or DynamicsOptions(), dict[str, Dynamics]()

    def _get(self, name: str) -> Dynamics:
        check_name("dynamics", name, DYNAMICS)
        if name not in self._made:
            self._made[name] = DYNAMICS[name](self._options)
        return self._made[name]

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
        groups = plant.rows_by_dynamics
        if len(groups) == 1:
            return self._get(next(iter(groups))).rollout(q_r, q_cmd, pose, commands, plant, memory)
        whole: Motion | None = None
        for name, rows in groups.items():
            displacement = None if commands.displacement is None else commands.displacement[rows]
            motion = self._get(name).rollout(
                q_r[rows], q_cmd[rows], pose[rows],
                Commands(commands.values[rows], commands.absolute, displacement),
                plant.take(rows), None if memory is None else [memory[i] for i in rows],
            )  # fmt: skip
            if whole is None:
                whole = blank_motion(q_r, q_cmd, pose, commands.values.shape[1], motion.link_distance.shape[2])
            _place_rows(whole, rows, motion)
        assert whole is not None  # a batch has rows
        return whole

    def settle(self, q_r: np.ndarray, pose: np.ndarray, plant: Plant) -> tuple[np.ndarray, list[np.ndarray]]:
        """Where overlapping objects stand when the clock starts; see `Dynamics.settle`."""
        settled, memory = pose.copy(), [NO_MEMORY] * len(pose)
        for name, rows in plant.rows_by_dynamics.items():
            settled[rows], kept = self._get(name).settle(q_r[rows], pose[rows], plant.take(rows))
            for row, remembered in zip(rows, kept, strict=True):
                memory[row] = remembered
        return settled, memory


def _place_rows(whole: Motion, rows: np.ndarray, part: Motion) -> None:
    """Write the motion of some rows into that of all."""
    for name, value in vars(part).items():
        if name == "memory":
            for row, memory in zip(rows, value, strict=True):
                whole.memory[row] = memory
        else:
            getattr(whole, name)[rows] = value

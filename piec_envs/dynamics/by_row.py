"""The table of contact dynamics, and the batch whose rows may each have another one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from typing import NamedTuple

import numpy as np

from piec_envs.dynamics.contact_model import ContactModel
from piec_envs.dynamics.protocol import NO_MEMORY, Commands, Dynamics, Motion, Plant, blank_motion
from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.world.objects import get_object


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


@dataclass(frozen=True)
class Backend:
    """A row of the table of contact dynamics.

    Args:
        summary: in a sentence.
        make: what makes a `Dynamics` of `DynamicsOptions`, as `module:function`; loaded by those
            who use it alone.
        fixed: plant parameters, numbers, that it cannot vary, and why: their defaults are all it
            takes.
        loose_bodies: whether it moves objects with loose bodies.
    """

    summary: str
    make: str
    fixed: Mapping[str, str] = field(default_factory=dict)
    loose_bodies: bool = True

    def made(self, options: DynamicsOptions) -> Dynamics:
        """The dynamics itself."""
        module, _, name = self.make.partition(":")
        return getattr(import_module(module), name)(options)


DYNAMICS: dict[str, Backend] = {
    "quasi_dynamic": Backend(
        "First order: one small quadratic program in each step (paper eq. 11).",
        "piec_envs.dynamics.quasi_dynamic:quasi_dynamics",
        fixed={
            "mass": "which moves every mass alike",
            "delay": "whose step is a whole control step",
        },
        loose_bodies=False,
    ),
    "mujoco": Backend(
        "Second order: MuJoCo, the object resting on a table.",
        "piec_envs.dynamics.mujoco_:mujoco_dynamics",
    ),
}


def check_varies(dynamics: str, name: str, value: float, default: float, unit: str = "") -> None:
    """Refuse a value of a plant parameter that a dynamics cannot vary.

    Args:
        dynamics: a row of the table of dynamics.
        name: of the parameter.
        value: the value given.
        default: the parameter's.
        unit: for the message.

    Raises:
        InvalidParameterError: saying which dynamics can.
    """
    reason = DYNAMICS[dynamics].fixed.get(name)
    if reason is not None and value != default:
        able = [
            f"dynamics={other!r}"
            for other, backend in DYNAMICS.items()
            if name not in backend.fixed
        ]
        raise InvalidParameterError(
            f"{name} must be {default:g} under dynamics={dynamics!r}, {reason}; got "
            f"{value:g}{unit} "
            f"(take {' or '.join(able)}, given together with the {name})"
        )


def check_moves(dynamics: str, object_name: str) -> None:
    """Refuse an object with loose bodies that a dynamics cannot move.

    Args:
        dynamics: a row of the table of dynamics.
        object_name: a row of the table of objects.

    Raises:
        InvalidParameterError: saying which dynamics can.
    """
    if get_object(object_name).loose and not DYNAMICS[dynamics].loose_bodies:
        able = [
            f"dynamics={other!r}" for other, backend in DYNAMICS.items() if backend.loose_bodies
        ]
        raise InvalidParameterError(
            f"object {object_name!r} has loose bodies, which dynamics={dynamics!r} cannot move: "
            f"it knows one object "
            f"and no table; take {' or '.join(able)}, given together with the object, or an "
            f"object without loose bodies"
        )


class DynamicsByRow:
    """Simulates each row of a batch under the dynamics that its plant names.

    Args:
        options: what the dynamics are made with, each on first use.
    """

    name = "by row"

    def __init__(self, options: DynamicsOptions | None = None):
        self._options = options or DynamicsOptions()
        self._made = dict[str, Dynamics]()

    def _get(self, name: str) -> Dynamics:
        if name not in self._made:
            check_name("dynamics", name, DYNAMICS)
            self._made[name] = DYNAMICS[name].made(self._options)
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
                whole = blank_motion(
                    q_r, q_cmd, pose, commands.values.shape[1], motion.link_distance.shape[2]
                )
            _place_rows(whole, rows, motion)
        assert whole is not None  # a batch has rows
        return whole

    def settle(
        self, q_r: np.ndarray, pose: np.ndarray, plant: Plant
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Where overlapping objects stand when the clock starts; see `Dynamics.settle`."""
        settled = pose.copy()
        memory = [NO_MEMORY] * len(pose)
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

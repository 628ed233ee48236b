"""The state of a batch of episodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from piec_envs.dynamics.free_bodies import places_of
from piec_envs.dynamics.plant import PlantParams, PlantRows
from piec_envs.dynamics.protocol import NO_MEMORY, Motion
from piec_envs.errors import InvalidStateError, as_floats
from piec_envs.model.terms import JOINT_BOUND, POSITION_BOUND
from piec_envs.world.objects import get_object
from piec_envs.world.robots import Robot


@dataclass
class State:
    """Everything that decides how B episodes go on; time index and parameters included.

    Args:
        q_r: joint positions, shape (B, n), rad or m.
        q_cmd: commanded joint positions, shape (B, n).
        pose: object x, y, angle, shape (B, 3), m and rad.
        start: object pose at the start of the episode, shape (B, 3).
        step: steps taken, shape (B,).
        seed: episode seed, from which the disturbance is drawn, shape (B,).
        escape_time: object's escape time, held since its last refresh, shape (B,), s.
        drift: the adversary's displacement in each step, held likewise, shape (B, 2), m.
        error_sum: tracking errors added up over the episode, shape (B,), m.
        diverged: whether the simulation of a row has become unstable; it rests since then, shape
            (B,).
        params: plant parameters of each row, length B.
        memory: what a row's dynamics needs beside all this to go on, length B; see `Motion`.
    """

    q_r: np.ndarray
    q_cmd: np.ndarray
    pose: np.ndarray
    start: np.ndarray
    step: np.ndarray
    seed: np.ndarray
    escape_time: np.ndarray
    drift: np.ndarray
    error_sum: np.ndarray
    diverged: np.ndarray
    params: PlantRows
    memory: list[np.ndarray]

    def __post_init__(self):
        if not isinstance(self.params, PlantRows):
            self.params = PlantRows(self.params)

    @property
    def rows(self) -> int:
        """B, the number of episodes."""
        return len(self.q_r)

    @staticmethod
    def zeros(rows: int, dof: int) -> State:
        """A blank state of the right shapes.

        Args:
            rows: B.
            dof: n, joints of the robot.

        Returns:
            The state.
        """
        return State(
            q_r=np.zeros((rows, dof)),
            q_cmd=np.zeros((rows, dof)),
            pose=np.zeros((rows, 3)),
            start=np.zeros((rows, 3)),
            step=np.zeros(rows, dtype=np.int64),
            seed=np.zeros(rows, dtype=np.int64),
            escape_time=np.zeros(rows),
            drift=np.zeros((rows, 2)),
            error_sum=np.zeros(rows),
            diverged=np.zeros(rows, dtype=bool),
            params=PlantRows([PlantParams()] * rows),
            memory=[NO_MEMORY] * rows,
        )

    def take(self, rows: Sequence[int] | np.ndarray) -> State:
        """A copy of some rows; a row may be taken more than once."""
        taken: dict[str, Any] = {name: getattr(self, name)[rows] for name in _ARRAYS}
        return State(
            **taken, params=self.params.take(rows), memory=[self.memory[int(i)] for i in rows]
        )

    def moved(self, motion: Motion) -> State:
        """The same episodes at the end of a motion, with the escape time, the drift and the errors
        as they were.

        Args:
            motion: of N steps from this state.
        """
        return State(
            np.ascontiguousarray(motion.q_r[:, -1]),
            np.ascontiguousarray(motion.q_cmd[:, -1]),
            np.ascontiguousarray(motion.pose[:, -1]),
            self.start,
            self.step + motion.actions.shape[1],
            self.seed,
            self.escape_time,
            self.drift,
            self.error_sum,
            np.ascontiguousarray(motion.diverged[:, -1]),
            self.params,
            motion.memory,
        )

    def put(self, rows: np.ndarray, other: State) -> None:
        """Take over other episodes in some rows.

        Args:
            rows: row numbers.
            other: one row for each of them.
        """
        for name in _ARRAYS:
            array = getattr(self, name).copy()
            array[rows] = getattr(other, name)
            setattr(self, name, array)
        self.params = self.params.replaced(rows, other.params)
        self.memory = list(self.memory)
        for row, memory in zip(rows, other.memory, strict=True):
            self.memory[int(row)] = memory

    def loose_places(self, row: int) -> np.ndarray:
        """Where the loose bodies of a row's object stand.

        Args:
            row: its number.

        Returns:
            Position and quaternion of each, shape (k, 7), m.
        """
        item = get_object(self.params[row].object)
        return places_of(item, self.q_r[row], self.pose[row], self.memory[row])[1:]

    def check(self, rows: int, robot: Robot) -> None:
        """Refuse a state that could not have come from `rows` episodes of a robot.

        Args:
            rows: B.
            robot: the robot.

        Raises:
            InvalidStateError: if an array has the wrong shape or is not finite, a step is negative,
                or the object or a joint stands where no observation would show it.
        """
        self._check_arrays(rows, robot.dof)
        self._check_places(robot)
        if len(self.params) != rows or not self.params.are_params:
            raise InvalidStateError(
                f"state field 'params' must be {rows} PlantParams, got {list(self.params)!r}"
            )
        if len(self.memory) != rows:
            raise InvalidStateError(
                f"state field 'memory' must have {rows} arrays, got {len(self.memory)}"
            )
        for memory in self.memory:
            if memory is NO_MEMORY:
                continue
            as_floats("state field 'memory'", memory, (np.size(memory),), InvalidStateError)

    def _check_arrays(self, rows: int, dof: int) -> None:
        """Refuse wrong shapes, numbers that are not finite, and counts that are none."""
        blank = State.zeros(rows, dof)
        for name in _ARRAYS:
            if name == "escape_time":  # behind a hard wall it may be infinite
                as_floats(
                    "state field 'escape_time'",
                    np.nan_to_num(self.escape_time, posinf=0.0, nan=np.nan),
                    (rows,),
                    InvalidStateError,
                )
                continue
            value = as_floats(
                f"state field {name!r}",
                getattr(self, name),
                getattr(blank, name).shape,
                InvalidStateError,
            )
            if name in ("step", "seed") and ((value < 0) | (value != np.floor(value))).any():
                raise InvalidStateError(
                    f"state field {name!r} must be whole numbers of at least 0, got "
                    f"{value.tolist()}"
                )

    def _check_places(self, robot: Robot) -> None:
        """Refuse an object or a joint beyond what an observation holds."""
        for name in ("pose", "start"):
            places = np.asarray(getattr(self, name))[:, :2]
            if (np.abs(places) > POSITION_BOUND).any():
                raise InvalidStateError(
                    f"state field {name!r} must lie within {POSITION_BOUND:g} m of the origin "
                    f"along x and y, "
                    f"got {_worst(places)}"
                )
        lower = robot.joint_array("lower")
        upper = robot.joint_array("upper")
        middle = (upper + lower) / 2
        half = (upper - lower) / 2
        for name in ("q_r", "q_cmd"):
            share = (np.asarray(getattr(self, name)) - middle) / half
            if (np.abs(share) > JOINT_BOUND).any():
                raise InvalidStateError(
                    f"state field {name!r} must stay near the joint limits {lower.tolist()} to "
                    f"{upper.tolist()}, "
                    f"got {_worst(share * half + middle, share)}"
                )

    def copy(self) -> State:
        """An independent copy."""
        return self.take(np.arange(self.rows))


def join_states(states: Sequence[State]) -> State:
    """States one below the other.

    Args:
        states: of any number of rows each.
    """
    if len(states) == 1:
        return states[0]
    arrays: dict[str, Any] = {
        name: np.concatenate([getattr(state, name) for state in states]) for name in _ARRAYS
    }
    params = PlantRows(params for state in states for params in state.params)
    return State(
        **arrays, params=params, memory=[memory for state in states for memory in state.memory]
    )


def _worst(rows: np.ndarray, measure: np.ndarray | None = None) -> list[float]:
    """The row of the largest absolute entry, of `rows` themselves or of `measure`."""
    size = np.abs(rows if measure is None else measure).max(axis=1)
    return np.asarray(rows)[int(size.argmax())].tolist()


_ARRAYS = tuple(
    field.name for field in dataclasses.fields(State) if field.name not in ("params", "memory")
)

"""What every contact dynamics offers: one batched `rollout`, of which a step is the shortest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Protocol

import numpy as np

from piec_envs.errors import InvalidStateError
from piec_envs.world.robots import get_robot

CONTROL_PERIOD = 0.1  # h, s
# m from the origin along x and y; an object beyond has diverged, and no observation shows it
POSITION_LIMIT = 10.0
TOUCH_DISTANCE = 1e-3  # m; links nearer than this count as in contact
# how readily a model of first order turns the object; see `ContactModel.own_inertia`
INERTIAS = ("paper", "own")
NO_MEMORY = np.zeros(0)  # of a row whose joints and object pose say everything


@dataclass(frozen=True, eq=False)
class Plant:
    """What may differ from row to row of a batch.

    Args:
        robot: name of the robot.
        objects: name of the object in each row, length B.
        friction: mu of each row, shape (B,).
        dynamics: name of the dynamics of each row, length B; only `DynamicsByRow` asks for it.
        mass: of each row's object, as a factor of its nominal one, shape (B,); None is 1.
        delay: from a command to the drives, shape (B,), s; None is 0.
        inertia: one of INERTIAS for each row, length B; () is "paper". The quasi-dynamic model
            alone asks for it.
        accepted: names of the dynamics that have found nothing amiss.
    """

    robot: str
    objects: Sequence[str]
    friction: np.ndarray
    dynamics: Sequence[str] = ()
    mass: np.ndarray | None = None
    delay: np.ndarray | None = None
    inertia: Sequence[str] = ()
    accepted: set[str] = field(default_factory=set)

    def fits(self, batch: int, dof: int) -> bool:
        """Whether there is one entry for each row, and the robot has so many joints.

        Args:
            batch: number of rows, B.
            dof: number of joints, n.

        Returns:
            The answer, which is worked out once.
        """
        return self._size == (batch, dof)

    @cached_property
    def _size(self) -> tuple[int, int] | None:
        columns = [array for array in (self.friction, self.mass, self.delay) if array is not None]
        even = all(array.shape == (len(self.objects),) for array in columns)
        return (len(self.objects), get_robot(self.robot).dof) if even else None

    @cached_property
    def rows_by_object(self) -> dict[str, np.ndarray]:
        """Row indices of each object that occurs."""
        return _rows_by_name(self.objects)

    @cached_property
    def rows_by_object_and_inertia(self) -> dict[tuple[str, str], np.ndarray]:
        """Row indices of each object that occurs, for each of its inertias."""
        groups: dict[tuple[str, str], list[int]] = {}
        inertia = self.inertia or [INERTIAS[0]] * len(self.objects)
        for row, key in enumerate(zip(self.objects, inertia, strict=True)):
            groups.setdefault(key, []).append(row)
        return {key: np.array(rows) for key, rows in groups.items()}

    @cached_property
    def rows_by_dynamics(self) -> dict[str, np.ndarray]:
        """Row indices of each dynamics that occurs."""
        return _rows_by_name(self.dynamics)

    def take(self, rows: np.ndarray) -> Plant:
        """The plant of some rows alone."""
        named = (self.objects, self.dynamics, self.inertia)
        objects, dynamics, inertia = ([names[i] for i in rows] if names else () for names in named)
        mass, delay = (None if array is None else array[rows] for array in (self.mass, self.delay))
        return Plant(self.robot, objects, self.friction[rows], dynamics, mass, delay, inertia)


def _rows_by_name(names: Sequence[str]) -> dict[str, np.ndarray]:
    array = np.asarray(names)
    return {str(name): np.flatnonzero(array == name) for name in dict.fromkeys(names)}


@dataclass(eq=False)
class Commands:
    """What the robot is told over N steps.

    Args:
        values: actions in [-1, 1] (times v_max), or absolute joint positions, shape (B, N, n).
        absolute: whether `values` are joint positions, followed at most at v_max.
        displacement: w, the object's free displacement in each step, shape (B, N, 2), m; None is 0.
    """

    values: np.ndarray
    absolute: bool = False
    displacement: np.ndarray | None = None


@dataclass(eq=False)
class Motion:
    """States and contacts over N steps; index 0 of the time axis is the start.

    Args:
        q_r: joint positions, shape (B, N + 1, n), rad or m.
        q_cmd: commanded joint positions, shape (B, N + 1, n).
        pose: object x, y, angle, shape (B, N + 1, 3), m and rad.
        actions: commands as actions in [-1, 1], shape (B, N, n).
        link_distance: signed distance of each link to the object, shape (B, N + 1, links), m.
        contact: links in contact, shape (B, N + 1, links); at the start by distance alone.
        active: links that press on the object, or positive contact multipliers where the model has
            them, in each step, shape (B, N + 1); 0 at the start.
        diverged: whether the simulation has become unstable, its solver has found no answer, or
            none that can be believed; from then on the row rests in its last good state, shape (B,
            N + 1).
        memory: what the dynamics needs beside joints and object pose to go on from the last state
            (velocities, say), one array for each row.
    """

    q_r: np.ndarray
    q_cmd: np.ndarray
    pose: np.ndarray
    actions: np.ndarray
    link_distance: np.ndarray
    contact: np.ndarray
    active: np.ndarray
    diverged: np.ndarray
    memory: list[np.ndarray]

    def hold_diverged(self, failed: np.ndarray) -> None:
        """Let rows rest from their first failed step on.

        Args:
            failed: whether there is no state to go on with, shape (B, N + 1).
        """
        if not np.count_nonzero(failed):  # quicker than any()
            return
        for row in np.flatnonzero(failed.any(axis=1)):
            self.hold(int(row), int(failed[row].argmax()) - 1)

    def hold(self, rows: int | np.ndarray, t: int) -> None:
        """Let rows that have diverged rest in their last good state from then on.

        Args:
            rows: one row number, or several, shape (R,).
            t: time index of that state.
        """
        for array in (self.q_r, self.q_cmd, self.pose, self.link_distance, self.contact):
            array[rows, t + 1 :] = array[rows, t, None]
        self.actions[rows, t:] = 0.0
        self.active[rows, t + 1 :] = 0
        self.diverged[rows, t + 1 :] = True


class Dynamics(Protocol):
    """A contact dynamics backend."""

    name: str

    def rollout(
        self,
        q_r: np.ndarray,
        q_cmd: np.ndarray,
        pose: np.ndarray,
        commands: Commands,
        plant: Plant,
        memory: Sequence[np.ndarray] | None = None,
    ) -> Motion:
        """Simulate N steps for B rows.

        Args:
            q_r: joint positions at the start, shape (B, n).
            q_cmd: commanded positions at the start, shape (B, n).
            pose: object pose at the start, shape (B, 3).
            commands: what the robot is told.
            plant: the parameters of each row.
            memory: of the motion that ended in this start; a row begins at rest where there is
                none, or where it does not fit the joints and the pose.

        Returns:
            The motion; row i does not depend on the other rows.

        Raises:
            InvalidStateError: if the arrays do not fit together.
        """
        ...

    def settle(
        self, q_r: np.ndarray, pose: np.ndarray, plant: Plant
    ) -> tuple[np.ndarray, list[np.ndarray]]:
        """Where an object that overlaps the robot stands when the clock starts, and its loose
        bodies.

        Args:
            q_r: joint positions, held meanwhile, shape (B, n).
            pose: object poses, shape (B, 3).
            plant: the parameters of each row.

        Returns:
            Object poses, shape (B, 3), and what each row's dynamics has to remember of this start.
        """
        ...


def check_shapes(
    q_r: np.ndarray, q_cmd: np.ndarray, pose: np.ndarray, commands: Commands, plant: Plant
) -> None:
    """Refuse arrays that do not fit together: compiled code does not check its bounds.

    Args:
        q_r, q_cmd, pose, commands, plant: as in `Dynamics.rollout`.

    Raises:
        InvalidStateError: if a shape differs from that of the commands, or the robot or the number
            of objects does not fit it.
    """
    batch, steps, n = commands.values.shape
    free = commands.displacement is None or commands.displacement.shape == (batch, steps, 2)
    if (
        free
        and plant.fits(batch, n)
        and q_r.shape == q_cmd.shape == (batch, n)
        and pose.shape == (batch, 3)
    ):
        return
    for name, array, shape in (
        ("q_r", q_r, (batch, n)),
        ("q_cmd", q_cmd, (batch, n)),
        ("pose", pose, (batch, 3)),
        ("friction", plant.friction, (batch,)),
        ("mass", plant.mass, (batch,)),
        ("delay", plant.delay, (batch,)),
        ("displacement", commands.displacement, (batch, steps, 2)),
    ):
        if array is not None and array.shape != shape:
            raise InvalidStateError(f"{name} must have shape {shape}, got {array.shape}")
    if len(plant.objects) != batch or get_robot(plant.robot).dof != n:
        raise InvalidStateError(
            f"{batch} rows of {n} joints do not fit {len(plant.objects)} objects and robot "
            f"{plant.robot!r}"
        )


def blank_motion(
    q_r: np.ndarray, q_cmd: np.ndarray, pose: np.ndarray, steps: int, links: int
) -> Motion:
    """A motion of N steps that holds its start alone, to be filled in place; nothing has diverged.

    Args:
        q_r, q_cmd, pose: the start, as in `Dynamics.rollout`.
        steps: N.
        links: of the robot.

    Returns:
        The motion; from time index 1 on its arrays but `diverged` are not set.
    """
    (batch, n) = q_r.shape
    times = steps + 1
    joints = np.empty((2, batch, times, n))
    joints[0, :, 0] = q_r
    joints[1, :, 0] = q_cmd
    poses = np.empty((batch, times, 3))
    poses[:, 0] = pose
    return Motion(
        joints[0],
        joints[1],
        poses,
        np.empty((batch, steps, n)),
        np.empty((batch, times, links)),
        np.empty((batch, times, links), np.bool_),
        np.empty((batch, times), np.int64),
        np.zeros((batch, times), np.bool_),
        [NO_MEMORY] * batch,
    )

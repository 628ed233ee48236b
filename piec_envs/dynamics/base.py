"""What every contact dynamics offers: one batched `rollout`, of which a step is the shortest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import numpy as np

CONTROL_PERIOD = 0.1  # h, s
TOUCH_DISTANCE = 1e-3  # m; links nearer than this count as in contact


@dataclass(frozen=True, eq=False)
class Plant:
    """What may differ from row to row of a batch.

    Args:
        robot: name of the robot.
        objects: name of the object in each row, length B.
        friction: mu of each row, shape (B,).
    """

    robot: str
    objects: Sequence[str]
    friction: np.ndarray

    @cached_property
    def rows_by_object(self) -> dict[str, np.ndarray]:
        """Row indices of each object that occurs."""
        names = np.asarray(self.objects)
        return {str(name): np.flatnonzero(names == name) for name in dict.fromkeys(self.objects)}


@dataclass(frozen=True, eq=False)
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


@dataclass(frozen=True, eq=False)
class Motion:
    """States and contacts over N steps; index 0 of the time axis is the start.

    Args:
        q_r: joint positions, shape (B, N + 1, n), rad or m.
        q_cmd: commanded joint positions, shape (B, N + 1, n).
        pose: object x, y, angle, shape (B, N + 1, 3), m and rad.
        actions: commands as actions in [-1, 1], shape (B, N, n).
        link_distance: signed distance of each link to the object, shape (B, N + 1, links), m.
        contact: links in contact, shape (B, N + 1, links); at the start by distance alone.
        active: positive contact multipliers in each step, shape (B, N + 1); 0 at the start.
    """

    q_r: np.ndarray
    q_cmd: np.ndarray
    pose: np.ndarray
    actions: np.ndarray
    link_distance: np.ndarray
    contact: np.ndarray
    active: np.ndarray


class Dynamics(Protocol):
    """A contact dynamics backend."""

    name: str

    def rollout(self, q_r: np.ndarray, q_cmd: np.ndarray, pose: np.ndarray, commands: Commands, plant: Plant) -> Motion:
        """Simulate N steps for B rows.

        Args:
            q_r: joint positions at the start, shape (B, n).
            q_cmd: commanded positions at the start, shape (B, n).
            pose: object pose at the start, shape (B, 3).
            commands: what the robot is told.
            plant: the parameters of each row.

        Returns:
            The motion; row i does not depend on the other rows.
        """
        ...

"""An execution of a plan as figures show it, and the box around some."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from piec_envs import (
    CONTROL_PERIOD,
    GOAL_RADIUS,
    Object,
    Robot,
    get_object,
    get_robot,
    rendering,
)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One execution of a plan and, where there are any, disturbed executions of the same plan.

    Args:
        mode: key of MODES, or any name.
        robot_name: row of the table of robots.
        object_name: row of the table of objects.
        goal: centre of the goal region, shape (2,), m.
        q_r: joint positions, shape (N + 1, n), rad or m.
        pose: object x, y, angle, shape (N + 1, 3), m and rad.
        contact: links in contact, shape (N + 1, links); None where not known.
        disturbed: object poses of M disturbed executions, shape (M, N + 1, 3); None without any.
        reference: path to be tracked, shape (m, 2), m; None for a goal task.
        period: time between two entries, s: longer than a control step in thinned executions.
        loose: position and quaternion of the object's k loose bodies, shape (N + 1, k, 7); None
            where it has none, or they are not known.
    """

    mode: str
    robot_name: str
    object_name: str
    goal: np.ndarray
    q_r: np.ndarray
    pose: np.ndarray
    contact: np.ndarray | None = None
    disturbed: np.ndarray | None = None
    reference: np.ndarray | None = None
    period: float = CONTROL_PERIOD
    loose: np.ndarray | None = None

    @property
    def robot(self) -> Robot:
        """The robot."""
        return get_robot(self.robot_name)

    @property
    def object(self) -> Object:
        """The object."""
        return get_object(self.object_name)

    @property
    def steps(self) -> int:
        """N, the number of steps."""
        return len(self.pose) - 1

    @property
    def first_contact(self) -> int | None:
        """Step of the first contact; None if there is none or contacts are not known."""
        if self.contact is None or not self.contact.any():
            return None
        return int(self.contact.any(axis=1).argmax())

    @property
    def inside(self) -> np.ndarray:
        """Whether the object of each disturbed execution is in the goal region, shape (M, N
        + 1).
        """
        disturbed = self.pose[None] if self.disturbed is None else self.disturbed
        return np.hypot(*np.moveaxis(disturbed[..., :2] - self.goal, -1, 0)) <= GOAL_RADIUS


def bounds(
    trajectories: Sequence[Trajectory], frames: Sequence[Sequence[int]], margin: float = 0.05
) -> np.ndarray:
    """Box around what is drawn of some trajectories.

    Args:
        trajectories: what is drawn.
        frames: for each of them the steps at which its robot is drawn.
        margin: space around it, m.

    Returns:
        ((x_min, x_max), (y_min, y_max)), m.
    """
    points = []
    for trajectory, steps in zip(trajectories, frames, strict=True):
        reach = trajectory.object.bounding_radius
        for step in steps:
            points += rendering.arm_outlines(trajectory.robot, trajectory.q_r[step])
        for path in (
            trajectory.pose,
            trajectory.pose if trajectory.disturbed is None else trajectory.disturbed,
        ):
            points += [path[..., :2].reshape(-1, 2) + shift for shift in (-reach, reach)]
        points += [] if trajectory.reference is None else [trajectory.reference]
        points += [trajectory.goal[None] + shift for shift in (-GOAL_RADIUS, GOAL_RADIUS)]
    cloud = np.concatenate(points)  # (m, 2)
    return np.stack([cloud.min(axis=0) - margin, cloud.max(axis=0) + margin], axis=1)

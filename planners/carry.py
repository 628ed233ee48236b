"""Carrying the object with the posture of the start: the control that optimises nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piec_envs import InvalidParameterError, Task, as_count, as_floats, check_motion
from planners.base import Plan, nominal_start, realised_plan


def carried_base(task: Task, place: np.ndarray, share: np.ndarray, arrive: float) -> np.ndarray:
    """Where a sliding base moves to carry an object to the goal in a straight line, or along the
    reference.

    Args:
        task: what is to be done.
        place: of the object at the start, shape (2,), m.
        share: of the horizon that has passed, shape (m,).
        arrive: share after which the goal is reached.

    Returns:
        Displacements of the base, shape (m, 2), m.
    """
    if task.tracks:
        return task.reference[np.rint(share * task.horizon).astype(int)] - place
    return np.minimum(1.0, share / arrive)[:, None] * (task.goal - place)


@dataclass(frozen=True)
class RigidCarry:
    """Plans a path on which the base alone moves and the arm keeps the posture of the start.

    Args:
        arrive: share of the horizon after which the goal is reached; a reference is followed in
            time.
    """

    arrive: float = 0.6

    def __post_init__(self):
        if not 0 < float(as_floats("arrive", self.arrive, (), InvalidParameterError)) <= 1:
            raise InvalidParameterError(f"arrive must be above 0 and at most 1, got {self.arrive}")

    def plan(self, env_id: str, seed: int = 0, progress: bool = True, **env_kwargs: Any) -> Plan:
        """Plan for an environment.

        Args:
            env_id: id of the environment.
            seed: recorded in the plan; nothing is drawn.
            progress: not needed.
            env_kwargs: keyword arguments of the nominal model.

        Returns:
            The plan.

        Raises:
            UnknownNameError: for an unknown environment or keyword argument.
            InvalidParameterError: if the robot stands still.
        """
        check_motion(env_id)
        as_count("seed", seed, least=0)
        nominal = {"escape_field": None, **env_kwargs}
        model, start, _ = nominal_start(env_id, nominal, seed)
        task = model.task
        if model.robot.base_dof == 0:
            raise InvalidParameterError(
                f"{env_id!r} has no base that slides, so that nothing can be carried"
            )
        share = np.arange(1, task.horizon + 1) / task.horizon
        path = np.repeat(start.q_r, len(share), axis=0)  # (N, n)
        path[:, : model.robot.base_dof] += carried_base(task, start.pose[0, :2], share, self.arrive)
        return realised_plan(
            model,
            start,
            path,
            env_id=env_id,
            env_kwargs=nominal,
            via_points=path[-1:],
            objective="carry",
            preset=nominal.get("preset", "default"),
            seed=seed,
        )

"""Carrying the object with the posture of the start: the control that optimises nothing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.errors import InvalidParameterError, as_count, as_floats
from piec_envs.registration import check_motion
from planners.base import Plan, nominal_start, realised_plan


def carried_base(batch: EpisodeBatch, place: np.ndarray, share: np.ndarray, arrive: float) -> np.ndarray:
    """Where a sliding base moves to carry an object to the goal in a straight line, or along the reference.

    Args:
        batch: gives the task.
        place: of the object at the start, shape (2,), m.
        share: of the horizon that has passed, shape (m,).
        arrive: share after which the goal is reached.

    Returns:
        Displacements of the base, shape (m, 2), m.
    """
    task = batch.task
    if batch.tracking:
        return task.reference[np.rint(share * task.horizon).astype(int)] - place
    return np.minimum(1.0, share / arrive)[:, None] * (task.goal - place)


@dataclass(frozen=True)
class RigidCarry:
    """Plans a path on which the base alone moves and the arm keeps the posture of the start.

    Args:
        arrive: share of the horizon after which the goal is reached; a reference is followed in time.
    """

    arrive: float = 0.6

    def __post_init__(self):
        if not 0 < float(as_floats("arrive", self.arrive, (), InvalidParameterError)) <= 1:
            raise InvalidParameterError(f"arrive must be above 0 and at most 1, got {self.arrive}")

    def plan(self, env_id: str, seed: int = 0, progress: bool = True, **env_kwargs: Any) -> Plan:
        """Plan for an environment; arguments and result as those of `CmaEsPlanner.plan`.

        Raises:
            UnknownNameError: for an unknown environment or keyword argument.
            InvalidParameterError: if the robot stands still.
        """
        check_motion(env_id)
        as_count("seed", seed, least=0)
        nominal = {"escape_field": None, **env_kwargs}
        batch, start, _ = nominal_start(env_id, nominal, seed)
        if batch.robot.base_dof == 0:
            raise InvalidParameterError(f"{env_id!r} has no base that slides, so that nothing can be carried")
        share = np.arange(1, batch.task.horizon + 1) / batch.task.horizon
        path = np.repeat(start.q_r, len(share), axis=0)  # (N, n)
        path[:, : batch.robot.base_dof] += carried_base(batch, start.pose[0, :2], share, self.arrive)
        return realised_plan(
            batch, start, path, env_id=env_id, env_kwargs=nominal, via_points=path[-1:], objective="carry",
            preset=batch.config.preset, seed=seed,
        )  # fmt: skip

"""Static caging: the posture that encloses the object best (paper, eq. 8)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from piec_envs.dynamics.base import Commands, Plant
from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.escape.field import EscapeField, object_escape_time
from piec_envs.world.objects import get_object
from planners.objectives import self_distances
from planners.strategy import GUESS_STREAM, make_strategy

PENETRATION_WEIGHT = 1e3  # s of escape time per metre of overlap
CLEARANCE = 0.005  # m; a posture that touches nothing can be reached


def posture_values(
    batch: EpisodeBatch, field: EscapeField, pose: np.ndarray, q: np.ndarray, clearance: float = CLEARANCE
) -> np.ndarray:
    """Escape time of the object at a pose within each posture, less a penalty on overlap.

    Args:
        batch: gives robot, object and dynamics.
        field: the escape field.
        pose: object pose, shape (3,).
        q: postures, shape (B, n).
        clearance: distance to object and self below which a posture is penalised, m.

    Returns:
        Shape (B,), s.
    """
    rows, name = len(q), batch.config.object
    poses = np.repeat(pose[None], rows, axis=0)
    plant = Plant(batch.robot.name, [name] * rows, np.zeros(rows))
    still = batch.dynamics.rollout(q, q, poses, Commands(np.zeros((rows, 0, q.shape[1]))), plant)
    least = np.minimum(still.link_distance[:, 0].min(axis=1), self_distances(batch, q[:, None], 1)[:, 0])  # (B,)
    overlap = np.maximum(0.0, clearance - least)
    return object_escape_time(field, get_object(name).key_points, poses, q) - PENETRATION_WEIGHT * overlap


def enclosing_posture(
    batch: EpisodeBatch,
    field: EscapeField,
    pose: np.ndarray,
    seed: Sequence[int],
    iterations: int = 60,
    population: int = 50,
    curl: float | None = None,
) -> np.ndarray:
    """The posture with the largest escape time of the object at a pose.

    Random curled postures start CMA-ES, since the objective is flat where the arm is far away.

    Args:
        batch: gives robot, object and dynamics.
        field: the escape field.
        pose: object pose, shape (3,).
        seed: numbers that seed all randomness.
        iterations, population: budget of CMA-ES.
        curl: 1 or -1 to start from arms curled to the left or right; None takes both.

    Returns:
        Joint positions, shape (n,).
    """
    rng = np.random.default_rng([GUESS_STREAM, *seed])
    lower, upper = batch.robot.joint_array("lower"), batch.robot.joint_array("upper")
    sample = rng.uniform(lower, upper, (20 * population, len(lower)))
    side = rng.choice([-1.0, 1.0], (len(sample), 1)) if curl is None else curl
    sample[:, 1:] = np.abs(sample[:, 1:]) * side
    best = sample[int(np.argmax(posture_values(batch, field, pose, sample)))]
    search = make_strategy(best, 0.2, population, seed, bounds=(lower, upper))
    for _ in range(iterations):
        candidates = search.ask()
        search.tell(candidates, list(-posture_values(batch, field, pose, np.array(candidates))))
    return np.asarray(search.result.xbest)

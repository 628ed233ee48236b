"""Static caging: the posture that encloses the object best (paper, eq. 8)."""

from __future__ import annotations

import cma
import numpy as np

from piec_envs.dynamics.base import Commands, Plant
from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.escape.field import EscapeField, object_escape_time
from piec_envs.world.objects import get_object

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
    overlap = np.maximum(0.0, clearance - still.link_distance[:, 0].min(axis=1))  # (B,)
    return object_escape_time(field, get_object(name).key_points, poses, q) - PENETRATION_WEIGHT * overlap


def enclosing_posture(
    batch: EpisodeBatch,
    field: EscapeField,
    pose: np.ndarray,
    seed: int,
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
        seed: of all randomness.
        iterations, population: budget of CMA-ES.
        curl: 1 or -1 to start from arms curled to the left or right; None takes both.

    Returns:
        Joint positions, shape (n,).
    """
    rng = np.random.default_rng(seed)
    lower, upper = batch.robot.joint_array("lower"), batch.robot.joint_array("upper")
    sample = rng.uniform(lower, upper, (20 * population, len(lower)))
    side = rng.choice([-1.0, 1.0], (len(sample), 1)) if curl is None else curl
    sample[:, 1:] = np.abs(sample[:, 1:]) * side
    best = sample[int(np.argmax(posture_values(batch, field, pose, sample)))]
    search = cma.CMAEvolutionStrategy(
        best, 0.2, {"popsize": population, "seed": seed + 1, "bounds": [lower, upper], "verbose": -9}
    )
    for _ in range(iterations):
        candidates = search.ask()
        search.tell(candidates, list(-posture_values(batch, field, pose, np.array(candidates))))
    return np.asarray(search.result.xbest)

"""The objectives of the planners: which prior, against which nominal plant."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.episodes.rollout import Rollout
from piec_envs.episodes.state import State
from piec_envs.episodes.tasks import GOAL_RADIUS
from piec_envs.errors import check_name
from piec_envs.geometry.distance import self_distance
from piec_envs.geometry.kinematics import link_frames, place_shapes
from piec_envs.kernels import batch_kernel
from piec_envs.parallel import run_rows
from piec_envs.world.scene import pack_scene

CROSSING_EVERY = 10  # steps between two checks of the arm against itself
CROSSING_WEIGHT = 1e6  # per metre of overlap and step checked: far above any stage cost
DIVERGENCE_WEIGHT = 1e6  # per step that a simulation did not reach, likewise
MISS_MARGIN = 0.02  # m; disturbed runs are to end in a region smaller by this much


@dataclass(frozen=True)
class Objective:
    """One row of the table of objectives (the paper's modes 1 to 4).

    Args:
        prior: the contact prior in the stage cost.
        adversary: speed of the fleeing object in the nominal model, as a fraction of u_bar.
        escape_field: whether the objective needs the escape field.
        label: what figures and tables call it.
    """

    prior: str
    adversary: float
    escape_field: bool
    label: str


OBJECTIVES = {
    "contact": Objective("contact", 0.0, False, "contact (mode 1)"),
    "proximity": Objective("proximity", 0.0, False, "proximity (mode 2)"),
    "caging": Objective("caging", 0.0, True, "caging (mode 3)"),
    "adversarial": Objective("caging", 1.0, True, "adversarial (mode 4)"),
}


def get_objective(name: str) -> Objective:
    """The objective of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("objective", name, OBJECTIVES)
    return OBJECTIVES[name]


@batch_kernel
def _self_distance_rows(lo, hi, scene, path, every, least):
    """Least distance of the arm to itself at every k-th step of each path, shape (B, N // k)."""
    frames = np.empty((scene.stiffness.shape[0] + 1, 4))
    vertices, centres = np.empty_like(scene.robot.vertices), np.empty_like(scene.robot.centre)
    for i in range(lo, hi):
        for k in range(least.shape[1]):
            link_frames(scene, path[i, (k + 1) * every - 1], frames)
            place_shapes(scene.robot, frames, vertices, centres)
            least[i, k] = self_distance(scene, vertices)


def self_distances(batch: EpisodeBatch, path: np.ndarray, every: int) -> np.ndarray:
    """Least distance between parts of the arm that could collide, at every k-th configuration of each path.

    Parts that cannot touch the object count as well.

    Args:
        batch: gives the robot.
        path: joint positions, shape (B, N, n).
        every: k.

    Returns:
        Shape (B, N // k), m; negative where the arm overlaps itself.
    """
    path, scene = np.ascontiguousarray(path), pack_scene(batch.robot.whole_name, batch.config.object)
    least = np.empty((len(path), path.shape[1] // every))
    run_rows(_self_distance_rows, len(path), batch.config.threads, scene, path, every, least)
    return least


def crossing(batch: EpisodeBatch, path: np.ndarray) -> np.ndarray:
    """How far the arm overlaps itself along each path, added up over every tenth step.

    Args:
        batch: gives the robot.
        path: joint positions, shape (B, N, n).

    Returns:
        Shape (B,), m; 0 where links that could collide never overlap.
    """
    return np.maximum(0.0, -self_distances(batch, path, CROSSING_EVERY)).sum(axis=1)


class PathCost:
    """Cost of following joint paths from one start under the nominal model.

    Args:
        batch: the nominal model.
        start: one state.
    """

    def __init__(self, batch: EpisodeBatch, start: State):
        self.batch, self.start = batch, start
        self._plain = EpisodeBatch(
            dataclasses.replace(batch.config, escape_field=None, prior=None, adversary=0.0), rows=1
        )

    def nominal(self, path: np.ndarray) -> np.ndarray:
        """Summed stage cost of each path without noise, and the penalties on links that cross and on divergence.

        Args:
            path: absolute joint positions, shape (B, N, n).

        Returns:
            Shape (B,).
        """
        rollout = self._run(path)
        return rollout.cost + self._crossed(rollout) + _unreached(rollout)

    def disturbed(self, path: np.ndarray, samples: State) -> np.ndarray:
        """The nominal cost with its task term averaged over disturbed runs, with penalties on misses and divergence.

        The disturbed runs follow the joint path that the nominal run realised, since that is what will
        be executed: a commanded path can press on the object, the realised one only encloses it.

        Args:
            path: absolute joint positions, shape (B, N, n).
            samples: the start with S disturbances.

        Returns:
            Shape (B,).
        """
        rollout = self._run(path)
        nominal = rollout.column("cost_task")[:, 1:].sum(axis=1)
        rows, count = len(path), samples.rows
        noisy = self._plain.rollout(
            samples.take(np.tile(np.arange(count), rows)),
            np.repeat(rollout.motion.q_r[:, 1:], count, axis=0),
            absolute=True,
        )
        task = noisy.column("cost_task")[:, 1:].sum(axis=1).reshape(rows, count).sum(axis=1)  # (B,)
        excess = (nominal + task) / (1 + count) - nominal
        beyond = noisy.column("goal_distance")[:, -1].reshape(rows, count) - (GOAL_RADIUS - MISS_MARGIN)
        miss = self.batch.weights.miss * np.maximum(0.0, beyond).mean(axis=1)
        cost = rollout.cost + self.batch.weights.task * excess + miss + self._crossed(rollout)
        return cost + _unreached(rollout) + _unreached(noisy).reshape(rows, count).mean(axis=1)

    def _run(self, path: np.ndarray) -> Rollout:
        return self.batch.rollout(self.start, path, absolute=True)

    def _crossed(self, rollout: Rollout) -> np.ndarray:
        """Penalty on links that cross each other, shape (B,)."""
        return CROSSING_WEIGHT * crossing(self.batch, rollout.motion.q_r[:, 1:])


def _unreached(rollout: Rollout) -> np.ndarray:
    """Penalty on what a row that has diverged leaves out, shape (B,): it rests, which looks cheap."""
    return DIVERGENCE_WEIGHT * rollout.motion.diverged.sum(axis=1)

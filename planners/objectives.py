"""The objectives of the planners: which prior, against which nominal plant."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from piec_envs import GOAL_RADIUS, Model, Rollout, State, check_name, self_distances

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


def crossing(model: Model, path: np.ndarray) -> np.ndarray:
    """How far the arm overlaps itself along each path, added up over every tenth step.

    Parts that cannot touch the object count as well.

    Args:
        model: gives the robot.
        path: joint positions, shape (B, N, n).

    Returns:
        Shape (B,), m; 0 where links that could collide never overlap.
    """
    some = path[:, CROSSING_EVERY - 1 :: CROSSING_EVERY]
    least = self_distances(model.robot.whole_name, some, model.setup.threads)
    return np.maximum(0.0, -least).sum(axis=1)


class PathCost:
    """Cost of following joint paths from one start under the nominal model.

    Args:
        model: the nominal one.
        start: one state.
    """

    def __init__(self, model: Model, start: State):
        self.model = model
        self.start = start
        calm = model.setup.plant.replace({"adversary": 0.0})
        self._plain = Model(
            dataclasses.replace(model.setup, plant=calm, escape_field=None, prior=-1)
        )
        # what moves as the nominal model does, without the prior's cost
        flees = model.setup.plant.adversary > 0
        self._moved = Model(dataclasses.replace(model.setup, prior=-1)) if flees else self._plain

    def nominal(self, path: np.ndarray) -> np.ndarray:
        """Summed stage cost of each path without noise, and the penalties on links that cross and
        on divergence.

        Args:
            path: absolute joint positions, shape (B, N, n).

        Returns:
            Shape (B,).
        """
        rollout = self._run(path)
        return rollout.cost + self._crossed(rollout) + _unreached(rollout)

    def disturbed(self, path: np.ndarray, samples: State) -> np.ndarray:
        """The nominal cost with its task term averaged over disturbed runs, with penalties on
        misses and divergence.

        The disturbed runs follow the joint path that the nominal run realised, since that is what
        will be executed: a commanded path can press on the object, the realised one only encloses
        it.

        Args:
            path: absolute joint positions, shape (B, N, n).
            samples: the start with S disturbances.

        Returns:
            Shape (B,).
        """
        rollout = self._run(path)
        return self._averaged(rollout, rollout.motion.q_r[:, 1:], samples)

    def executed(self, path: np.ndarray, samples: State) -> np.ndarray:
        """The same for paths that a nominal run has realised, each executed as it is.

        A commanded path that presses on a fleeing object may realise a path that loses it.

        Args:
            path: absolute joint positions, shape (B, N, n), from `realised`.
            samples: the start with S disturbances.

        Returns:
            Shape (B,).
        """
        return self._averaged(self._run(path), path, samples)

    def realised(self, path: np.ndarray) -> np.ndarray:
        """The joint paths that nominal runs of commanded ones realise.

        Args:
            path: absolute joint positions, shape (B, N, n).

        Returns:
            Shape (B, N, n).
        """
        return self._moved.rollout(self.start, path, absolute=True).motion.q_r[:, 1:]

    def _averaged(self, rollout: Rollout, path: np.ndarray, samples: State) -> np.ndarray:
        """Cost of a nominal rollout with its task term averaged over disturbed runs of a path."""
        nominal = rollout.column("cost_task")[:, 1:].sum(axis=1)
        rows = len(path)
        count = samples.rows
        noisy = self._plain.rollout(
            samples.take(np.tile(np.arange(count), rows)),
            np.repeat(path, count, axis=0),
            absolute=True,
        )
        task = noisy.column("cost_task")[:, 1:].sum(axis=1).reshape(rows, count).sum(axis=1)  # (B,)
        excess = (nominal + task) / (1 + count) - nominal
        beyond = noisy.column("goal_distance")[:, -1].reshape(rows, count) - (
            GOAL_RADIUS - MISS_MARGIN
        )
        miss = self.model.weights.miss * np.maximum(0.0, beyond).mean(axis=1)
        cost = rollout.cost + self.model.weights.task * excess + miss + self._crossed(rollout)
        return cost + _unreached(rollout) + _unreached(noisy).reshape(rows, count).mean(axis=1)

    def _run(self, path: np.ndarray) -> Rollout:
        return self.model.rollout(self.start, path, absolute=True)

    def _crossed(self, rollout: Rollout) -> np.ndarray:
        """Penalty on links that cross each other, shape (B,)."""
        return CROSSING_WEIGHT * crossing(self.model, rollout.motion.q_r[:, 1:])


def _unreached(rollout: Rollout) -> np.ndarray:
    """Penalty on what a row that has diverged leaves out, shape (B,): it rests, which looks
    cheap.
    """
    return DIVERGENCE_WEIGHT * rollout.motion.diverged.sum(axis=1)

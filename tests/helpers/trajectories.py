"""Trajectories to draw: an arm that curls while the object drifts to the goal."""

from __future__ import annotations

import numpy as np

from evaluation.figures import Trajectory

STEPS = 60
ROLLOUTS = 7
GOAL = np.array([-0.3, 0.4])


def make_trajectory(mode: str, seed: int) -> Trajectory:
    """One plan's trajectory and its disturbed ones; contact from step 20 on."""
    rng = np.random.default_rng(seed)
    share = np.linspace(0, 1, STEPS + 1)[:, None]
    q_r = share * [1.5, 1.0, 1.2, 1.4]
    pose = np.column_stack([np.array([0.55, 0.25]) * (1 - share) + GOAL * share, share])
    noise = np.cumsum(0.01 * rng.standard_normal((ROLLOUTS, STEPS + 1, 3)), axis=1)
    contact = np.zeros((STEPS + 1, 4), dtype=bool)
    contact[20:, 2] = True
    return Trajectory(mode, "planar_arm", "circle", GOAL, q_r, pose, contact, pose + noise)


PLANS = [
    make_trajectory(mode, seed) for seed, mode in enumerate(("contact", "proximity", "caging"))
]

"""Random motions of the planar arm that touch an object, or hold it between the links."""

from __future__ import annotations

import numpy as np

from piec_envs.dynamics.protocol import Commands, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics


def _still(object_name: str, q: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Distance of each link to the object, shape (rows, links)."""
    plant = Plant("planar_arm", [object_name] * len(q), np.full(len(q), 0.5))
    return (
        QuasiDynamics()
        .rollout(q, q, pose, Commands(np.zeros((len(q), 0, 4))), plant)
        .link_distance[:, 0]
    )


def _touching(object_name: str, rows: int, rng: np.random.Generator):
    """Random arms with the object shifted until it nearly touches its nearest link."""
    tries = 20 * rows
    q = np.column_stack([rng.uniform(-3, 3, tries), rng.uniform(-2, 2, (tries, 3))])
    pose = np.column_stack([rng.uniform(-0.7, 0.7, (tries, 2)), rng.uniform(-3, 3, tries)])
    for _ in range(20):  # fixed-point iteration: move straight towards the arm by the distance
        distance = _still(object_name, q, pose).min(axis=1)
        shifted = [_still(object_name, q, pose + 1e-6 * np.eye(3)[k]).min(axis=1) for k in range(2)]
        slope = (np.array(shifted).T - distance[:, None]) / 1e-6
        pose[:, :2] -= slope * (distance[:, None] - 5e-4)
    distance = _still(object_name, q, pose).min(axis=1)
    keep = np.flatnonzero((distance > 0) & (distance < 1e-3))[:rows]
    return q[keep], pose[keep]


def _squeezed(object_name: str, rows: int, rng: np.random.Generator):
    """Arms that have closed on an object between their links."""
    tries = 120 * rows
    sign = rng.choice([-1.0, 1.0], tries)
    q = np.column_stack(
        [rng.uniform(-3, 3, tries), sign[:, None] * rng.uniform(0.6, 2.2, (tries, 3))]
    )
    pose = np.column_stack([rng.uniform(-0.6, 0.6, (tries, 2)), rng.uniform(-3, 3, tries)])
    distance = np.sort(_still(object_name, q, pose), axis=1)
    keep = np.flatnonzero((distance[:, 0] > 0) & (distance[:, 1] < 0.1))[: 3 * rows]
    closing = np.concatenate(
        [np.zeros((len(keep), 1)), np.repeat(sign[keep, None], 3, axis=1)], axis=1
    )
    plant = Plant("planar_arm", [object_name] * len(keep), np.full(len(keep), 0.5))
    commands = Commands(np.repeat(closing[:, None], 400, axis=1))
    motion = QuasiDynamics().rollout(q[keep], q[keep], pose[keep], commands, plant)
    held = np.flatnonzero(motion.active[:, -1] >= 2)[:rows]
    return motion.q_r[held, -1], motion.pose[held, -1]


def random_motion_of(object_name, rows=60, steps=200, seed=0, sigma=0.0, dynamics=None):
    """Rollouts of random actions, held for 50 to 200 steps, from touching and from squeezed
    states.
    """
    dynamics = dynamics or QuasiDynamics()
    rng = np.random.default_rng(seed)
    touching = _touching(object_name, rows // 2, rng)
    squeezed = _squeezed(object_name, rows - rows // 2, rng)
    q = np.vstack([touching[0], squeezed[0]])
    pose = np.vstack([touching[1], squeezed[1]])
    actions = np.empty((len(q), steps, 4))
    for row in actions:
        t = 0
        while t < steps:
            hold = int(rng.integers(50, 201))
            row[t : t + hold] = rng.uniform(-1, 1, 4)
            t += hold
    displacement = sigma * rng.standard_normal((len(q), steps, 2)) if sigma else None
    plant = Plant("planar_arm", [object_name] * len(q), np.full(len(q), 0.5))
    return dynamics.rollout(q, q, pose, Commands(actions, displacement=displacement), plant)

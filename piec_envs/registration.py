"""Registers every environment with Gymnasium."""

from __future__ import annotations

from typing import NamedTuple

import gymnasium as gym

HORIZON = 1000


class Entry(NamedTuple):
    """One row of the table of environments.

    Args:
        entry_point: the single env, `module:class`.
        vector_entry_point: the VectorEnv.
        max_episode_steps: steps of an episode of motion; None for tasks that end by themselves.
    """

    entry_point: str
    vector_entry_point: str
    max_episode_steps: int | None = HORIZON


ENVS = {
    "piec_envs/PlanarArmPush-v0": Entry(
        "piec_envs.env:PlanarArmPushEnv", "piec_envs.vector_env:PlanarArmPushVectorEnv"
    ),
    "piec_envs/PlanarArmTrack-v0": Entry(
        "piec_envs.env:PlanarArmTrackEnv", "piec_envs.vector_env:PlanarArmTrackVectorEnv"
    ),
    "piec_envs/PlanarArmCage-v0": Entry(
        "piec_envs.cage_env:PlanarArmCageEnv", "piec_envs.cage_env:PlanarArmCageVectorEnv", None
    ),
    "piec_envs/FrankaCage-v0": Entry(
        "piec_envs.franka_env:FrankaCageEnv", "piec_envs.franka_env:FrankaCageVectorEnv", None
    ),
    "piec_envs/FrankaPush-v0": Entry("piec_envs.franka_env:FrankaPushEnv", "piec_envs.franka_env:FrankaPushVectorEnv"),
    "piec_envs/MobileFrankaPush-v0": Entry(
        "piec_envs.franka_env:MobileFrankaPushEnv", "piec_envs.franka_env:MobileFrankaPushVectorEnv"
    ),
    "piec_envs/MobileFrankaTrack-v0": Entry(
        "piec_envs.franka_env:MobileFrankaTrackEnv", "piec_envs.franka_env:MobileFrankaTrackVectorEnv"
    ),
}
MOTIONS = tuple(env_id for env_id, entry in ENVS.items() if entry.max_episode_steps)  # what plans are made for


def register_envs() -> None:
    """Register every row of the table; rows that are registered already stay as they are."""
    for env_id, entry in ENVS.items():
        if env_id not in gym.registry:
            gym.register(env_id, **entry._asdict())

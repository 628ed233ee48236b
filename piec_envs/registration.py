"""Registers every environment with Gymnasium."""

from __future__ import annotations

import gymnasium as gym

HORIZON = 1000

# id -> (single env, VectorEnv)
ENVS = {
    "piec_envs/PlanarArmPush-v0": ("piec_envs.env:PlanarArmPushEnv", "piec_envs.vector_env:PlanarArmPushVectorEnv"),
    "piec_envs/PlanarArmTrack-v0": ("piec_envs.env:PlanarArmTrackEnv", "piec_envs.vector_env:PlanarArmTrackVectorEnv"),
}


def register_envs() -> None:
    """Register every row of the table; rows that are registered already stay as they are."""
    for env_id, (entry_point, vector_entry_point) in ENVS.items():
        if env_id not in gym.registry:
            gym.register(
                env_id,
                entry_point=entry_point,
                vector_entry_point=vector_entry_point,
                max_episode_steps=HORIZON,
            )

"""Registers every environment with Gymnasium."""

from __future__ import annotations

from typing import Any, NamedTuple

import gymnasium as gym

from piec_envs.errors import InvalidParameterError, PiecError, UnknownNameError, check_name


class Entry(NamedTuple):
    """One row of the table of environments.

    Args:
        entry_point: the single env, `module:class`.
        vector_entry_point: the VectorEnv.
        motion: whether an episode is a motion; False for static caging, which ends with its first step.
    """

    entry_point: str
    vector_entry_point: str
    motion: bool = True


ENVS = {
    "piec_envs/PlanarArmPush-v0": Entry(
        "piec_envs.env:PlanarArmPushEnv", "piec_envs.vector_env:PlanarArmPushVectorEnv"
    ),
    "piec_envs/PlanarArmTrack-v0": Entry(
        "piec_envs.env:PlanarArmTrackEnv", "piec_envs.vector_env:PlanarArmTrackVectorEnv"
    ),
    "piec_envs/PlanarArmCage-v0": Entry(
        "piec_envs.cage_env:PlanarArmCageEnv", "piec_envs.cage_env:PlanarArmCageVectorEnv", motion=False
    ),
    "piec_envs/FrankaCage-v0": Entry(
        "piec_envs.franka_env:FrankaCageEnv", "piec_envs.franka_env:FrankaCageVectorEnv", motion=False
    ),
    "piec_envs/FrankaPush-v0": Entry("piec_envs.franka_env:FrankaPushEnv", "piec_envs.franka_env:FrankaPushVectorEnv"),
    "piec_envs/MobileFrankaPush-v0": Entry(
        "piec_envs.franka_env:MobileFrankaPushEnv", "piec_envs.franka_env:MobileFrankaPushVectorEnv"
    ),
    "piec_envs/MobileFrankaTrack-v0": Entry(
        "piec_envs.franka_env:MobileFrankaTrackEnv", "piec_envs.franka_env:MobileFrankaTrackVectorEnv"
    ),
}
MOTIONS = tuple(env_id for env_id, entry in ENVS.items() if entry.motion)  # what plans are made for


class NoMotionError(UnknownNameError):
    """The id of an environment of static caging where one of motion is needed.

    Args:
        env_id: the id given.
    """

    def __init__(self, env_id: str):
        self._given = (env_id,)
        PiecError.__init__(
            self,
            f"{env_id!r} is static caging: an episode is one posture, so that there is no motion to plan, to train "
            f"or to execute. Environments of motion: {', '.join(MOTIONS)}. Postures are searched for by "
            "planners.CmaEsConfiguration, SqpConfiguration and ExhaustiveConfiguration",
        )


def check_motion(env_id: Any) -> None:
    """Refuse what is not the id of an environment of motion.

    Args:
        env_id: the id given; anything.

    Raises:
        InvalidParameterError: for an environment object instead of an id.
        UnknownNameError: for an unknown id, or one of static caging.
    """
    if isinstance(env_id, gym.Env | gym.vector.VectorEnv):
        made = env_id.spec
        own = f"; pass {made.id!r} and its keyword arguments" if made is not None else ""
        raise InvalidParameterError(
            f"an environment is named by its id, such as {MOTIONS[0]!r}, but an environment object was given: "
            f"{type(env_id.unwrapped).__name__}{own}"
        )
    if isinstance(env_id, str) and env_id in ENVS and env_id not in MOTIONS:
        raise NoMotionError(env_id)
    check_name("environment", env_id, MOTIONS)


def register_envs() -> None:
    """Register every row of the table; rows that are registered already stay as they are.

    Gymnasium's own limit on the steps is not set: what an environment truncates at, its horizon over `action_repeat`,
    only the environment knows, and writes it into its spec.
    """
    for env_id, entry in ENVS.items():
        if env_id not in gym.registry:
            gym.register(env_id, entry.entry_point, vector_entry_point=entry.vector_entry_point)

"""What makes the environments, the models and the episodes of each id, by the names that Gymnasium
is told.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any

import numpy as np

from piec_envs.env.cage import CageConfig, CageEpisodes
from piec_envs.env.config import EnvConfig
from piec_envs.env.episodes import Episodes, MotionEpisodes
from piec_envs.env.registry import ENVS, Entry, check_motion
from piec_envs.env.single import Env
from piec_envs.env.vector import VectorEnv
from piec_envs.errors import check_arguments, check_name
from piec_envs.model.model import Model
from piec_envs.model.setup import Setup
from piec_envs.world.robots.franka import franka_name

OWN_ARGUMENTS = ("dtype", "render_mode", "renderer")  # keyword arguments of every environment
DTYPES = ("float64", "float32")
RENDER_MODES = (None, "rgb_array")


def configure(entry: Entry, options: Mapping[str, Any]) -> EnvConfig | CageConfig:
    """Validate keyword arguments.

    Args:
        entry: row of the table of environments.
        options: its keyword arguments but OWN_ARGUMENTS.

    Returns:
        All of them, those not given at their defaults.

    Raises:
        UnknownArgumentError: for a keyword that does not exist.
        UnknownNameError: for an unknown name.
        InvalidParameterError: for a value outside its range.
    """
    config: type[EnvConfig | CageConfig] = EnvConfig if entry.motion else CageConfig
    check_arguments(options, [*entry.choices, *config.field_names(), *OWN_ARGUMENTS])
    rest = {name: value for name, value in options.items() if name not in entry.choices}
    chosen = {name: options.get(name, default) for name, default in entry.choices.items()}
    robot = entry.robot
    if entry.base:
        robot = franka_name(entry.base, chosen.get("contact", "whole_arm"), chosen["geometry"])
    if not entry.motion:
        return CageConfig(robot, **{"object": entry.object, **rest})
    task = entry.tasks[0]
    if "reference" in chosen:
        check_name("reference", chosen["reference"], [row.side for row in entry.tasks])
        task = next(row for row in entry.tasks if row.side == chosen["reference"])
    return EnvConfig(task=task.name, robot=robot, **rest)


def make_episodes(
    entry: Entry, options: Mapping[str, Any], rows: int, dtype: str, render_mode: str | None
) -> Episodes:
    """Episodes of an environment.

    Args:
        entry: row of the table of environments.
        options: its keyword arguments but OWN_ARGUMENTS.
        rows: how many.
        dtype: of the observations, "float64" or "float32".
        render_mode: None or "rgb_array".

    Returns:
        The episodes, of which none has begun.

    Raises:
        UnknownArgumentError, UnknownNameError, InvalidParameterError: as `configure`.
    """
    config = configure(entry, options)
    check_name("dtype", dtype, DTYPES)
    check_name("render_mode", render_mode, RENDER_MODES)
    if isinstance(config, CageConfig):
        return CageEpisodes(config, rows, np.dtype(dtype))
    return MotionEpisodes(config, rows, np.dtype(dtype))


def make_config(env_id: str, **options: Any) -> EnvConfig:
    """The keyword arguments of an environment of motion, those not given at their defaults.

    Args:
        env_id: its id.
        options: its keyword arguments.

    Returns:
        All of them.

    Raises:
        UnknownArgumentError, UnknownNameError, InvalidParameterError: as `configure`; also for an
            id of static caging.
    """
    check_motion(env_id)
    config = configure(ENVS[env_id], options)
    assert isinstance(config, EnvConfig)
    return config


def make_setup(env_id: str, **options: Any) -> Setup:
    """What the model of an environment of motion is made of.

    Args:
        env_id: its id.
        options: its keyword arguments.

    Returns:
        Names and numbers; nothing has been built.

    Raises:
        UnknownArgumentError, UnknownNameError, InvalidParameterError: as `configure`; also for an
            id of static caging.
    """
    return make_config(env_id, **options).resolve()


def make_model(env_id: str, **options: Any) -> Model:
    """The model of an environment of motion, without the environment.

    Args:
        env_id: its id.
        options: its keyword arguments.

    Returns:
        What simulates its episodes.

    Raises:
        UnknownArgumentError, UnknownNameError, InvalidParameterError: as `make_setup` and `Model`.
    """
    return Model(make_setup(env_id, **options))


def _maker(kind: Any, entry: Entry) -> Any:
    """What makes one kind of environment of an id; Gymnasium looks for the metadata there."""
    made = partial(kind, partial(make_episodes, entry), entry.render_fps)
    made.metadata = kind.metadata  # type: ignore[attr-defined]
    return made


def __getattr__(name: str) -> Any:
    """What an entry point names: the single environment of an id, or its VectorEnv."""
    for entry in ENVS.values():
        if name == entry.name:
            return _maker(Env, entry)
        if name == f"{entry.name}Vector":
            return _maker(VectorEnv, entry)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

"""The table of learning algorithms, and whether what they need is installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec
from typing import Any, NamedTuple

from piec_envs import MissingDependencyError, check_name

PACKAGES = ("torch", "stable_baselines3", "sb3_contrib", "tensorboard", "yaml")


class Algorithm(NamedTuple):
    """One row of the table of algorithms.

    Args:
        module: where its class is.
        name: of its class.
        description: one line for people.
    """

    module: str
    name: str
    description: str


ALGORITHMS = {
    "ppo": Algorithm("stable_baselines3", "PPO", "proximal policy optimisation, on-policy"),
    "sac": Algorithm("stable_baselines3", "SAC", "soft actor-critic, off-policy"),
    "tqc": Algorithm("sb3_contrib", "TQC", "truncated quantile critics, off-policy"),
}


def check_installed() -> None:
    """Refuse to go on without the packages of the extra `rl`.

    Raises:
        MissingDependencyError: naming the first that is missing.
    """
    for package in PACKAGES:
        if find_spec(package) is None:
            raise MissingDependencyError(package, "rl")


def get_algorithm(name: str) -> Any:
    """The class of the algorithm of that name.

    Raises:
        UnknownNameError: if the table has no such row.
        MissingDependencyError: if a package is missing.
    """
    check_name("algorithm", name, ALGORITHMS)
    check_installed()
    return getattr(import_module(ALGORITHMS[name].module), ALGORITHMS[name].name)

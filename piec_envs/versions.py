"""Versions that plans and records carry."""

from __future__ import annotations

import platform
from importlib import metadata

PACKAGES = ("piec-envs", "numpy", "numba", "scipy", "gymnasium", "cma", "mujoco")


def versions() -> dict[str, str]:
    """Versions of everything that a result depends on; nothing is imported for it."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found

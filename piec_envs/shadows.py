"""Noticing that a user's own file hides a package of this suite."""

from __future__ import annotations

import sys
import warnings
from importlib.util import find_spec
from pathlib import Path

from piec_envs.errors import ShadowedPackageError

# packages installed beside this one, with names that others use, too
BESIDE = ("planners", "evaluation")


def shadow_of(name: str) -> Path | None:
    """The file that Python takes for a package of this suite; None if it takes ours.

    Args:
        name: of the package.
    """
    ours = Path(__file__).resolve().parents[1] / name / "__init__.py"
    if not ours.is_file():
        return None
    running = sys.modules.get(name)
    found = getattr(running, "__file__", None)
    if running is None:
        try:
            spec = find_spec(name)
        except (ImportError, ValueError):
            return None
        found = spec.origin if spec is not None else None
    if found is None or Path(found).resolve() == ours:
        return None
    return Path(found).resolve()


def message_of(name: str, shadow: Path) -> str:
    """What to tell the user.

    Args:
        name: of the package.
        shadow: from `shadow_of`.

    Returns:
        The message.
    """
    return (
        f"{shadow} hides the package {name!r} of piec-envs, since its folder comes first in "
        f"sys.path: rename it, or "
        f"{name!r} cannot be used in this process"
    )


def check_not_shadowed(name: str) -> None:
    """Refuse to go on without a package that is hidden.

    Args:
        name: of the package.

    Raises:
        ShadowedPackageError: if Python takes another file for it.
    """
    shadow = shadow_of(name)
    if shadow is not None:
        raise ShadowedPackageError(message_of(name, shadow))


def warn_of_shadows() -> None:
    """Say which packages of this suite are hidden, if any: what is imported from them next may
    fail.
    """
    for name in BESIDE:
        shadow = shadow_of(name)
        if shadow is not None:
            warnings.warn(message_of(name, shadow), UserWarning, stacklevel=3)

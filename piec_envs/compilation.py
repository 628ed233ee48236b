"""A word to the user before kernels are compiled for the first time, which takes most of a minute.

Numba says when it begins to compile; what it finds in its cache on the disk is not compiled.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from numba.core import event

from piec_envs.console import note

PACKAGES = ("piec_envs", "planners", "evaluation")
LEAST = 2.0  # s that a kernel takes by itself; less is not worth a word
# What kernels take to compile, those that they call included, s on a core of a server of 2023.
SECONDS = {
    "piec_envs.dynamics.contact_rollout:rollout_rows": 30.0,
    "piec_envs.escape.inference:answer_rows": 11.0,
    "piec_envs.geometry.body:scene_distances": 4.0,
    "piec_envs.geometry.clearance:clearance_rows": 3.0,
    "piec_envs.dynamics.control_step:measure_motion_rows": 1.5,
    "piec_envs.dynamics.control_step:command_rows": 1.0,
    "piec_envs.model.kernels:observe_rows": 1.0,
    "piec_envs.model.kernels:measure_rows": 0.5,
}


class _Announcer(event.Listener):
    """Says once in a process that kernels are compiled, and about how long that takes."""

    def __init__(self) -> None:
        self.said = False

    def on_start(self, event: Any) -> None:
        """A compilation begins."""
        if self.said:
            return
        name = kernel_name(event.data["dispatcher"])
        if name.partition(":")[0].partition(".")[0] not in PACKAGES:
            return
        if SECONDS.get(name, 0.0) >= LEAST:
            self.said = True
            note(f"compiling kernels, once; up to about {estimate(name):.0f} s")

    def on_end(self, event: Any) -> None:
        """A compilation has ended."""


_ANNOUNCER = _Announcer()


def announce_compilation() -> None:
    """From now on, say so before kernels of this suite are compiled."""
    event.register("numba:compile", _ANNOUNCER)


def kernel_name(dispatcher: Any) -> str:
    """`module:function` of a compiled function."""
    function: Callable = dispatcher.py_func
    return f"{function.__module__}:{function.__name__}"


def estimate(begun: str) -> float:
    """Seconds to compile a kernel that is not in the cache, and all others that are loaded and not
    there, s.

    Args:
        begun: `module:function` of the kernel.
    """
    cold = {begun, *(name for name in SECONDS if not _kept(name))}
    return sum(SECONDS.get(name, 0.5) for name in cold)


def pending_kernels() -> dict[str, float]:
    """The slow kernels that are not in the cache on the disk: seconds to compile each, by
    `module:function`.
    """
    for name in SECONDS:
        import_module(name.partition(":")[0])
    return {name: seconds for name, seconds in SECONDS.items() if not _kept(name)}


def _kept(name: str) -> bool:
    """Whether a kernel is in the cache on the disk, or not even loaded."""
    module, _, function = name.partition(":")
    stats = getattr(getattr(sys.modules.get(module), function, None), "stats", None)
    if stats is None:
        return True
    folder = stats.cache_path
    return folder is not None and any(Path(folder).glob(f"*.{function}-*.nbi"))

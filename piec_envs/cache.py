"""Where the suite keeps files that it can make again."""

from __future__ import annotations

import os
import sys
from pathlib import Path


def cache_folder() -> Path | None:
    """`$PIEC_CACHE`, or a folder in the user's cache of the platform; it need not exist. None
    without a home.
    """
    if os.environ.get("PIEC_CACHE"):
        return Path(os.environ["PIEC_CACHE"])
    homes = {"win32": ("LOCALAPPDATA", "~/AppData/Local"), "darwin": ("", "~/Library/Caches")}
    variable, usual = homes.get(sys.platform, ("XDG_CACHE_HOME", "~/.cache"))
    try:
        return Path(os.environ.get(variable) or usual).expanduser() / "piec_envs"
    except RuntimeError:
        return None

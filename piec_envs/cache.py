"""Where this suite keeps what it computed once and can compute again."""

from __future__ import annotations

import os
from pathlib import Path


def cache_folder() -> Path:
    """`$PIEC_CACHE`, or `piec_envs` in the user's cache; it may not exist yet."""
    parent = os.environ.get("XDG_CACHE_HOME") or os.path.join("~", ".cache")
    return Path(os.path.expanduser(os.environ.get("PIEC_CACHE") or os.path.join(parent, "piec_envs")))

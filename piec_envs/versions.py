"""Versions that plans and records carry, and where the package came from."""

from __future__ import annotations

import json
import platform
from importlib import metadata
from pathlib import Path
from urllib.parse import urlsplit
from urllib.request import url2pathname

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


def install_command(extra: str) -> str:
    """The command that adds an extra to this very installation.

    A clone, or an editable installation of one, is its own source; what was installed from a
    folder, a file or a repository comes from there again; anything else comes from the package
    index.

    Args:
        extra: name of the extra, such as "rl".
    """
    clone = Path(__file__).resolve().parents[1]
    if (clone / "pyproject.toml").is_file():
        return f"pip install -e '{'.' if Path.cwd() == clone else clone}[{extra}]'"
    return f'pip install "{_requirement(_origin(), extra)}"'


def _origin() -> dict:
    """What pip wrote down of where the package came from (PEP 610); nothing for the package
    index.
    """
    try:
        text = metadata.distribution("piec-envs").read_text("direct_url.json")
        return dict(json.loads(text or "{}"))
    except (metadata.PackageNotFoundError, OSError, ValueError):
        return {}


def _requirement(origin: dict, extra: str) -> str:
    """A requirement of pip for the package from that origin, with an extra."""
    url = str(origin.get("url", ""))
    if "vcs_info" in origin:
        vcs = origin["vcs_info"]
        return f"piec-envs[{extra}] @ {vcs['vcs']}+{url}@{vcs['commit_id']}"
    if not url:
        return f"piec-envs[{extra}]"
    if "dir_info" not in origin:
        return f"piec-envs[{extra}] @ {url}"
    return f"{url2pathname(urlsplit(url).path)}[{extra}]"

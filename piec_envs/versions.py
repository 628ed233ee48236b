"""Versions and sources that plans and records carry, and where the package came from."""

from __future__ import annotations

import hashlib
import json
import os
import platform
import subprocess
from functools import cache
from importlib import metadata
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from urllib.request import url2pathname

PACKAGES = ("piec-envs", "numpy", "numba", "scipy", "gymnasium", "cma", "mujoco")
SOURCES = ("piec_envs", "planners", "evaluation")  # what a result depends on beside those
SUFFIXES = (".py", ".yml", ".json", ".npz")  # code, hyper-parameters, starts and shipped weights


def versions() -> dict[str, str]:
    """Versions of everything that a result depends on; nothing is imported for it."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            found[name] = "not installed"
    return found


@cache
def source() -> dict[str, Any]:
    """The sources of this process, read once.

    Returns:
        "commit", the git commit where the packages lie in a work tree that tracks them, else None;
        "modified", whether the packages there differ from that commit, None without one; and "digest",
        16 hexadecimal digits of the SHA-256 of the packages' files.
    """
    root = Path(__file__).resolve().parents[1]
    return {**git_state(root), "digest": source_digest(root)}


def source_digest(root: Path) -> str:
    """SHA-256 of the packages' files under a folder, their names included; line ends do not count."""
    digest = hashlib.sha256()
    files = [path for name in SOURCES for path in (root / name).rglob("*") if path.suffix in SUFFIXES]
    for path in sorted(files, key=lambda path: path.relative_to(root).as_posix()):
        content = path.read_bytes()
        if path.suffix != ".npz":
            content = content.replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(root).as_posix()}\n{len(content)}\n".encode() + content)
    return digest.hexdigest()[:16]


def git_state(root: Path) -> dict[str, Any]:
    """The commit of the packages under a folder, and whether they differ from it.

    Args:
        root: of the packages; another project's work tree around an installed package does not count.
    """
    known = _git(root, "ls-files", "--error-unmatch", f"{SOURCES[0]}/__init__.py") is not None
    commit = _git(root, "rev-parse", "HEAD") if known else None
    if not commit:
        return {"commit": None, "modified": None}
    changes = _git(root, "status", "--porcelain", "--untracked-files=all", "--", *SOURCES)
    return {"commit": commit, "modified": changes != ""}


def _git(root: Path, *arguments: str) -> str | None:
    """What git answers, None if it cannot."""
    plain = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}  # as in a hook
    plain["GIT_OPTIONAL_LOCKS"] = "0"
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments], capture_output=True, text=True, check=True, env=plain, timeout=20
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()


def install_command(extra: str) -> str:
    """The command that adds an extra to this very installation.

    A clone, or an editable installation of one, is its own source; what was installed from a folder, a file
    or a repository comes from there again; anything else comes from the package index.

    Args:
        extra: name of the extra, such as "rl".
    """
    clone = Path(__file__).resolve().parents[1]
    if (clone / "pyproject.toml").is_file():
        return f"pip install -e '{'.' if Path.cwd() == clone else clone}[{extra}]'"
    return f'pip install "{_requirement(_origin(), extra)}"'


def _origin() -> dict:
    """What pip wrote down of where the package came from (PEP 610); nothing for the package index."""
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

"""The sources that records carry: commit, whether they were edited since, and a digest."""

from __future__ import annotations

import hashlib
import os
import subprocess
from functools import cache
from pathlib import Path
from typing import Any

SOURCES = ("piec_envs", "planners", "evaluation")  # what a result depends on beside those
# code, hyper-parameters, starts and shipped weights
SUFFIXES = (".py", ".pyi", ".yml", ".json", ".npz")


@cache
def source() -> dict[str, Any]:
    """The sources of this process, read once.

    Returns:
        "commit", the git commit where the packages lie in a work tree that tracks them, else None;
        "modified", whether the packages there differ from that commit, None without one; and
        "digest", 16 hexadecimal digits of the SHA-256 of the packages' files.
    """
    root = Path(__file__).resolve().parents[1]
    return {**git_state(root), "digest": source_digest(root)}


def source_digest(root: Path) -> str:
    """SHA-256 of the packages' files under a folder, their names included; line ends do not
    count.
    """
    digest = hashlib.sha256()
    files = [
        path for name in SOURCES for path in (root / name).rglob("*") if path.suffix in SUFFIXES
    ]
    for path in sorted(files, key=lambda path: path.relative_to(root).as_posix()):
        content = path.read_bytes()
        if path.suffix != ".npz":
            content = content.replace(b"\r\n", b"\n")
        digest.update(f"{path.relative_to(root).as_posix()}\n{len(content)}\n".encode() + content)
    return digest.hexdigest()[:16]


def git_state(root: Path) -> dict[str, Any]:
    """The commit of the packages under a folder, and whether they differ from it.

    Args:
        root: of the packages; another project's work tree around an installed package does not
            count.
    """
    known = git_answer(root, "ls-files", "--error-unmatch", f"{SOURCES[0]}/__init__.py") is not None
    commit = git_answer(root, "rev-parse", "HEAD") if known else None
    if not commit:
        return {"commit": None, "modified": None}
    changes = git_answer(root, "status", "--porcelain", "--untracked-files=all", "--", *SOURCES)
    return {"commit": commit, "modified": changes != ""}


def git_answer(root: Path, *arguments: str) -> str | None:
    """What git answers.

    Args:
        root: the folder that it is asked in.
        arguments: of the command.

    Returns:
        Its output without the space around it; None if git is missing, fails or takes over 20 s.
    """
    # as in a hook
    plain = {name: value for name, value in os.environ.items() if not name.startswith("GIT_")}
    plain["GIT_OPTIONAL_LOCKS"] = "0"
    try:
        done = subprocess.run(
            ["git", "-C", str(root), *arguments],
            capture_output=True,
            text=True,
            check=True,
            env=plain,
            timeout=20,
        )
    except (OSError, subprocess.SubprocessError):
        return None
    return done.stdout.strip()

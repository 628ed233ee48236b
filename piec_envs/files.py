"""Files that are written whole or not at all, and what reading a broken one can end with."""

from __future__ import annotations

import difflib
import os
import struct
import threading
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tokenize import TokenError
from typing import IO

__all__ = ["BROKEN_FILE", "replacing", "why_unreadable"]

BROKEN_FILE = (  # down to NumPy's parsing of a damaged header
    OSError,
    ValueError,
    LookupError,
    TypeError,
    EOFError,
    RuntimeError,
    MemoryError,
    SyntaxError,
    TokenError,
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
)


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A file that takes the place of `path` once it is written, and leaves no trace if that
    fails.
    """
    temporary = path.with_name(f".{path.name}.{os.getpid()}-{threading.get_ident()}.tmp")
    try:
        with open(temporary, "wb") as file:
            yield file
        os.replace(temporary, path)
    finally:
        temporary.unlink(missing_ok=True)


def why_unreadable(path: str | os.PathLike, kind: str, error: BaseException) -> str:
    """What to say of a file that could not be read: that it is not there, or that it is broken.

    Args:
        path: of the file.
        kind: what it was meant to be, such as "plan file".
        error: what reading it ended with.

    Returns:
        The message, which names the path.
    """
    if isinstance(error, FileNotFoundError | NotADirectoryError):
        missing = Path(error.filename or path) if Path(path).exists() else Path(path)
        beside = "" if missing == Path(path) else f", which belongs to {path},"
        return f"there is no file {missing}{beside}{_like_it(missing)}"
    if isinstance(error, IsADirectoryError):
        return f"{path} is a folder, and no {kind}"
    if isinstance(error, PermissionError):
        return f"{path} may not be read: {error.strerror}"
    return f"{path} is no {kind}, or is broken: {error}"


def _like_it(missing: Path) -> str:
    """The name of a file in the same folder that may have been meant."""
    folder = missing.parent
    if not folder.is_dir():
        return f" and no folder {folder}"
    names = sorted(entry.name for entry in folder.iterdir() if entry.suffix == missing.suffix)
    close = difflib.get_close_matches(missing.name, names, n=1)
    return f"; did you mean {folder / close[0]}?" if close else ""

"""Tables on disk, mapped into memory so that processes share them.

A file is one line of text, padded with spaces, and the numbers. The line names the format, the
digest of all that the table depends on, and a checksum of the numbers. What does not fit is made
again.
"""

from __future__ import annotations

import zlib
from collections.abc import Callable
from pathlib import Path
from weakref import WeakValueDictionary

import numpy as np

from piec_envs.cache import cache_folder
from piec_envs.files import replacing

HEADER = 128  # bytes before the numbers
_in_use: WeakValueDictionary[tuple[Path | None, str], np.ndarray] = WeakValueDictionary()


def kept_table(
    name: str, digest: str, shape: tuple[int, ...], make: Callable[[], np.ndarray]
) -> np.ndarray:
    """A table from the user's cache, made and put there if there is none that fits.

    Args:
        name: how its file begins.
        digest: of everything that the table depends on.
        shape: of the table.
        make: makes it, float32.

    Returns:
        A read-only array, the same one as long as this process uses it; in memory alone where the
        folder cannot be written.
    """
    folder = cache_folder()
    path = folder / "tables" / f"{name}-{digest[:16]}.table" if folder else None
    table = _in_use.get((path, digest))
    if table is None:
        table = _in_use[path, digest] = _from_file(path, digest, shape, make)
    return table


def _from_file(
    path: Path | None, digest: str, shape: tuple[int, ...], make: Callable[[], np.ndarray]
) -> np.ndarray:
    """The table of that file, or one that is made now and put there."""
    kept = _read(path, digest, shape) if path else None
    if kept is not None:
        return kept
    made = np.ascontiguousarray(make(), dtype=np.float32)
    made.flags.writeable = False
    if path and _write(path, digest, made):
        kept = _read(path, digest, shape)
    return made if kept is None else kept


def _header(digest: str, table: np.ndarray) -> bytes:
    return f"piec-table {digest} {zlib.crc32(table.data):08x}".encode().ljust(HEADER - 1) + b"\n"


def _read(path: Path, digest: str, shape: tuple[int, ...]) -> np.ndarray | None:
    """The table of that file, or None where there is none that fits."""
    try:
        with open(path, "rb") as file:
            header = file.read(HEADER)
        mapped = np.memmap(path, np.float32, "r", HEADER, shape)
        return np.asarray(mapped) if header == _header(digest, mapped) else None
    except (OSError, ValueError):
        return None


def _write(path: Path, digest: str, table: np.ndarray) -> bool:
    """Write a file under a temporary name first; returns whether that went well."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with replacing(path) as file:
            file.write(_header(digest, table))
            file.write(table.data)
    except OSError:
        return False
    return True

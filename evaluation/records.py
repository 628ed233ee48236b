"""Records of work done: append-only JSON lines, one for each piece of work, safe against kills.

A line is written with one call and forced to the disk before the next begins, so that a kill can
cut off the last line alone; the next run drops that line and does its work again. The lock of an
open file keeps a second run out, and the key of a record lets no piece of work in twice. Files of
several machines are merged by putting one behind the other: of records with one key the first
counts.
"""

from __future__ import annotations

import hashlib
import json
import math
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np

from piec_envs import RecordError, files, provenance

try:
    import fcntl
except ImportError:  # not a POSIX system: a second run is not kept out there
    fcntl = None  # type: ignore[assignment]

FORMAT = "piec-record-1"
_FIRST = f'{{"format":"{FORMAT}",'.encode()  # every line begins so
_FIELDS = ("format", "key", "spec", "seed", "result", "seconds", "versions")
_LATER = ("source",)  # records from before it stay readable


def to_json(value: Any) -> Any:
    """The value in what JSON has; NaN and the infinities become {"number": "nan"} and the like.

    Args:
        value: made of dicts, sequences, NumPy arrays and scalars, paths, text, numbers and None.

    Returns:
        A value that `json.dumps(..., allow_nan=False)` takes and `from_json` turns back.

    Raises:
        RecordError: for anything else.
    """
    if isinstance(value, Mapping):
        return {str(key): to_json(item) for key, item in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return to_json(value.tolist())
    if isinstance(value, list | tuple):
        return [to_json(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return {"number": str(value)}
    if value is None or isinstance(value, bool | int | float | str):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    raise RecordError(f"a record holds JSON values alone, got {type(value).__name__}: {value!r}")


def from_json(value: Any) -> Any:
    """Undo `to_json`, as far as JSON tells."""
    if isinstance(value, dict):
        if set(value) == {"number"} and value["number"] in ("nan", "inf", "-inf"):
            return float(value["number"])
        return {key: from_json(item) for key, item in value.items()}
    return [from_json(item) for item in value] if isinstance(value, list) else value


def canonical(value: Any) -> str:
    """One text for all equal values."""
    return json.dumps(to_json(value), sort_keys=True, separators=(",", ":"), allow_nan=False)


def work_key(spec: Mapping[str, Any], seed: int) -> str:
    """The key of a piece of work, the same on every machine.

    Args:
        spec: what the work is, JSON values.
        seed: its seed.

    Returns:
        16 hexadecimal digits.
    """
    return hashlib.sha256(canonical({"spec": spec, "seed": int(seed)}).encode()).hexdigest()[:16]


def make_record(
    spec: Mapping[str, Any],
    seed: int,
    result: Any,
    seconds: float,
    source: Mapping[str, Any] | None = None,
) -> dict[str, Any]:
    """The record of a piece of work that is done.

    Args:
        spec: what the work is, JSON values.
        seed: its seed.
        result: what came out, JSON values and NumPy arrays.
        seconds: how long it took.
        source: the sources of the process that did it (`piec_envs.provenance.source`); None is this
            process.

    Returns:
        The record, JSON values alone.
    """
    return {
        "format": FORMAT,
        "key": work_key(spec, seed),
        "spec": to_json(spec),
        "seed": int(seed),
        "result": to_json(result),
        "seconds": round(float(seconds), 3),
        "versions": provenance.versions(),
        "source": dict(provenance.source() if source is None else source),
    }


def parse_records(path: Path, data: bytes) -> list[dict[str, Any]]:
    """Records in the contents of a file.

    Args:
        path: what errors call it.
        data: its contents.

    Returns:
        The records that are whole, each key once.

    Raises:
        RecordError: if it holds something else, or an edited record.
    """
    return _parse(path, data)[0]


def _parse(path: Path, data: bytes) -> tuple[list[dict[str, Any]], int]:
    """Records in a file's contents, each key once, and the length of the part that is whole."""
    end = data.rfind(b"\n") + 1
    tail = data[end:]
    if tail and not (tail.startswith(_FIRST) or _FIRST.startswith(tail)):
        raise RecordError(f"{path} holds no records: its last line is {tail[:40]!r}...")
    records: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(data[:end].splitlines(), start=1):
        try:
            record = _loads(line)
        except ValueError as error:
            raise RecordError(f"{path}, line {number}, is no JSON: {line[:40]!r}...") from error
        if (
            not isinstance(record, dict)
            or record.get("format") != FORMAT
            or any(n not in record for n in _FIELDS)
        ):
            raise RecordError(
                f"{path}, line {number}, is no record of format {FORMAT}: {line[:40]!r}..."
            )
        if record["key"] != work_key(record["spec"], record["seed"]):
            raise RecordError(
                f"{path}, line {number}: its key {record['key']!r} is not that of its spec and "
                f"seed, so one of "
                "them was edited"
            )
        records.setdefault(record["key"], from_json(record))
    return list(records.values()), end


def _loads(line: bytes) -> Any:
    """A line; if the file before had its last line cut off when they were merged, what comes behind
    that.
    """
    try:
        return json.loads(line)
    except ValueError:
        begin = line.rfind(_FIRST)
        if begin < 1:
            raise
        return json.loads(line[begin:])


def read_records(path: str | os.PathLike) -> list[dict[str, Any]]:
    """All records of a file, each key once, without a last line that was cut off; none if there is
    no file.

    Raises:
        RecordError: if the file is no record file.
    """
    try:
        return _parse(Path(path), Path(path).read_bytes())[0]
    except FileNotFoundError:
        return []
    except OSError as error:
        raise RecordError(f"{path} cannot be read: {error}") from error


def replace_records(path: Path, records: Sequence[Mapping[str, Any]]) -> None:
    """Write a record file anew with these records alone, whole or not at all.

    Args:
        path: of the file.
        records: all that it is to hold.

    Raises:
        RecordError: if another run writes the file.
    """
    with RecordFile(path), files.replacing(path) as file:
        file.writelines(_line(record) for record in records)


def _line(record: Mapping[str, Any]) -> bytes:
    names = [*_FIELDS, *(name for name in _LATER if name in record)]
    whole = {name: to_json(record[name]) for name in names}
    return json.dumps(whole, separators=(",", ":"), allow_nan=False).encode() + b"\n"


class RecordFile:
    """A record file open for appending; use it in a `with` statement.

    Args:
        path: of the file, made if missing; a last line that was cut off is removed.

    Raises:
        RecordError: if the file is no record file, or another run writes it.
    """

    def __init__(self, path: str | os.PathLike):
        self.path = Path(path)
        self.path.parent.mkdir(parents=True, exist_ok=True)
        try:
            self._file = open(self.path, "ab+")  # noqa: SIM115  closed by __exit__
        except OSError as error:
            raise RecordError(f"{path} cannot be written: {error}") from error
        try:
            self._lock()
            self._file.seek(0)
            records, end = _parse(self.path, self._file.read())
            self._file.truncate(end)
        except BaseException:
            self._file.close()
            raise
        self.records: dict[str, dict[str, Any]] = {record["key"]: record for record in records}

    def _lock(self) -> None:
        if fcntl is None:
            return
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise RecordError(f"{self.path} is being written by another run") from error

    def append(self, record: Mapping[str, Any]) -> None:
        """Add a record of `make_record` and force it to the disk.

        Raises:
            RecordError: if the file has a record with this key already.
        """
        if record["key"] in self.records:
            raise RecordError(f"{self.path} has a record with key {record['key']} already")
        self._file.write(_line(record))
        self._file.flush()
        os.fsync(self._file.fileno())
        self.records[record["key"]] = from_json(dict(record))

    def __enter__(self) -> RecordFile:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._file.close()

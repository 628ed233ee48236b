"""What a run of a study takes from committed results, what it does itself, and what `--fresh`
clears away.

Committed results are those of the clone that the packages lie in, as git has them: what was edited
since does not count as committed. Nothing is written there unless the run's own folder is that very
folder.
"""

from __future__ import annotations

import shutil
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.records import parse_records, read_records
from piec_envs import files, provenance

Record = dict[str, Any]
RECORDS = "records.jsonl"


@dataclass
class Ledger:
    """Where the records of one run come from, by key.

    Args:
        committed: records that may be taken instead of doing the work.
        taken: those of them that were.
        earlier: records of work that was done in the run's own folder before.
        done: records of work that this run did.
        labels: what people call each piece of work.
    """

    committed: Mapping[str, Record] = field(default_factory=dict)
    taken: dict[str, Record] = field(default_factory=dict)
    earlier: dict[str, Record] = field(default_factory=dict)
    done: dict[str, Record] = field(default_factory=dict)
    labels: dict[str, str] = field(default_factory=dict)

    @property
    def own(self) -> dict[str, Record]:
        """Records of work done in the run's own folder, now or earlier."""
        return {**self.earlier, **self.done}

    def note(self, key: str, label: str, kind: str, record: Record) -> None:
        """Note where a record comes from; the first word about a piece of work counts.

        Args:
            key: of the record.
            label: of the work.
            kind: "taken", "earlier" or "done".
            record: the record.
        """
        if key not in self.labels:
            self.labels[key] = label
            getattr(self, kind)[key] = record


_LEDGER: ContextVar[Ledger | None] = ContextVar("ledger", default=None)


def current_ledger() -> Ledger:
    """The ledger of the `with keeping(...)` around, or one that is thrown away."""
    return _LEDGER.get() or Ledger()


@contextmanager
def keeping(ledger: Ledger) -> Iterator[Ledger]:
    """Let every `run_recorded` inside take from this ledger and write into it."""
    token = _LEDGER.set(ledger)
    try:
        yield ledger
    finally:
        _LEDGER.reset(token)


def committed_folder() -> Path | None:
    """The folder `results` of the clone that this package lies in; None for an installed
    package.
    """
    folder = Path(__file__).resolve().parents[1] / "results"
    return folder if folder.is_dir() else None


def committed_records(folder: Path) -> tuple[dict[str, Record], str]:
    """The records of a study as they are committed.

    Args:
        folder: of the study, inside the committed results.

    Returns:
        The records by key, and what must be said about them: that the file was edited since; else
        "".
    """
    path = folder / RECORDS
    text = provenance.git_answer(folder, "show", f"HEAD:./{RECORDS}") if folder.is_dir() else None
    if text is None:  # an unpacked archive, or results never committed
        return {record["key"]: record for record in read_records(path)}, ""
    records = parse_records(path, f"{text}\n".encode())
    edited = provenance.git_answer(folder, "status", "--porcelain", "--", RECORDS)
    said = f"{path} was edited since it was committed; what is committed counts" if edited else ""
    return {record["key"]: record for record in records}, said


def bring_files(committed: Path, out: Path, study: str) -> None:
    """Copy plans, trained agents and trained fields that a study needs, where its folder lacks
    them.

    Args:
        committed: folder of the committed studies.
        out: folder of the run's studies.
        study: name of the study.
    """
    plans = list((committed / study / "plans").glob("*.npz")) or list(
        committed.glob("*/plans/*.npz")
    )
    for source in plans:
        _copy(source, out / "plans" / source.name)
    for source in (committed / study / "fields").glob("*"):
        _copy(source, out / study / "fields" / source.name)
    for record in read_records(committed / study / RECORDS):
        if record["spec"].get("work") == "train":
            folder = committed / "agents" / record["result"]["folder"]
            for source in folder.glob("*"):
                if source.is_file():
                    _copy(source, out / "agents" / folder.name / source.name)


def _copy(source: Path, target: Path) -> None:
    if target.exists():
        return
    target.parent.mkdir(parents=True, exist_ok=True)
    with open(source, "rb") as data, files.replacing(target) as file:
        shutil.copyfileobj(data, file)


def origins(records: Iterable[Record]) -> str:
    """Which commits records come from, such as "commit 0123456789 (30), sources not noted then
    (7)".
    """
    counts = Counter(commit_of(record) for record in records)
    if len(counts) == 1:
        return next(iter(counts))
    return ", ".join(f"{name} ({count})" for name, count in counts.most_common())


def commit_of(record: Record) -> str:
    """The commit that a record was made by, in words."""
    source = record.get("source")
    if source is None:
        return "sources not noted then"
    if source["commit"] is None:
        return f"sources {source['digest']}"
    edited = f" with changes, sources {source['digest']}" if source["modified"] else ""
    return f"commit {source['commit'][:10]}{edited}"

"""What `--fresh` clears away: whatever was not made by the very sources that run now.

So a fresh run that was stopped goes on where it was, and nothing that an older version has left is
taken. With `--fresh-evaluations` plans, agents and trained fields stay, whoever has made them.
"""

from __future__ import annotations

import json
import shutil
from collections.abc import Sequence
from pathlib import Path

from evaluation.records import read_records, replace_records
from evaluation.reuse import RECORDS, Record
from piec_envs import RecordError, provenance

MAKING = ("plan", "train")  # work that makes what other work evaluates


def clear(out: Path, study: str, evaluations_only: bool = False) -> int:
    """Remove the records of a study, and its plans, agents and fields, that other sources have
    made.

    Args:
        out: folder of all studies.
        study: name of the study.
        evaluations_only: whether plans, agents and fields, and their records, stay.

    Returns:
        How many records were removed.
    """
    path = out / study / RECORDS
    records = read_records(path)
    stays = MAKING if evaluations_only else ()
    kept = [
        record for record in records if _is_current(record) or record["spec"].get("work") in stays
    ]
    if len(kept) < len(records):
        replace_records(path, kept)
    _clear_caches(out, ("rollouts",) if evaluations_only else ("plans", "rollouts"))
    if not evaluations_only:
        _clear_trained(out, study, records)
    return len(records) - len(kept)


def _clear_trained(out: Path, study: str, records: Sequence[Record]) -> None:
    for record in records:
        if record["spec"].get("work") == "train":
            _clear_agent(out / "agents" / record["result"]["folder"])
    for sidecar in (out / study / "fields").glob("*.json"):
        if not _made_now(sidecar):
            sidecar.with_suffix(".npz").unlink(missing_ok=True)
            sidecar.unlink()


def _is_current(record: Record) -> bool:
    made_by = record.get("source")
    return made_by is not None and made_by["digest"] == provenance.source()["digest"]


def _clear_caches(out: Path, names: Sequence[str]) -> None:
    """Plans or rollouts that studies share, unless a record made by these sources vouches
    for them.
    """
    vouched = set()
    for path in out.glob(f"*/{RECORDS}"):
        for record in filter(_is_current, read_records(path)):
            vouched |= {f"{record['key']}.npz", record["result"].get("file")}
    for folder in names:
        for file in (out / folder).glob("*.npz"):
            if file.name not in vouched:
                file.unlink(missing_ok=True)


def _clear_agent(folder: Path) -> None:
    """A training that has ended; one that was stopped goes on."""
    sidecar = folder / "agent.json"
    if sidecar.exists() and not _made_now(sidecar):
        shutil.rmtree(folder)


def _made_now(sidecar: Path) -> bool:
    """Whether the description beside a trained file names these sources."""
    try:
        about = json.loads(sidecar.read_text(encoding="utf-8"))
    except ValueError:
        return False
    except OSError as error:
        raise RecordError(f"{sidecar} cannot be read: {error}") from error
    return ((about.get("source") or {}).get("digest")) == provenance.source()["digest"]

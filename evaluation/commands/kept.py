"""What an interrupted command leaves behind, read from the disk, and how to go on."""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any

from evaluation.commands.outputs import RECORDS, field_out, train_out
from piec_envs import PiecError

NOTHING = "nothing is kept"
GO_ON = "the same command goes on from there"


def kept_by(args: argparse.Namespace) -> str:
    """What of the work of an interrupted command is on the disk, in one sentence without a full
    stop.

    Args:
        args: of the command line.
    """
    try:
        return KEPT.get(args.command, lambda args: NOTHING)(args)
    except (PiecError, OSError) as error:
        return f"what is kept cannot be read: {error}"


def _records(paths: Iterable[Path], folder: Path) -> str:
    """How many pieces of work are recorded."""
    from evaluation.records import read_records

    counts: Counter[str] = Counter()
    for path in paths:
        counts.update(
            _NAMES.get(record["spec"].get("work"), "pieces of work")
            for record in read_records(path)
        )
    if not counts:
        return NOTHING
    listed = ", ".join(
        f"{count} {name if count > 1 else name.replace('s', '', 1)}"
        for name, count in counts.items()
    )
    return f"{listed} recorded in {folder}; {GO_ON}, and only what was being done is lost"


_NAMES = {
    "plan": "plans",
    "train": "trainings",
    "evaluate": "evaluations",
    "evaluate-file": "evaluations",
}


def _reproduce(args: argparse.Namespace) -> str:
    from evaluation.studies import STUDIES

    names = STUDIES if args.study == "all" else [args.study]
    return _records([args.out / name / RECORDS for name in names], args.out)


def _train(args: argparse.Namespace) -> str:
    folder = train_out(args)
    if (folder / "agent.json").exists():
        return f"the training in {folder} has ended, and its agent is kept"
    if any(folder.glob("checkpoint*")):
        return f"the last checkpoint in {folder} is kept; {GO_ON}"
    return NOTHING


def _train_field(args: argparse.Namespace) -> str:
    checkpoint = field_out(args).with_suffix(".checkpoint.npz")
    if checkpoint.exists():
        return f"the last checkpoint, {checkpoint}, is kept; {GO_ON}"
    return NOTHING


KEPT: Mapping[str, Callable[[Any], str]] = {
    "demo": lambda args: _records([args.out / RECORDS], args.out),
    "evaluate": lambda args: _records([args.out / RECORDS], args.out),
    "reproduce": _reproduce,
    "train": _train,
    "train-field": _train_field,
}

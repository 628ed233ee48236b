"""Checks of what a command is going to write, made before its work: that it can be written, and is
ours to replace.
"""

from __future__ import annotations

import argparse
import contextlib
import json
import tempfile
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from piec_envs import InvalidParameterError, PiecError

RECORDS = "records.jsonl"
TABLES = ("table.md", "table.csv")
PLANNER = "cma-es"  # where none is asked for
PLAN = "runs/plans/{objective}-seed{seed}.npz"
TRAIN = "runs/train/{env}-{algo}-seed{seed}"
# how such files begin
HEADS = {".gif": (0, b"GIF8"), ".png": (0, b"\x89PNG"), ".mp4": (4, b"ftyp")}


def check_outputs(args: argparse.Namespace) -> None:
    """Refuse an `--out` that cannot be written, or under which something lies that the command has
    not written.

    Args:
        args: of the command line; commands that write nothing pass.

    Raises:
        InvalidParameterError: saying what lies in the way.
    """
    check = CHECKS.get(args.command)
    if check is not None:
        check(args)


def plan_out(args: argparse.Namespace) -> Path:
    """The file that `piec plan` writes."""
    name = planner_asked(args.planner)[0]
    objective = args.objective or ("caging" if name == PLANNER else name)
    return args.out or Path(PLAN.format(objective=objective, seed=args.seed))


def planner_asked(words: Sequence[str] | None) -> tuple[str, list[str]]:
    """What `piec plan --planner` asks for.

    Args:
        words: a planner's name, which may be left out, and its settings as `name=value`.

    Returns:
        The name, and the settings.
    """
    given = list(words or [])
    return (given[0], given[1:]) if given and "=" not in given[0] else (PLANNER, given)


def bench_out(args: argparse.Namespace) -> Path:
    """The file that `piec bench` writes."""
    return args.out or Path("runs/bench.json" if args.soak is None else "runs/soak.json")


def train_out(args: argparse.Namespace) -> Path:
    """The folder that `piec train` writes into."""
    return args.out or Path(
        TRAIN.format(env=args.env.rpartition("/")[2], algo=args.algo, seed=args.seed)
    )


def field_out(args: argparse.Namespace) -> Path:
    """The file that `piec train-field` writes."""
    return args.out / f"{args.robot}-{args.recipe}.npz"


def render_out(args: argparse.Namespace) -> Path:
    """The file that `piec render` writes."""
    return args.out or (args.plan.with_suffix(".gif") if args.plan else Path("runs/state.png"))


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be made or written into; whatever is made to find out is removed
    again.

    Raises:
        InvalidParameterError: saying why.
    """
    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise InvalidParameterError(
            f"--out: nothing can be written into the folder {folder}: {error}"
        ) from error
    finally:
        for path in made:  # the deepest first; one that another process has filled meanwhile stays
            with contextlib.suppress(OSError):
                path.rmdir()


def check_file(path: Path, kind: str, is_ours: Callable[[Path], bool]) -> None:
    """Refuse a file that cannot be written, or whose place is taken by something else.

    Args:
        path: of the file.
        kind: what the command writes, such as "plan".
        is_ours: whether an existing file is such a one; it may raise what reading a foreign file
            raises.

    Raises:
        InvalidParameterError: saying why.
    """
    if path.is_dir():
        raise InvalidParameterError(f"--out: {path} is a folder, and the {kind} is a file")
    check_folder(path.parent)
    if not path.exists() or path.stat().st_size == 0:
        return
    try:
        ours = is_ours(path)
    except (PiecError, OSError, ValueError, LookupError, TypeError):
        ours = False
    if not ours:
        raise InvalidParameterError(
            f"--out: {path} exists and is no {kind}; it is left alone: choose another name"
        )


def _plan(args: argparse.Namespace) -> None:
    check_file(plan_out(args), "plan", _is_plan)


def _is_plan(path: Path) -> bool:
    from planners import Plan

    return bool(Plan.load(path))


def _bench(args: argparse.Namespace) -> None:
    key, title = ("machine", "# Speed\n") if args.soak is None else ("summary", "# Soak\n")
    out = bench_out(args)
    check_file(out, "file of piec bench", partial(_has_rows_and, key))
    check_file(
        out.with_suffix(".md"),
        "table of piec bench",
        lambda path: path.read_text().startswith(title),
    )


def _has_rows_and(key: str, path: Path) -> bool:
    return {"rows", key} <= set(json.loads(path.read_text(encoding="utf-8")))


def _render(args: argparse.Namespace) -> None:
    out = render_out(args)
    begin, head = HEADS.get(out.suffix, (0, b""))
    kind = {".gif": "GIF", ".png": "PNG", ".mp4": "MP4"}.get(out.suffix, "picture")
    check_file(out, kind, lambda path: bool(head) and path.read_bytes()[begin:].startswith(head))


def _train_field(args: argparse.Namespace) -> None:
    check_file(field_out(args), "trained field", _is_field)


def _is_field(path: Path) -> bool:
    from piec_envs import FieldWeights

    return bool(FieldWeights.load(path))


def _study_folder(folder: Path, files: Iterable[str] = TABLES) -> None:
    """A folder with a record file: tables and figures in it are ours if the records are."""
    check_folder(folder)
    if not (folder / RECORDS).exists():
        for name in files:
            if (folder / name).exists():
                raise InvalidParameterError(
                    f"--out: {folder / name} exists, and no {RECORDS} beside it: it is not this "
                    f"command's, and is "
                    "left alone; choose another folder"
                )


def _reproduce(args: argparse.Namespace) -> None:
    from evaluation.studies import STUDIES

    for name in STUDIES if args.study == "all" else [args.study]:
        if name in STUDIES:  # the command itself refuses others
            _study_folder(args.out / name)


CHECKS: Mapping[str, Callable[[Any], None]] = {
    "plan": _plan,
    "evaluate": lambda args: _study_folder(args.out),
    "demo": lambda args: _study_folder(args.out, (*TABLES, "overview.png", "animation.gif")),
    "reproduce": _reproduce,
    "train": lambda args: check_folder(train_out(args)),
    "train-field": _train_field,
    "bench": _bench,
    "render": _render,
}

"""`piec reproduce`: run studies."""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.commands import Report, add_worker_arguments, open_workers

OUT = Path("runs/reproduce")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("study", help="name from `piec list`, or all")
    parser.add_argument(
        "--out", type=Path, default=OUT, help="folder of all studies (default: %(default)s)"
    )
    parser.add_argument(
        "--fresh",
        action="store_true",
        help="do all of it anew, with nothing that is committed or that other sources than the "
        "present have made",
    )
    parser.add_argument(
        "--fresh-evaluations",
        action="store_true",
        help="the same, but with plans, agents and fields as they are",
    )
    add_worker_arguments(parser)
    parser.add_argument(
        "--smoke", action="store_true", help="tiny budgets, to see whether everything runs"
    )


def run(args: argparse.Namespace) -> Report:
    """Run the study, or go on where it was stopped, and compare it with what is committed."""
    from evaluation.studies import STUDIES, get_study

    names = list(STUDIES) if args.study == "all" else [get_study(args.study).name]
    texts = []
    data = {}
    wrote = []
    with open_workers(args) as workers:
        for name in names:
            outcome = _run_study(name, args, workers)
            texts.append(outcome.text)
            data[name] = outcome.data
            wrote += outcome.wrote
    return Report("\n".join(texts), {"studies": data}, wrote)


@dataclass(frozen=True)
class _Outcome:
    text: str
    data: dict[str, Any]
    wrote: list[Path]


def _run_study(name: str, args: argparse.Namespace, workers: Any) -> _Outcome:
    """One study, with a word on what of it was done now."""
    from evaluation.fresh import clear
    from evaluation.reuse import Ledger, bring_files, committed_folder, committed_records, keeping
    from evaluation.studies import get_study

    committed = None if args.smoke else committed_folder()
    base, said = committed_records(committed / name) if committed else ({}, "")
    if said:
        print(f"piec: {said}", file=sys.stderr)
    if args.fresh or args.fresh_evaluations:
        removed = clear(args.out, name, evaluations_only=not args.fresh)
        if removed:
            print(
                f"piec: {removed} records of other sources removed from {args.out / name}",
                file=sys.stderr,
            )
    if committed and not args.fresh:
        bring_files(committed, args.out, name)
    own = committed is not None and args.out.resolve() == committed
    module = get_study(name).load()
    chosen = module.Settings.smoke() if args.smoke else module.Settings()
    with keeping(Ledger({} if own else _takeable(base, args))) as ledger:
        paths = module.run(chosen, args.out / name, workers, progress=True)
    tables = [path.read_text(encoding="utf-8") for path in paths if path.suffix == ".md"]
    text, data, compared = _account(name, ledger, base, (OUT if own else args.out) / name)
    data["files"] = [str(path) for path in paths]
    return _Outcome("\n".join([*tables, text]), data, [args.out / name, *compared])


def _takeable(base: dict[str, Any], args: argparse.Namespace) -> dict[str, Any]:
    """The committed records that this run may take."""
    from evaluation.fresh import MAKING

    if args.fresh:
        return {}
    if args.fresh_evaluations:
        return {key: record for key, record in base.items() if record["spec"].get("work") in MAKING}
    return base


def _account(
    name: str, ledger: Any, base: dict[str, Any], folder: Path
) -> tuple[str, dict[str, Any], list[Path]]:
    """Where the results come from, and how they compare with the committed ones."""
    from evaluation.comparison import compare, comparison_table, summary, write_comparison
    from evaluation.reuse import origins
    from piec_envs import provenance

    counts = {kind: len(getattr(ledger, kind)) for kind in ("taken", "earlier", "done")}
    total = sum(counts.values())
    lines = []
    head = (provenance.source()["commit"] or "")[:10]
    words = {
        "taken": f"from committed records{f' of commit {head}' if head else ''}",
        "earlier": "from records of an earlier run",
        "done": "done now",
    }
    for kind, where in words.items():
        if counts[kind]:
            made_by = origins(getattr(ledger, kind).values())
            lines.append(
                f"{name}: {counts[kind]} of {total} pieces of work {where} (made by {made_by})"
            )
    data: dict[str, Any] = {
        "pieces": total,
        "from_committed": counts["taken"],
        "from_earlier": counts["earlier"],
    }
    data["done"] = counts["done"]
    found = compare(base, ledger.own, ledger.labels)
    if not found:
        nothing = (
            "nothing of it is done here: --fresh does all of it anew"
            if counts["taken"] == total
            else ""
        )
        return "\n".join([*lines, *([nothing] if nothing else [])]) + "\n", data, []
    differ = sum(item.size > 0 for item in found)
    data["compared"] = {"values": len(found), "differ": differ}
    text = "\n".join([*lines, f"{name}: {summary(found)}", "", comparison_table(found)])
    return text, data, write_comparison(folder, found)

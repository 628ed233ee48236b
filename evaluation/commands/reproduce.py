"""`piec reproduce`: run studies."""

from __future__ import annotations

import argparse
from pathlib import Path

from evaluation.commands import Report, add_worker_arguments, open_workers


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("study", help="name from `piec list`, or all")
    parser.add_argument(
        "--out", type=Path, default=Path("results"), help="folder of all studies (default: %(default)s)"
    )
    add_worker_arguments(parser)
    parser.add_argument("--smoke", action="store_true", help="tiny budgets, to see whether everything runs")


def run(args: argparse.Namespace) -> Report:
    """Run the study, or go on where it was stopped."""
    from evaluation.studies import STUDIES, get_study

    names = list(STUDIES) if args.study == "all" else [get_study(args.study).name]
    texts, data, wrote = [], {}, []
    with open_workers(args) as workers:
        for name in names:
            module = get_study(name).load()
            chosen = module.Settings.smoke() if args.smoke else module.Settings()
            paths = module.run(chosen, args.out / name, workers, progress=True)
            texts += [path.read_text(encoding="utf-8") for path in paths if path.suffix == ".md"]
            data[name] = {"files": [str(path) for path in paths]}
            wrote.append(args.out / name)
    return Report("\n".join(texts), {"studies": data}, wrote)

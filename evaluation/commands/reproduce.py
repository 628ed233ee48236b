"""`piec reproduce`: run studies."""

from __future__ import annotations

import argparse
from pathlib import Path

from evaluation.commands import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("study", help="name from `piec list`, or all")
    parser.add_argument(
        "--out", type=Path, default=Path("results"), help="folder of all studies (default: %(default)s)"
    )
    parser.add_argument("--jobs", type=int, default=1, help="workers; one uses all cores too (default: %(default)s)")
    parser.add_argument("--smoke", action="store_true", help="tiny budgets, to see whether everything runs")


def run(args: argparse.Namespace) -> Report:
    """Run the study, or go on where it was stopped."""
    from evaluation.studies import STUDIES, get_study

    names = list(STUDIES) if args.study == "all" else [get_study(args.study).name]
    texts, data, wrote = [], {}, []
    for name in names:
        module = get_study(name).load()
        chosen = module.Settings.smoke() if args.smoke else module.Settings()
        paths = module.run(chosen, args.out / name, args.jobs, progress=True)
        texts += [path.read_text(encoding="utf-8") for path in paths if path.suffix == ".md"]
        data[name] = {"files": [str(path) for path in paths]}
        wrote.append(args.out / name)
    return Report("\n".join(texts), {"studies": data}, wrote)

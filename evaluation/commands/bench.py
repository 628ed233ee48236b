"""`piec bench`: measure speeds."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from evaluation.commands import Report


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--quick", action="store_true", help="small sizes and few repetitions, to see that it runs")
    parser.add_argument(
        "--out", type=Path, default=Path("results/bench.json"), help="file to write (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> Report:
    """Run every benchmark in turn and write one file."""
    from evaluation.bench import QUICK, Sizes, run_bench
    from evaluation.records import to_json
    from evaluation.tables import markdown, write_atomic

    results = run_bench(QUICK if args.quick else Sizes(), progress=True)
    path = write_atomic(args.out, json.dumps(to_json(results), indent=2, allow_nan=False) + "\n")
    return Report(markdown(results["rows"]), results, [path])

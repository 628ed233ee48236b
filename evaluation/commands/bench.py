"""`piec bench`: measure speeds, or soak: step for long and count what goes wrong."""

from __future__ import annotations

import argparse
import json
from pathlib import Path

from evaluation.commands import Report
from evaluation.commands.outputs import bench_out

SOAK_STEPS = 10_000_000


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--quick", action="store_true", help="small sizes and few repetitions, to see that it runs"
    )
    parser.add_argument(
        "--soak",
        nargs="?",
        type=int,
        const=SOAK_STEPS,
        metavar="STEPS",
        help="no speeds: random steps over all ids, dynamics and objects (default: ten million); "
        "goes on where an "
        "unfinished record ends",
    )
    parser.add_argument(
        "--out",
        type=Path,
        help="file to write, with a table beside it (default: runs/bench.json, runs/soak.json)",
    )


def run(args: argparse.Namespace) -> Report:
    """Run every benchmark in turn; write all figures as JSON, and a table beside them."""
    from evaluation.bench import QUICK, Sizes, run_bench
    from evaluation.records import to_json
    from evaluation.tables import markdown, write_atomic

    if args.soak is not None:
        return _soak(args.soak, bench_out(args))
    results = run_bench(QUICK if args.quick else Sizes(), progress=True)
    out = bench_out(args)
    table = markdown(results["rows"])
    missed = [row["benchmark"] for row in results["rows"] if row["met"] == "miss"]
    wanted = sum(bool(row["met"]) for row in results["rows"])
    verdict = f"{wanted - len(missed)} of {wanted} targets are met" + (
        f"; missed: {', '.join(missed)}" if missed else ""
    )
    machine = f"{results['machine']['cores']} cores, {results['machine']['architecture']}"
    paths = [
        write_atomic(out, json.dumps(to_json(results), indent=2, allow_nan=False) + "\n"),
        write_atomic(
            out.with_suffix(".md"), f"# Speed\n\n`piec bench` on {machine}; {verdict}.\n\n{table}\n"
        ),
    ]
    return Report(f"{table}\n{verdict}", {**results, "missed": missed}, paths)


def _soak(steps: int, out: Path) -> Report:
    """Run the soak, or what its record lacks."""
    from evaluation.bench.soak import run_soak
    from evaluation.tables import markdown
    from piec_envs import as_count

    record = run_soak(as_count("--soak", steps), out)
    table = markdown(
        [{"figure": name, "value": value} for name, value in record["summary"].items()]
    )
    return Report(table, {"summary": record["summary"]}, [out, out.with_suffix(".md")])

"""`piec evaluate`: execute plan and agent files under protocols."""

from __future__ import annotations

import argparse
import hashlib
import time
from pathlib import Path
from typing import Any

from evaluation.commands import Report
from evaluation.commands.sources import Source, add_plant_arguments, load_sources, plants_text


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "plans", nargs="+", type=Path, metavar="FILE", help="plans, and agents (.zip)"
    )
    parser.add_argument(
        "--protocol",
        nargs="+",
        default=["nominal"],
        help="names from `piec list` (default: nominal)",
    )
    parser.add_argument(
        "--episodes",
        type=int,
        default=100,
        help="rollouts under each protocol (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the first rollout (default: %(default)s)"
    )
    parser.add_argument("--env", help="id of the environment (default: the file's)")
    add_plant_arguments(parser)
    parser.add_argument(
        "--out",
        type=Path,
        default=Path("runs/evaluate"),
        help="folder for table and records (default: %(default)s)",
    )


def run(args: argparse.Namespace) -> Report:
    """Evaluate every file under every protocol; what is recorded already is not run again."""
    from evaluation.records import RecordFile
    from evaluation.tables import markdown, write_table

    sources = load_sources(args.plans)
    plants = [_plants(source, args) for source in sources]  # refuses before anything is run
    results = []
    rows = []
    with RecordFile(args.out / "records.jsonl") as file:
        for source, by_protocol in zip(sources, plants, strict=True):
            for protocol, plant in by_protocol.items():
                result = _evaluate(file, source, protocol, args)
                results.append(
                    {"plan": str(source.path), "protocol": protocol, "plant": plant, **result}
                )
                rows.append(_row(source, protocol, result))
    in_force = plants_text(sources, plants)
    paths = write_table(args.out, rows, "Evaluation", _NOTE, above=in_force)
    return Report(
        f"{in_force}\n{markdown(rows)}",
        {"evaluations": results},
        [*paths, args.out / "records.jsonl"],
    )


_NOTE = (
    "n counts distinct executions; the interval is Wilson's, at 95 %, within one plan or agent. "
    "Diverged executions, whose simulation became unstable, count as failed. "
    "d2g is the distance to the goal region at the end, mean ± standard deviation."
)


def _plants(source: Source, args: argparse.Namespace) -> dict[str, dict[str, Any]]:
    """The plant in force under each protocol."""
    from evaluation.plants import check_suits, chosen_id, plant_in_force
    from evaluation.protocols import get_protocol

    env_id = chosen_id(source.made, args.env)
    base = source.base_kwargs(args)
    for protocol in args.protocol:
        check_suits(get_protocol(protocol), env_id, base)
    return {
        name: plant_in_force(env_id, get_protocol(name).env_kwargs(base)) for name in args.protocol
    }


def _evaluate(file: Any, source: Source, protocol: str, args: argparse.Namespace) -> dict[str, Any]:
    from evaluation import evaluate, summarise
    from evaluation.records import make_record, work_key

    env_id = args.env or source.made.env_id
    base = source.base_kwargs(args)
    spec = {
        "work": "evaluate-file",
        "plan_sha256": hashlib.sha256(source.path.read_bytes()).hexdigest(),
        "env_id": env_id,
        "env_kwargs": base,
        "protocol": protocol,
        "episodes": args.episodes,
    }
    key = work_key(spec, args.seed)
    if key not in file.records:
        begin = time.perf_counter()
        policy = source.made.policy()
        found = evaluate(
            policy, env_id, protocol, args.episodes, args.seed, base, progress=True, plant="given"
        )
        file.append(make_record(spec, args.seed, summarise(found), time.perf_counter() - begin))
    return file.records[key]["result"]


def _row(source: Source, protocol: str, result: dict[str, Any]) -> dict[str, Any]:
    from evaluation.metrics import wilson_interval
    from evaluation.tables import Spread

    return {
        "plan": source.name,
        "protocol": protocol,
        "n": result["n"],
        "success": wilson_interval(result["successes"], result["n"]),
        "diverged": result.get("diverged", 0),  # not in records from before simulations could
        "d2g, m": Spread(result["d2g_mean"], result["d2g_std"]),
        "arm distance, m": result["mean_distance"],
        "caging": result["mean_caging"],
    }

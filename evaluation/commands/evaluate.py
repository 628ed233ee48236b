"""`piec evaluate`: execute plan and agent files under protocols."""

from __future__ import annotations

import argparse
import hashlib
import time
from pathlib import Path
from typing import Any

from evaluation.commands import Report, settings


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("plans", nargs="+", type=Path, metavar="FILE", help="plans, and agents (.zip)")
    parser.add_argument("--protocol", nargs="+", default=["nominal"], help="names from `piec list` (default: nominal)")
    parser.add_argument("--episodes", type=int, default=100, help="rollouts under each protocol (default: %(default)s)")
    parser.add_argument("--seed", type=int, default=0, help="of the first rollout (default: %(default)s)")
    parser.add_argument("--env", help="id of the environment (default: the file's)")
    parser.add_argument(
        "--set", nargs="+", metavar="NAME=VALUE", help="keyword arguments of the plant, such as friction=0.2"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("runs/evaluate"), help="folder for table and records (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> Report:
    """Evaluate every file under every protocol; what is recorded already is not run again."""
    from evaluation.protocols import get_protocol
    from evaluation.records import RecordFile
    from evaluation.tables import markdown, write_table

    for protocol in args.protocol:
        get_protocol(protocol)
    made = {path: _load(path) for path in args.plans}
    results, rows = [], []
    with RecordFile(args.out / "records.jsonl") as file:
        for path, loaded in made.items():
            for protocol in args.protocol:
                result = _evaluate(file, path, loaded, protocol, args)
                results.append({"plan": str(path), "protocol": protocol, **result})
                rows.append(_row(path, protocol, result))
    title = "Evaluation"
    paths = write_table(args.out, rows, title, _NOTE)
    return Report(markdown(rows), {"evaluations": results}, [*paths, args.out / "records.jsonl"])


_NOTE = (
    "n counts distinct executions; the interval is Wilson's, at 95 %, within one plan or agent. "
    "Diverged executions, whose simulation became unstable, count as failed. "
    "d2g is the distance to the goal region at the end, mean ± standard deviation."
)


def _load(path: Path) -> tuple[Any, Any]:
    """The plan or the agent in a file, and the policy that executes it."""
    if path.suffix == ".zip":
        from planners.sb3 import Agent, AgentPolicy

        agent = Agent.load(path)
        return agent, AgentPolicy(agent)
    from planners import OpenLoopPolicy, Plan

    plan = Plan.load(path)
    return plan, OpenLoopPolicy(plan)


def _evaluate(
    file: Any, path: Path, loaded: tuple[Any, Any], protocol: str, args: argparse.Namespace
) -> dict[str, Any]:
    from evaluation import evaluate, summarise
    from evaluation.records import make_record, work_key

    source, policy = loaded
    env_id, plant = args.env or source.env_id, {**source.robot_kwargs, **settings(args.set)}
    spec = {
        "work": "evaluate-file",
        "plan_sha256": hashlib.sha256(path.read_bytes()).hexdigest(),
        "env_id": env_id,
        "env_kwargs": plant,
        "protocol": protocol,
        "episodes": args.episodes,
    }
    key = work_key(spec, args.seed)
    if key not in file.records:
        begin = time.perf_counter()
        evaluation = evaluate(policy, env_id, protocol, args.episodes, args.seed, plant, progress=True)
        file.append(make_record(spec, args.seed, summarise(evaluation), time.perf_counter() - begin))
    return file.records[key]["result"]


def _row(path: Path, protocol: str, result: dict[str, Any]) -> dict[str, Any]:
    from evaluation.metrics import wilson_interval
    from evaluation.tables import Spread

    return {
        "plan": f"{path.parent.name}/{path.stem}" if path.suffix == ".zip" else path.stem,  # all agents are agent.zip
        "protocol": protocol,
        "n": result["n"],
        "success": wilson_interval(result["successes"], result["n"]),
        "diverged": result.get("diverged", 0),  # not in records from before simulations could
        "d2g, m": Spread(result["d2g_mean"], result["d2g_std"]),
        "arm distance, m": result["mean_distance"],
        "caging": result["mean_caging"],
    }

"""`piec train`: train an agent."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import Any

from evaluation.commands import Report, settings
from evaluation.commands.outputs import train_out
from piec_envs import as_count


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--algo", default="ppo", help="name from `piec list` (default: %(default)s)"
    )
    parser.add_argument(
        "--env",
        default="piec_envs/PlanarArmPush-v0",
        help="id of the environment (default: %(default)s)",
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of all randomness (default: %(default)s)"
    )
    parser.add_argument(
        "--steps", type=int, help="of the environment, an action being one (default: the file's)"
    )
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="NAME=VALUE",
        help="keyword arguments of the environment, such as action_repeat=5",
    )
    parser.add_argument(
        "--hyper",
        nargs="+",
        metavar="NAME=VALUE",
        help="hyper-parameters, such as n_envs=64 learning_rate=lin_1e-3",
    )
    parser.add_argument(
        "--threads",
        type=int,
        default=1,
        help="of torch; more rarely help networks this small (default: %(default)s)",
    )
    parser.add_argument(
        "--out", type=Path, help="folder of this run (default: runs/train/ENV-ALGO-seedSEED)"
    )


def run(args: argparse.Namespace) -> Report:
    """Train, or go on from the last checkpoint in the folder."""
    from planners.sb3 import check_installed, default_spec, train

    check_installed()
    import torch

    torch.set_num_threads(as_count("threads", args.threads))
    spec = default_spec(
        args.env, args.algo, args.seed, args.steps, settings(args.set), settings(args.hyper)
    )
    folder = train_out(args)
    agent = train(spec, folder, progress=True)
    last = agent.evaluation
    file = folder / "agent.zip"
    text = (
        f"{args.algo} on {args.env}: {agent.steps} steps in {agent.seconds:.0f} s; from "
        f"{spec.eval_episodes} drawn "
        f"starts {last['success_rate']:.0%} succeed, and the object ends {last['d2g']:.3f} m "
        f"from the goal region\n"
        f"execute it: piec evaluate {file} --protocol nominal-start"
    )
    data: dict[str, Any] = {
        "spec": spec.as_json(),
        "steps": agent.steps,
        "seconds": agent.seconds,
        "evaluation": last,
    }
    names = ("agent.zip", "best_model.zip", "evaluations.jsonl", "tensorboard")
    return Report(text, data, [folder / name for name in names])

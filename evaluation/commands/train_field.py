"""`piec train-field`: train an escape field."""

from __future__ import annotations

import argparse
import dataclasses
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from evaluation.commands import Report, fit_settings, settings
from evaluation.commands.outputs import field_out
from piec_envs import as_count


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--robot", default="planar_arm", help="name from `piec list` (default: %(default)s)"
    )
    parser.add_argument(
        "--recipe", default="network", help="name from `piec list` (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of all randomness (default: %(default)s)"
    )
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="NAME=VALUE",
        help="numbers of the recipe, such as iterations=2000 width=32",
    )
    parser.add_argument(
        "--device", default="cpu", help="where torch computes, such as cuda (default: %(default)s)"
    )
    parser.add_argument(
        "--threads", type=int, help="of torch, labels and look-aheads (default: all cores)"
    )
    parser.add_argument(
        "--out", type=Path, default=Path("runs/fields"), help="folder (default: %(default)s)"
    )


def run(args: argparse.Namespace) -> Report:
    """Train, or go on from the checkpoint beside the file to write."""
    from piec_envs import get_recipe, get_robot, train_field

    get_robot(args.robot)
    recipe = get_recipe(args.recipe)
    recipe = dataclasses.replace(recipe, **fit_settings("recipe", settings(args.set), recipe))
    file = field_out(args)
    if args.threads is not None:
        _use_threads(args.threads)
    weights = train_field(recipe, args.robot, args.seed, file, args.device, args.threads)
    seconds = weights.record["seconds"]
    last = weights.record["held_out"][-1]
    text = (
        f"{args.recipe} for {args.robot}: error on configurations it has not seen: median "
        f"{last['median']:.2%}, "
        f"mean {last['mean']:.2%}, after {seconds:.0f} s of training\n{_usage(args.robot, file)}"
    )
    data = {
        "robot": args.robot,
        "recipe": args.recipe,
        "settings": weights.recipe,
        "seed": args.seed,
    }
    return Report(
        text, {**data, "seconds": seconds, "held_out": last}, [file, file.with_suffix(".json")]
    )


def _use_threads(threads: int) -> None:
    threads = as_count("threads", threads)
    if find_spec("torch") is not None:
        import torch

        torch.set_num_threads(threads)


def _usage(robot: str, file: Path) -> str:
    """How to ask the field, and how to give it to an environment."""
    choice: dict[str, Any] = {"name": "network", "weights": str(file)}
    return (
        f'use it: make_field("network", "{robot}", weights="{file}"), or gym.make(..., '
        f"escape_field={choice})"
    )

"""The commands of `piec`, one file each, and what they share.

A command's module has `add_arguments(parser)` and `run(args) -> Report`. It imports what is slow to
import inside `run`, so that `piec --help` is quick.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass, field, fields
from importlib import import_module
from pathlib import Path
from typing import Any

from evaluation.engines import ENGINES, open_engine
from piec_envs import InvalidParameterError, check_name


class Interrupted(KeyboardInterrupt):
    """Ctrl-C in a command that knows best what it keeps, and says so."""


@dataclass(frozen=True)
class Report:
    """What a command has to say.

    Args:
        text: for people.
        data: for machines, JSON values.
        wrote: files and folders with the results.
    """

    text: str
    data: dict[str, Any]
    wrote: Sequence[Path] = field(default_factory=list)


@dataclass(frozen=True)
class Command:
    """One row of the table of commands.

    Args:
        name: what users type.
        help: one line.
        examples: lines that work as they stand.
        module: name of its file here.
    """

    name: str
    help: str
    examples: tuple[str, ...]
    module: str

    def load(self) -> Any:
        """The command's module."""
        return import_module(f"{__name__}.{self.module}")


COMMANDS = {
    row.name: row
    for row in (
        Command(
            "list",
            "list environments, objects, protocols, studies and more",
            ("piec list",),
            "listing",
        ),
        Command(
            "demo",
            "plan with three objectives, disturb the object, print a table, draw a picture and "
            "an animation",
            ("piec demo --quick", "piec demo --out runs/demo --seed 1"),
            "demo",
        ),
        Command(
            "plan",
            "plan a motion and write it to a file",
            (
                "piec plan --objective caging --out runs/caging.npz",
                "piec plan --quick --set object=square",
                "piec plan --objective contact --set object=square --planner iterations=20",
            ),
            "plan",
        ),
        Command(
            "evaluate",
            "execute plans and agents under protocols, many times each",
            (
                "piec evaluate runs/caging.npz --protocol disturbance-5mm adversary --episodes 100",
                "piec evaluate runs/caging.npz runs/train/quick/agent.zip --protocol nominal-start",
            ),
            "evaluate",
        ),
        Command(
            "reproduce",
            "run a study of the paper again, or go on with one that was stopped",
            (
                "piec reproduce planar-disturbance --jobs 2",
                "piec reproduce all --smoke --out runs/smoke",
            ),
            "reproduce",
        ),
        Command(
            "train-field",
            "train an escape field, or go on with a training that was stopped",
            (
                "piec train-field --robot planar_arm --recipe network",
                "piec train-field --recipe pinn --seed 1 --set rounds=2 iterations=200 --out "
                "runs/quick",
            ),
            "train_field",
        ),
        Command(
            "train",
            "train an agent with Stable-Baselines3, or go on with a training that was stopped",
            (
                "piec train --algo ppo --env piec_envs/PlanarArmPush-v0",
                "piec train --algo sac --steps 20000 --hyper n_envs=16 --set prior=contact --out "
                "runs/train/quick",
            ),
            "train",
        ),
        Command(
            "bench",
            "measure speeds and write them to a file",
            ("piec bench", "piec bench --quick"),
            "bench",
        ),
        Command(
            "warmup",
            "compile the kernels that first uses need, such as into the image of a container",
            ("piec warmup", "piec warmup --env piec_envs/PlanarArmPush-v0 piec_envs/FrankaPush-v0"),
            "warmup",
        ),
        Command(
            "render",
            "draw a plan as an animation, or a state as a picture",
            (
                "piec render runs/caging.npz --out runs/caging.gif",
                """piec render --state '{"pose": [0.5, 0.3, 0.0]}' --out runs/state.png""",
            ),
            "render",
        ),
    )
}


def add_worker_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of every command whose work fans out."""
    parser.add_argument(
        "--jobs", type=int, default=1, help="workers; one uses all cores too (default: %(default)s)"
    )
    parser.add_argument(
        "--engine", default="local", help=f"where: {', '.join(ENGINES)} (default: %(default)s)"
    )
    parser.add_argument(
        "--engine-option",
        nargs="+",
        metavar="NAME=VALUE",
        help="of ray.init or of submitit, such as slurm_partition=cpu timeout_min=120 "
        "(docs/scaling.md)",
    )


def open_workers(args: argparse.Namespace) -> AbstractContextManager[Any]:
    """What those arguments ask for, as `run_jobs` takes it."""
    return open_engine(args.engine, args.jobs, settings(args.engine_option))


def settings(pairs: Sequence[str] | None) -> dict[str, Any]:
    """Keyword arguments from the command line.

    Args:
        pairs: `name=value`, where the value is JSON, or plain text.

    Returns:
        The values by name.

    Raises:
        InvalidParameterError: for anything without `=`.
    """
    found = {}
    for pair in pairs or []:
        name, equals, text = pair.partition("=")
        if not (equals and name):
            raise InvalidParameterError(
                f"a setting is name=value, such as object=square, got {pair!r}"
            )
        try:
            found[name] = json.loads(text)
        except ValueError:
            found[name] = text
    return found


def fit_settings(kind: str, chosen: Mapping[str, Any], default: Any) -> dict[str, Any]:
    """Settings as the fields of a dataclass take them.

    Args:
        kind: what they set, such as "planner".
        chosen: from `settings`.
        default: an instance; its values give the types.

    Returns:
        The values by name, whole numbers for floats and lists for tuples made fit.

    Raises:
        UnknownNameError: for a setting that it does not have.
        InvalidParameterError: for a value of another type.
    """
    known = [item.name for item in fields(default)]
    found = {}
    for name, value in chosen.items():
        check_name(f"{kind} setting", name, known)
        found[name] = _like(value, getattr(default, name))
        if found[name] is None:
            raise InvalidParameterError(
                f"{kind} setting {name} is a value such as {getattr(default, name)!r}, got "
                f"{value!r}"
            )
    return found


def _like(value: Any, usual: Any) -> Any:
    """The value in the type of the usual one, None if it is of another."""
    if isinstance(usual, tuple) and usual and isinstance(value, list):
        items = [_like(item, usual[0]) for item in value]
        return None if None in items else tuple(items)
    if isinstance(usual, float) and type(value) is int:
        return float(value)
    return value if type(value) is type(usual) else None

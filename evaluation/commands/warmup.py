"""`piec warmup`: compile what a first make, reset, step and plan need, as into an image."""

from __future__ import annotations

import argparse
import time
from typing import Any

from evaluation.commands import Report
from evaluation.commands.stages import seconds
from evaluation.studies import PUSH

ALL = "all"
# as little as runs every kernel of a plan
LEAST: dict[str, Any] = {
    "iterations": 1,
    "population": 2,
    "restarts": 1,
    "robust_iterations": 1,
    "robust_samples": 1,
}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--env",
        nargs="+",
        default=[PUSH],
        metavar="ID",
        help=f"ids of the environments, or all (default: {PUSH})",
    )


def run(args: argparse.Namespace) -> Report:
    """Say what is not compiled yet, use everything once, and say what that has compiled."""
    from piec_envs import ENVS, check_name, console, pending_kernels

    for env_id in args.env:
        check_name("environment", env_id, (*ENVS, ALL))
    ids = list(ENVS) if ALL in args.env else args.env
    before = pending_kernels()
    console.note(
        f"{len(before)} slow kernels to compile, up to about {seconds(sum(before.values()))}"
        if before
        else "every slow kernel is compiled; looking for the others takes a few seconds"
    )
    for name, expected in before.items():
        console.note(f"  {name}, {seconds(expected)}")
    begin = time.perf_counter()
    for env_id in ids:
        console.note(f"{env_id}: make, reset, step, plan")
        _use(env_id)
    spent = time.perf_counter() - begin
    after = pending_kernels()
    compiled = [name for name in before if name not in after]
    left = ", ".join(after)
    text = f"{len(compiled)} slow kernels compiled in {seconds(spent)}; " + (
        f"not in the cache, since nothing here called them: {left}" if left else "all are kept"
    )
    return Report(
        text, {"envs": ids, "compiled": compiled, "pending": list(after), "seconds": spent}
    )


def _use(env_id: str) -> None:
    """Make, reset and step an environment and a batch of it, and plan for it if it moves."""
    import gymnasium as gym

    from piec_envs import UnknownNameError, check_motion
    from planners import CmaEsPlanner

    env = gym.make(env_id)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    env.close()
    batch = gym.make_vec(env_id, num_envs=2)
    batch.reset(seed=0)
    batch.step(batch.action_space.sample())
    batch.close()
    try:
        check_motion(env_id)
    except UnknownNameError:
        return
    CmaEsPlanner(**LEAST).plan(env_id, progress=False)

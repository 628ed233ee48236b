"""`piec plan`: plan a motion and write it to a file."""

from __future__ import annotations

import argparse
from pathlib import Path

from evaluation.commands import Interrupted, Report, fit_settings, settings
from evaluation.commands.outputs import plan_out, planner_asked
from evaluation.studies import PUSH
from piec_envs import check_name


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument("--env", default=PUSH, help="id of the environment (default: %(default)s)")
    parser.add_argument(
        "--objective", help="contact, proximity, caging (the default) or adversarial"
    )
    parser.add_argument("--preset", help="weights: default, paper (to the letter) or paper-miss")
    parser.add_argument(
        "--seed", type=int, default=0, help="of all randomness (default: %(default)s)"
    )
    parser.add_argument(
        "--planner",
        nargs="+",
        metavar="NAME",
        help="cma-es (the default) or carry, and NAME=VALUE for its settings, such as "
        "iterations=20 restarts=1",
    )
    parser.add_argument(
        "--quick", action="store_true", help="a quarter of the rollouts, for a first look"
    )
    parser.add_argument(
        "--set",
        nargs="+",
        metavar="NAME=VALUE",
        help="keyword arguments of the nominal model, such as object=square",
    )
    parser.add_argument(
        "--out", type=Path, help="file to write (default: runs/plans/OBJECTIVE-seedSEED.npz)"
    )


def run(args: argparse.Namespace) -> Report:
    """Plan and save."""
    from evaluation.plants import plant_in_force, plant_line
    from planners import PlanningInterrupted
    from planners.table import QUICK_PLANNERS, planner_class

    name, given = planner_asked(args.planner)
    kind = planner_class(name)
    asked = {"objective": args.objective, "preset": args.preset}
    own = {**{key: value for key, value in asked.items() if value is not None}, **settings(given)}
    own = fit_settings("planner", own, kind())
    if args.quick:
        check_name("quick planner", name, QUICK_PLANNERS)
    make = kind.quick if args.quick else kind
    out = plan_out(args)
    try:
        plan = make(**own).plan(args.env, seed=args.seed, **settings(args.set))
    except PlanningInterrupted as stopped:
        kept = stopped.plan.save(
            out.with_name(f"{out.stem}-interrupted.npz") if out.exists() else out
        )
        raise Interrupted(
            f"interrupted after {stopped.iterations} of {stopped.total} iterations; the best "
            f"plan so far is kept in "
            f"{kept}, and the same command plans from the beginning"
        ) from stopped
    plan.save(out)
    distance = plan.nominal["goal_distance"]
    d2g = plan.nominal["d2g"]
    place = "inside the goal region" if d2g == 0 else f"{d2g:.3f} m outside the goal region"
    model = plant_in_force(plan.env_id, plan.env_kwargs)
    end = (
        f"{plan.objective}: cost {plan.cost:.6g}; the object ends {distance:.3f} m from the "
        f"goal, {place}"
    )
    text = f"{plant_line(model)}\n{end}"
    data = {
        "objective": plan.objective,
        "preset": plan.preset,
        "seed": plan.seed,
        "cost": plan.cost,
    }
    return Report(
        text, {**data, "env_id": plan.env_id, "model": model, "nominal": plan.nominal}, [out]
    )

"""`piec demo`: from nothing to a table, a picture and an animation in a few minutes."""

from __future__ import annotations

import argparse
import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from evaluation.commands import Report
from evaluation.commands.stages import Stages
from piec_envs import console

NOTE = """\
Open-loop plans of three objectives, same task and same budget, while the object is displaced in
every step. n counts distinct executions of one plan; the interval is Wilson's, at 95 %. An
execution succeeds if the object ends in the goal region; d2g is its distance to the region at the
end; caging is 0.02 times the escape time, mean over time."""


@dataclass(frozen=True)
class Budget:
    """All knobs of the demo.

    Args:
        objectives: what to compare, the best last.
        planner: arguments of `CmaEsPlanner` beside the objective, the same for all, in full.
        protocol: how the plans are disturbed.
        episodes: rollouts of each plan.
        frames: of the animation, about.
        seconds: that planning for one objective, executing all plans, and drawing the picture and
            the animation take on two cores.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    planner: Mapping[str, Any] = field(default_factory=lambda: _budget(quick=False))
    protocol: str = "disturbance-5mm"
    episodes: int = 100
    frames: int = 100
    seconds: tuple[float, float, float, float] = (12.0, 3.0, 2.0, 7.0)

    @classmethod
    def quick(cls) -> Budget:
        """The quick budget of the planner, and fewer frames."""
        return cls(planner=_budget(quick=True), frames=50, seconds=(3.0, 3.0, 2.0, 4.0))

    @classmethod
    def smoke(cls) -> Budget:
        """As small as it gets, to see that everything runs."""
        from evaluation.studies.common import SMOKE_PLANNER

        return cls(planner=SMOKE_PLANNER, episodes=2, frames=3, seconds=(1.0, 1.0, 4.0, 2.0))


def _budget(quick: bool) -> dict[str, Any]:
    """All settings of the planner but for the objective."""
    from planners import CmaEsPlanner

    planner = CmaEsPlanner.quick() if quick else CmaEsPlanner()
    return {
        name: value for name, value in dataclasses.asdict(planner).items() if name != "objective"
    }


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Arguments of the command."""
    parser.add_argument(
        "--out", type=Path, default=Path("runs/demo"), help="folder (default: %(default)s)"
    )
    parser.add_argument(
        "--seed", type=int, default=0, help="of the planners (default: %(default)s)"
    )
    parser.add_argument("--quick", action="store_true", help="plans with a quarter of the rollouts")
    parser.add_argument(
        "--smoke", action="store_true", help="a tiny budget, to see whether everything runs"
    )


def _chosen(args: argparse.Namespace) -> Budget:
    """The budget that was asked for, the smallest of several."""
    if args.smoke:
        return Budget.smoke()
    return Budget.quick() if args.quick else Budget()


def run(args: argparse.Namespace) -> Report:
    """Plan, disturb, tabulate, draw; what an earlier run has done is not done again."""
    from evaluation.figures import animate_rollouts, overview
    from evaluation.plants import plant_in_force, plant_line
    from evaluation.protocols import get_protocol
    from evaluation.studies import PUSH
    from evaluation.studies.common import StudyRun, mode_cases
    from evaluation.studies.pictures import first_trajectories
    from evaluation.tables import markdown, write_table

    budget = _chosen(args)
    study = StudyRun(
        args.out, (args.seed,), budget.episodes, progress=not console.quiet(), cache=args.out
    )
    cases = mode_cases(budget.objectives, budget.planner, {})
    plannings = [f"planning for {case.label}" for case in cases]
    steps = (
        f"executing each plan {budget.episodes} times",
        "drawing the picture",
        "drawing the animation",
    )
    expected = [*[budget.seconds[0]] * len(cases), *budget.seconds[1:]]
    stages = Stages(
        dict(zip([*plannings, *steps], expected, strict=True)),
        console.quiet(),
        partial(_recorded, args.out),
    )
    for case, planning in zip(cases, plannings, strict=True):
        with stages.stage(planning, recorded=True):
            study.plan([case])
    with stages.stage(steps[0], recorded=True):
        results = [result for (result,) in study.evaluate(cases, budget.protocol)]
    rows = [_row(case.title, result) for case, result in zip(cases, results, strict=True)]
    plant = plant_in_force(PUSH, get_protocol(budget.protocol).env_kwargs())
    above = f"Plant of all plans: {plant_line(plant)}\n"
    paths = write_table(args.out, rows, f"Demo: {budget.protocol}", NOTE, above=above)
    with stages.stage(steps[1]):
        drawn = first_trajectories(study, cases, budget.protocol)
        paths.append(overview(drawn, args.out / "overview.png"))
    with stages.stage(steps[2]):
        every = max(1, drawn[0].steps // budget.frames)
        paths.append(animate_rollouts(drawn, args.out / "animation.gif", every=every))
    stages.end()
    data = {
        "protocol": budget.protocol,
        "plant": plant,
        "results": dict(zip(budget.objectives, results, strict=True)),
    }
    wrote = [*paths, args.out / "records.jsonl", args.out / "plans"]
    return Report(markdown(rows, notes=NOTE, above=above), data, wrote)


def _recorded(folder: Path) -> int:
    """How many pieces of work the demo's records hold."""
    file = folder / "records.jsonl"
    return len(file.read_bytes().splitlines()) if file.is_file() else 0


def _row(title: str, result: Mapping[str, Any]) -> dict[str, Any]:
    from evaluation.metrics import wilson_interval
    from evaluation.tables import Spread

    return {
        "objective": title,
        "n": result["n"],
        "success": wilson_interval(result["successes"], result["n"]),
        "d2g, m": Spread(result["d2g_mean"], result["d2g_std"]),
        "caging": result["mean_caging"],
    }

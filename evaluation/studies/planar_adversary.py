"""Planning against a fleeing object, mode 4, beside mode 3 (paper, appendix B.1).

In mode 4 the planner's model lets the object flee down the escape-time field at u_bar. Both kinds
of plan are executed undisturbed (use of the arm), under random displacements, and against the
fleeing object itself.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import contact_fractions, keyframes, over_time
from evaluation.studies.columns import (
    distance_columns,
    home_columns,
    success_columns,
    usage_columns,
)
from evaluation.studies.common import PLANNER_SEEDS, SMOKE_PLANNER, Case, StudyRun, mode_cases
from evaluation.studies.paper import all_notes, paper_cases
from evaluation.studies.pictures import first_trajectories, over_plans
from evaluation.studies.planar_disturbance import draw_disturbed
from evaluation.tables import write_table

USAGE_NOTES = """\
Undisturbed executions, one distinct execution for each planner seed. Columns as in
planar-objectives. "Goal distance" and "in the goal" are those of the planner's own nominal
execution, which for mode 4 has the fleeing object in it."""
ROBUST_NOTES = """\
n counts distinct executions: plans x rollouts of each; against the fleeing object every rollout of
a plan is the same one. Columns as in planar-disturbance."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        paper: objectives planned with the paper's presets and budget as well.
        planner_seeds: one plan of each objective for each.
        protocols: how plans are disturbed; those in `drawn` go into the figures.
        drawn: the protocols of the figures, by growing sigma.
        episodes: rollouts of each plan under each random protocol.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("caging", "adversarial")
    paper: tuple[str, ...] = ("contact", "proximity", "caging", "adversarial")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    protocols: tuple[str, ...] = (
        "disturbance-1mm",
        "disturbance-3mm",
        "disturbance-5mm",
        "adversary",
    )
    drawn: tuple[str, ...] = ("disturbance-1mm", "disturbance-3mm", "disturbance-5mm")
    episodes: int = 100
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        protocols = ("disturbance-5mm", "adversary")
        return cls(
            paper=(),
            planner_seeds=(0,),
            protocols=protocols,
            drawn=protocols[:1],
            episodes=2,
            planner=SMOKE_PLANNER,
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-adversary; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress)
    modes = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    cases = [*modes, *paper_cases(settings.paper, settings.env_kwargs)]
    plans = study.plan(cases)
    nominal = study.evaluate(cases, "nominal")
    usage = [
        {"objective": case.title, **home_columns(planned), **usage_columns(executed)}
        for case, planned, executed in zip(cases, plans, nominal, strict=True)
    ]
    robust = [
        {
            "protocol": protocol,
            "objective": case.title,
            **success_columns(results),
            **distance_columns(results),
        }
        for protocol in settings.protocols
        for case, results in zip(cases, study.evaluate(cases, protocol), strict=True)
    ]
    tables = [
        *write_table(
            study.out_dir,
            robust,
            "Mode 4 beside mode 3: disturbed",
            all_notes(ROBUST_NOTES, settings.paper),
        ),
        *write_table(
            study.out_dir, usage, "Mode 4 beside mode 3: use of the arm", USAGE_NOTES, name="usage"
        ),
    ]
    return [*tables, *_draw(study, modes, nominal), *draw_disturbed(study, modes, settings.drawn)]


def _draw(study: StudyRun, cases: list[Case], nominal: list[list[dict]]) -> list[Path]:
    """How the arm is used without disturbance."""
    folder = study.out_dir
    fractions = {
        case.label: np.mean([result["contact_fraction"] for result in results], axis=0)
        for case, results in zip(cases, nominal[: len(cases)], strict=True)
    }
    distance = {case.label: over_plans(study, case, "nominal", "mean_distance") for case in cases}
    caging = {case.label: over_plans(study, case, "nominal", "caging") for case in cases}
    return study.draw(
        partial(keyframes, first_trajectories(study, cases), folder / "keyframes.png"),
        partial(contact_fractions, fractions, folder / "contact_fractions.png"),
        partial(over_time, distance, "arm distance [m]", folder / "arm_distance.png"),
        partial(over_time, caging, "caging", folder / "caging.png"),
    )

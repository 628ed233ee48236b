"""What the three objectives make the arm do, without disturbance (paper, section 5.4).

The same task is planned with each objective and several planner seeds. Shown are key frames, the
fraction of the time in which each link touches the object, the arm's mean distance and the caging
over time. The protocol draws nothing, so that each plan is one execution.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import contact_fractions, field_strip, keyframes, over_time
from evaluation.studies.columns import home_columns, spread, usage_columns
from evaluation.studies.common import PLANNER_SEEDS, SMOKE_PLANNER, Case, StudyRun, mode_cases
from evaluation.studies.paper import all_notes, paper_cases
from evaluation.studies.pictures import first_trajectories, over_plans
from evaluation.tables import write_table

EARLY = 200  # steps in which the paper has mode 3 keep a larger distance than mode 2
NOTES = """\
n counts distinct executions, one for each planner seed. Goal distance: object's centre to the
goal's at the end of each plan's nominal execution; "in the goal" counts those within 0.05 m. Link
columns: fraction of the time in contact, mean over plans; arm distance: mean over links and time,
and over the first 20 s alone; caging: 0.02 times the escape time, mean over time; all three as mean
± standard deviation over plans. "Through itself" counts plans along which links cross."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        paper: objectives planned with the paper's presets and budget as well.
        planner_seeds: one plan of each objective for each.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    paper: tuple[str, ...] = ("contact", "proximity", "caging")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            objectives=("contact", "caging"), paper=(), planner_seeds=(0,), planner=SMOKE_PLANNER
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-objectives; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(
        Path(out_dir), settings.planner_seeds, episodes=1, jobs=jobs, progress=progress
    )
    modes = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    cases = [*modes, *paper_cases(settings.paper, settings.env_kwargs)]
    plans = study.plan(cases)
    results = study.evaluate(cases, "nominal")
    rows = []
    for case, planned, executed in zip(cases, plans, results, strict=True):
        # (plans,)
        early = over_plans(study, case, "nominal", "mean_distance")[:, : EARLY + 1].mean(axis=1)
        row = {"objective": case.title, **home_columns(planned), **usage_columns(executed)}
        rows.append({**row, "arm distance to 20 s, m": spread(early)})
    tables = write_table(
        study.out_dir, rows, "What the objectives make the arm do", all_notes(NOTES, settings.paper)
    )
    return [*tables, *_draw(study, modes, results)]


def _draw(study: StudyRun, cases: list[Case], results: list[list[dict]]) -> list[Path]:
    """Key frames and the field of the first plans; curves and bars over all plans."""
    folder = study.out_dir
    fractions = {
        case.label: np.mean([result["contact_fraction"] for result in executed], axis=0)
        for case, executed in zip(cases, results[: len(cases)], strict=True)
    }
    distance = {case.label: over_plans(study, case, "nominal", "mean_distance") for case in cases}
    caging = {case.label: over_plans(study, case, "nominal", "caging") for case in cases}
    drawn = first_trajectories(study, cases)
    return study.draw(
        partial(keyframes, drawn, folder / "keyframes.png"),
        partial(contact_fractions, fractions, folder / "contact_fractions.png"),
        partial(over_time, distance, "arm distance [m]", folder / "arm_distance.png"),
        partial(over_time, caging, "caging", folder / "caging.png"),
        partial(field_strip, drawn[-1], folder / "escape_time.png"),
    )

"""Plans for one friction executed under others (paper, section 6.3.3).

The plans of `planar-objectives`, made for friction 0.5, are executed open loop with other
coefficients between arm and object, from the task's start and from drawn ones.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.protocols import get_protocol
from evaluation.studies.common import (
    DRAWN_STARTS,
    PLANNER_SEEDS,
    SMOKE_PLANNER,
    StudyRun,
    mode_cases,
)
from evaluation.studies.mismatch import (
    PICTURES,
    draw_mismatch,
    evaluate_all,
    mismatch_rows,
    notes,
    paper_table,
)
from evaluation.studies.paper import paper_cases
from evaluation.tables import write_table

NOTES = "Plans are made for friction 0.5: `friction-0.50` is the case without mismatch."


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        paper: objectives planned with the paper's presets and budget as well, in a table of their
            own.
        planner_seeds: one plan of each objective for each.
        protocols: the true frictions.
        drawn: those of the figures.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    paper: tuple[str, ...] = ("contact", "proximity", "caging")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    protocols: tuple[str, ...] = (
        "friction-0.00",
        "friction-0.25",
        "friction-0.50",
        "friction-0.75",
        "friction-1.00",
    )
    drawn: tuple[str, ...] = ("friction-0.00", "friction-0.25", "friction-0.75", "friction-1.00")
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        protocols = ("friction-0.00", "friction-0.50")
        return cls(
            ("contact", "caging"),
            (),
            (0,),
            protocols,
            protocols[:1],
            starts=2,
            planner=SMOKE_PLANNER,
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-friction; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, 1, jobs, progress, settings.starts)
    cases = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    paper = paper_cases(settings.paper, settings.env_kwargs)
    study.plan([*cases, *paper])
    results = evaluate_all(study, cases, settings.protocols)
    title = "Plans for friction 0.5 under other frictions"
    tables = write_table(
        study.out_dir, mismatch_rows(cases, results), title, notes(cases, results, NOTES, PICTURES)
    )
    drawn = draw_mismatch(study, cases, settings.drawn, settings.protocols, _label)
    return [*tables, *paper_table(study, paper, settings.protocols, title, NOTES), *drawn]


def _label(protocol: str) -> str:
    """What figures call a protocol."""
    return f"$\\mu$ = {get_protocol(protocol).params['friction']:g}"

"""All of section 6 in one table: three modes under every protocol that departs from the circle.

The plans of `planar-objectives` are executed open loop under random displacements (section 6.2),
simplified contact models (6.3), a fleeing object (appendix B.1) and several of these at once, from
the task's start and from drawn ones.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from evaluation.figures import Robustness, robustness
from evaluation.protocols import PROTOCOLS
from evaluation.studies.common import (
    DRAWN_STARTS,
    PLANNER_SEEDS,
    SMOKE_PLANNER,
    Case,
    StudyRun,
    mode_cases,
)
from evaluation.studies.mismatch import (
    Results,
    estimate,
    evaluate_all,
    mismatch_rows,
    notes,
    success_rate,
)
from evaluation.tables import write_table

# They belong to plans for another object.
ELSEWHERE = (
    "friction-0.20",
    "friction-0.80",
    "shape-box_212",
    "shape-paper_pack_wrapped",
    "shape-a4_box",
)
NOTES = (
    "`combined` is MuJoCo, the square, friction 0.25 and gaussian displacements of 5 mm at once."
)


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        planner_seeds: one plan of each objective for each.
        protocols: the perturbations; each is executed from drawn starts as well.
        episodes: executions of each plan under each random protocol, from the task's start.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    protocols: tuple[str, ...] = tuple(
        name for name, row in PROTOCOLS.items() if row.start_noise is None and name not in ELSEWHERE
    )
    episodes: int = 100
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs; MuJoCo, which takes its time, has its own
        study.
        """
        protocols = ("nominal", "shape-square", "disturbance-5mm")
        return cls(
            ("contact", "caging"), (0,), protocols, episodes=2, starts=2, planner=SMOKE_PLANNER
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-robustness; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(
        Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts
    )
    cases = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    study.plan(cases)
    results = evaluate_all(study, cases, settings.protocols)
    title = "Which plans survive which perturbation"
    tables = write_table(
        study.out_dir, mismatch_rows(cases, results), title, notes(cases, results, NOTES)
    )
    rows = {name: _shown(cases, results, name) for name in settings.protocols if name != "nominal"}
    return [*tables, *study.draw(partial(robustness, rows, study.out_dir / "robustness.png"))]


def _shown(cases: Sequence[Case], results: Results, protocol: str) -> dict[str, Robustness]:
    """What the figure shows of one protocol, by mode."""
    shown = {}
    for case, plain, drawn in zip(
        cases, results[protocol], results[f"{protocol}-start"], strict=True
    ):
        drift = estimate(drawn, "deviation"), estimate(drawn, "final_deviation")
        shown[case.label] = Robustness(success_rate(plain), success_rate(drawn), *drift)
    return shown

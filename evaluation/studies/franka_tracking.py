"""Moving an object along an arc with a mobile Franka: tracking against caging (paper, section 7.2.2).

The weight of the tracking error over that of the caging, lambda, is varied on two arcs between the same ends. The
plans of the largest lambda on the first arc are executed under displacements and on other plants as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from evaluation.figures import Tracked, keyframes, mismatch_paths, reference_paths, tradeoff, trajectories
from evaluation.metrics import coverage
from evaluation.studies.common import (
    DRAWN_STARTS,
    PLANNER_SEEDS,
    SMOKE_PLANNER,
    Case,
    StudyRun,
    column,
    distance_columns,
    spread,
    success_columns,
)
from evaluation.studies.contact_methods import SMALL_TABLE
from evaluation.studies.franka_push import MISMATCHES, PLANNER
from evaluation.studies.mismatch import evaluate_all, executed
from evaluation.studies.mismatch import mismatch_rows as plant_rows
from evaluation.studies.pictures import first_trajectories, over_plans, trajectory_env
from evaluation.tables import write_table
from piec_envs.episodes.tasks import PAPER_REFERENCE_POINTS, TRACKING_TOLERANCE, CostWeights

ENV = "piec_envs/MobileFrankaTrack-v0"
NOTES = """\
n counts distinct executions, one of each plan, without noise; mean ± standard deviation over plans, mean over time.
Error: distance to the reference point of that time; shortest distance: to the nearest of 50 points of the reference,
the paper's term; coverage: share of the reference's points that the object comes within 0.03 m of. d2g: distance to
the goal region at the end, largest of all plans. Success: d2g = 0 and a mean error of at most 0.03 m."""
RANK_NOTES = """\
Spearman's rank correlation of lambda with the mean tracking error and with the mean caging: of the means over plans
at each lambda, and of the plans of each planner seed. n counts distinct executions."""
ROBUST_NOTES = """\
The plans of the largest lambda under displacements of sigma = 5 mm for each axis in each step. n counts distinct
executions: plans x rollouts. Success asks for d2g = 0 and a mean tracking error of at most 0.03 m."""
PLANT_NOTES = """\
The same plans on other plants, from the task's start and (`-start`) from starts drawn within 0.01 m and 0.05 rad.
n counts distinct executions: plans x executions. Deviation: largest distance from the unperturbed execution at the
same time, and that at the end; intervals (95 %) by a bootstrap over plans, of single executions by Wilson."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        ratios: lambda, the weight of the tracking error over that of the caging.
        sides: the arcs.
        planner_seeds: one plan of each ratio and arc for each.
        noise: protocol of the displacements.
        mismatches: protocols of other plants, and what figures call them.
        episodes: rollouts of each plan under noise.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    ratios: tuple[float, ...] = (1.0, 5.0, 10.0, 50.0, 100.0)
    sides: tuple[str, ...] = ("right", "left")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS[:3]
    noise: str = "disturbance-5mm"
    mismatches: Mapping[str, str] = field(default_factory=lambda: MISMATCHES)
    episodes: int = 100
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=lambda: PLANNER)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            ratios=(1.0, 100.0),
            sides=("right",),
            planner_seeds=(0,),
            mismatches={"shape-box_212": "box"},
            episodes=2,
            starts=2,
            planner=SMOKE_PLANNER,
            env_kwargs={"geometry": "capsules", "escape_field": SMALL_TABLE},
        )

    def case(self, side: str, ratio: float) -> Case:
        """Planning along one arc with one ratio."""
        weights = {"task": ratio * CostWeights().prior}
        env_kwargs = {**self.env_kwargs, "reference": side, "weights": weights}
        return Case(f"{side}, lambda {ratio:g}", {**self.planner, "objective": "caging"}, env_kwargs, ENV)


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-tracking; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts)
    cases = {(side, ratio): settings.case(side, ratio) for side in settings.sides for ratio in settings.ratios}
    study.plan(list(cases.values()))
    results = dict(zip(cases, study.evaluate(list(cases.values()), "nominal"), strict=True))
    rows = [_row(study, *key, case, results[key]) for key, case in cases.items()]
    ranks = [_rank_row(side, settings.ratios, results) for side in settings.sides]
    best = cases[settings.sides[0], max(settings.ratios)]
    noisy = study.evaluate([best], settings.noise)[0]
    robust = [{"plans": best.label, **success_columns(noisy), **distance_columns(noisy)}]
    robust[0]["error, mm"] = float(np.average(1e3 * column(noisy, "tracking_error"), weights=column(noisy, "n")))
    plants = plant_rows([best], evaluate_all(study, [best], ("nominal", *settings.mismatches)))
    folder = study.out_dir
    return [
        *write_table(folder, rows, "Tracking against caging", NOTES),
        *write_table(folder, ranks, "How tracking error and caging go with lambda", RANK_NOTES, "ranks"),
        *write_table(folder, robust, "Tracking under displacements", ROBUST_NOTES, "disturbed"),
        *write_table(folder, plants, "Tracking on other plants", PLANT_NOTES, "mismatch"),
        *_draw(study, settings, cases, results),
    ]


def _row(study: StudyRun, side: str, ratio: float, case: Case, results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How well the plans of one ratio track and cage without noise."""
    reference = trajectory_env(case).batch.task.reference  # (N + 1, 2)
    points = reference[np.linspace(0, len(reference) - 1, PAPER_REFERENCE_POINTS).astype(int)]
    paths = [study.load_evaluation(case, seed, "nominal").pose for seed in study.seeds]  # (1, N + 1, 3) each
    shortest = [np.hypot(*(path[0, 1:, None, :2] - points).transpose(2, 0, 1)).min(axis=1).mean() for path in paths]
    return {
        "arc": side,
        "lambda": ratio,
        "n": len(results),
        "error, mm": spread(1e3 * column(results, "tracking_error")),
        "shortest distance, mm": spread(1e3 * np.array(shortest)),
        "coverage": spread(np.array([coverage(path, reference)[0] for path in paths])),
        "d2g, m": float(column(results, "d2g_mean").max()),
        "success": f"{sum(result['successes'] for result in results)} of {len(results)}",
        "caging": spread(column(results, "mean_caging")),
        "caging at the end": spread(column(results, "final_caging")),
    }


def _rank_row(side: str, ratios: Sequence[float], results: Mapping[Any, Sequence[Mapping[str, Any]]]) -> dict[str, Any]:
    """Rank correlations on one arc."""
    row: dict[str, Any] = {"arc": side, "n": sum(len(results[side, ratio]) for ratio in ratios)}
    for name, label in (("tracking_error", "error"), ("mean_caging", "caging")):
        values = np.array([column(results[side, ratio], name) for ratio in ratios])  # (ratios, plans)
        row[f"{label}, means"] = rank_correlation(ratios, values.mean(axis=1))
        row[f"{label}, each seed"] = [rank_correlation(ratios, one) for one in values.T]
    return row


def rank_correlation(first: Sequence[float], second: np.ndarray) -> float | None:
    """Spearman's rank correlation; None where the second does not vary."""
    return float(spearmanr(first, second).statistic) if np.ptp(second) > 0 else None


def _draw(study: StudyRun, settings: Settings, cases: Mapping[Any, Case], results: Mapping[Any, Any]) -> list[Path]:
    """The trade-off, paths and caging of each ratio, key frames of the extremes, and how the best plan holds."""
    folder, side = study.out_dir, settings.sides[0]
    points = {
        ratio: np.column_stack([column(results[side, ratio], name) for name in ("mean_caging", "tracking_error")])
        for ratio in settings.ratios
    }
    tracked = {}
    for ratio in settings.ratios:
        shown = [cases[arc, ratio] for arc in settings.sides]
        caging = [over_plans(study, case, "nominal", "caging")[0] for case in shown]
        tracked[ratio] = [Tracked(*pair) for pair in zip(first_trajectories(study, shown), caging, strict=True)]
    extremes = [cases[side, min(settings.ratios)], cases[side, max(settings.ratios)]]
    best = extremes[-1:]
    runs = [[executed(study, best[0], name, label) for name, label in settings.mismatches.items()]]
    return study.draw(
        partial(tradeoff, points, folder / "tradeoff.png", TRACKING_TOLERANCE),
        partial(reference_paths, tracked, folder / "reference_paths.png"),
        partial(keyframes, first_trajectories(study, extremes), folder / "keyframes.png"),
        partial(trajectories, first_trajectories(study, best, settings.noise), folder / "object_paths.png"),
        partial(mismatch_paths, first_trajectories(study, best), runs, folder / "mismatch_paths.png"),
    )

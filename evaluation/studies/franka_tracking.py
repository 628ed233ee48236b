"""Moving an object along an arc with a mobile Franka: tracking against caging (paper, section
7.2.2).

The weight of the tracking error over that of the caging, lambda, is varied on two arcs between the
same ends, from the task's start, a cage that the base can carry along, and from an open posture
that has to be closed on the way. The plans of the largest lambda on the first arc, from both
postures, are executed under displacements and on other plants as well.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import cycle, product
from pathlib import Path
from typing import Any

import numpy as np
from scipy.stats import spearmanr

from evaluation.metrics import coverage
from evaluation.studies.columns import column, distance_columns, spread, success_columns
from evaluation.studies.common import DRAWN_STARTS, PLANNER_SEEDS, SMOKE_PLANNER, Case, StudyRun
from evaluation.studies.contact_methods import OPEN, SMALL_TABLE
from evaluation.studies.franka_push import MISMATCHES, PLANNER
from evaluation.studies.franka_tracking_figures import draw_best, draw_lambdas
from evaluation.studies.mismatch import evaluate_all
from evaluation.studies.mismatch import mismatch_rows as plant_rows
from evaluation.studies.pictures import case_setup
from evaluation.tables import write_table
from piec_envs import PAPER_REFERENCE_POINTS, CostWeights

ENV = "piec_envs/MobileFrankaTrack-v0"
# at the start; the first is the task's own
POSTURES: Mapping[str, Mapping[str, Any]] = {"cage": {}, "open": OPEN}
NOTES = """\
n counts distinct executions, one of each plan, without noise; mean ± standard deviation over plans,
mean over time. Error: distance to the reference point of that time; shortest distance: to the
nearest of 50 points of the reference, the paper's term; coverage: share of the reference's points
that the object comes within 0.03 m of. d2g: distance to the goal region at the end, largest of all
plans. Success: d2g = 0 and a mean error of at most 0.03 m. Start: `cage`, the task's own, need only
be carried along, and is by the planner's first guess at every lambda; `open` is elbow and wrist at
right angles, and closing it moves the object."""
RANK_NOTES = """\
Spearman's rank correlation of lambda with the mean tracking error and with the mean caging: of the
means over plans at each lambda, and of the plans of each planner seed. n counts distinct
executions."""
ROBUST_NOTES = """\
The plans of the largest lambda on the first arc under displacements of sigma = 5 mm for each axis
in each step, from the task's own start, a cage, and from the open one, from which alone lambda
trades caging for tracking. n counts distinct executions: plans x rollouts. Success asks for d2g = 0
and a mean tracking error of at most 0.03 m."""
PLANT_NOTES = """\
The same plans on other plants, from the object's own place and (`-start`) from places drawn within
0.01 m and 0.05 rad of it; start: the arm's posture. Success asks for d2g = 0 and a mean tracking
error of at most 0.03 m. n counts distinct executions: plans x executions. Deviation: largest
distance from the unperturbed execution at the same time, and that at the end; intervals (95 %) by a
bootstrap over plans, of single executions by Wilson."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        ratios: lambda, the weight of the tracking error over that of the caging.
        sides: the arcs.
        postures: keys of POSTURES.
        planner_seeds: one plan of each ratio, arc and posture for each.
        noise: protocol of the displacements.
        mismatches: protocols of other plants, and what figures call them.
        episodes: rollouts of each plan under noise.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    ratios: tuple[float, ...] = (1.0, 5.0, 10.0, 50.0, 100.0)
    sides: tuple[str, ...] = ("right", "left")
    postures: tuple[str, ...] = tuple(POSTURES)
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

    def case(self, posture: str, side: str, ratio: float) -> Case:
        """Planning from one posture along one arc with one ratio.

        Args:
            posture: a key of POSTURES.
            side: the arc.
            ratio: lambda, the weight of the tracking error over that of the caging.

        Returns:
            The case.
        """
        weights = {"task": ratio * CostWeights().prior}
        env_kwargs = {**self.env_kwargs, **POSTURES[posture], "reference": side, "weights": weights}
        return Case(
            f"{side}, lambda {ratio:g}", {**self.planner, "objective": "caging"}, env_kwargs, ENV
        )


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
    study = StudyRun(
        Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts
    )
    lines = list(product(settings.postures, settings.sides))
    cases = {
        (*line, ratio): settings.case(*line, ratio) for line in lines for ratio in settings.ratios
    }
    study.plan(list(cases.values()))
    results = dict(zip(cases, study.evaluate(list(cases.values()), "nominal"), strict=True))
    rows = [_row(study, *key, case, results[key]) for key, case in cases.items()]
    ranks = [_rank_row(*line, settings.ratios, results) for line in lines]
    folder = study.out_dir
    tight = {
        posture: cases[posture, settings.sides[0], max(settings.ratios)]
        for posture in settings.postures
    }
    robust, plants = _robustness(study, settings, tight)
    return [
        *write_table(folder, rows, "Tracking against caging", NOTES),
        *write_table(
            folder, ranks, "How tracking error and caging go with lambda", RANK_NOTES, "ranks"
        ),
        *write_table(folder, robust, "Tracking under displacements", ROBUST_NOTES, "disturbed"),
        *write_table(folder, plants, "Tracking on other plants", PLANT_NOTES, "mismatch"),
        *(
            path
            for posture in settings.postures
            for path in draw_best(study, settings, posture, cases)
        ),
        *(
            path
            for posture in settings.postures
            for path in draw_lambdas(study, settings, posture, cases, results)
        ),
    ]


def _robustness(
    study: StudyRun, settings: Settings, cases: Mapping[str, Case]
) -> tuple[list[dict[str, Any]], list[dict[str, Any]]]:
    """Rows of the tables of displacements and of other plants.

    Args:
        study: the run.
        settings: name the noise and the plants.
        cases: by the posture that they start from.
    """
    compared = list(cases.values())
    noise = []
    for (posture, case), found in zip(
        cases.items(), study.evaluate(compared, settings.noise), strict=True
    ):
        noise.append(
            {
                "start": posture,
                "plans": case.label,
                **success_columns(found),
                **distance_columns(found),
            }
        )
        error = np.average(column(found, "tracking_error"), weights=column(found, "n"))
        noise[-1]["error, mm"] = 1e3 * float(error)
    plants = plant_rows(compared, evaluate_all(study, compared, ("nominal", *settings.mismatches)))
    postures = cycle(cases)  # the rows of a protocol are those of the cases
    return noise, [{"start": next(postures), **row} for row in plants]


def _row(
    study: StudyRun,
    posture: str,
    side: str,
    ratio: float,
    case: Case,
    results: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """How well the plans of one ratio track and cage without noise."""
    reference = case_setup(case).task.reference  # (N + 1, 2)
    points = reference[np.linspace(0, len(reference) - 1, PAPER_REFERENCE_POINTS).astype(int)]
    # (1, N + 1, 3) each
    paths = [study.load_evaluation(case, seed, "nominal").pose for seed in study.seeds]
    shortest = [
        np.hypot(*(path[0, 1:, None, :2] - points).transpose(2, 0, 1)).min(axis=1).mean()
        for path in paths
    ]
    return {
        "start": posture,
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


def _rank_row(
    posture: str,
    side: str,
    ratios: Sequence[float],
    results: Mapping[Any, Sequence[Mapping[str, Any]]],
) -> dict[str, Any]:
    """Rank correlations from one posture on one arc."""
    found = [results[posture, side, ratio] for ratio in ratios]
    row: dict[str, Any] = {"start": posture, "arc": side, "n": sum(len(plans) for plans in found)}
    for name, label in (("tracking_error", "error"), ("mean_caging", "caging")):
        values = np.array([column(plans, name) for plans in found])  # (ratios, plans)
        row[f"{label}, means"] = rank_correlation(ratios, values.mean(axis=1))
        row[f"{label}, each seed"] = [rank_correlation(ratios, one) for one in values.T]
    return row


def rank_correlation(first: Sequence[float], second: np.ndarray) -> float | None:
    """Spearman's rank correlation.

    Args:
        first: numbers.
        second: as many, shape (k,).

    Returns:
        The correlation, in [-1, 1]; None where the second does not vary.
    """
    return float(spearmanr(first, second).statistic) if np.ptp(second) > 0 else None

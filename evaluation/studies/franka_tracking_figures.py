"""Figures of the tracking study."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import (
    Tracked,
    keyframes,
    mismatch_paths,
    reference_paths,
    tradeoff,
    trajectories,
)
from evaluation.studies.columns import column
from evaluation.studies.common import Case, StudyRun
from evaluation.studies.mismatch import executed
from evaluation.studies.pictures import first_trajectories, over_plans
from piec_envs import TRACKING_TOLERANCE


def draw_best(
    study: StudyRun, settings: Any, posture: str, cases: Mapping[Any, Case]
) -> list[Path]:
    """Key frames of the extremes from one posture, and how the plans of the largest lambda hold.

    Args:
        study: the run.
        settings: the study's `Settings`.
        posture: where the plans start.
        cases: by posture, side and ratio.

    Returns:
        The files written.
    """
    folder = study.out_dir
    ending = _ending(settings, posture)
    line = (posture, settings.sides[0])
    extremes = [cases[*line, min(settings.ratios)], cases[*line, max(settings.ratios)]]
    best = extremes[-1:]
    runs = [[executed(study, best[0], name, label) for name, label in settings.mismatches.items()]]
    return study.draw(
        partial(keyframes, first_trajectories(study, extremes), folder / f"keyframes{ending}.png"),
        partial(
            trajectories,
            first_trajectories(study, best, settings.noise),
            folder / f"object_paths{ending}.png",
        ),
        partial(
            mismatch_paths,
            first_trajectories(study, best),
            runs,
            folder / f"mismatch_paths{ending}.png",
        ),
    )


def draw_lambdas(
    study: StudyRun,
    settings: Any,
    posture: str,
    cases: Mapping[Any, Case],
    results: Mapping[Any, Any],
) -> list[Path]:
    """The trade-off on the first arc, and paths and caging of each lambda on all.

    Args:
        study: the run.
        settings: the study's `Settings`.
        posture: where the plans start.
        cases: by posture, side and ratio.
        results: for each the results of `evaluate_once` without noise.

    Returns:
        The files written.
    """
    points = {}
    tracked = {}
    for ratio in settings.ratios:
        first = results[posture, settings.sides[0], ratio]
        points[ratio] = np.column_stack(
            [column(first, name) for name in ("mean_caging", "tracking_error")]
        )
        shown = [cases[posture, side, ratio] for side in settings.sides]
        caging = [over_plans(study, case, "nominal", "caging")[0] for case in shown]
        tracked[ratio] = [
            Tracked(*pair) for pair in zip(first_trajectories(study, shown), caging, strict=True)
        ]
    ending = _ending(settings, posture)
    return study.draw(
        partial(tradeoff, points, study.out_dir / f"tradeoff{ending}.png", TRACKING_TOLERANCE),
        partial(reference_paths, tracked, study.out_dir / f"reference_paths{ending}.png"),
    )


def _ending(settings: Any, posture: str) -> str:
    """What the names of figures end in."""
    return "" if posture == settings.postures[0] else f"_{posture}"

"""Plans for a circle executed with polygons around it (paper, section 6.3.2).

The plans of `planar-objectives`, made for a circle, are executed open loop with an octagon, a
hexagon and a square of the same apothem, from the task's start and from drawn ones. A second table
and a figure state how wrong the circle is about each of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import shape_mismatches
from evaluation.protocols import get_protocol
from evaluation.shape_mismatch import shape_mismatch
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
from piec_envs import Object, get_object

NOTES = "`nominal` is the case without mismatch: the object that the plans are made for."
SHAPE_NOTES = """\
Both surfaces are looked at in every direction from the object's origin. Contact displacement:
largest distance between their points in one direction; normal error: largest angle between their
normals there (beside a corner, where the normal jumps). Direction: the first in which it occurs."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        paper: objectives planned with the paper's presets and budget as well, in a table of their
            own.
        planner_seeds: one plan of each objective for each.
        protocols: the true shapes.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment, among them the object that is planned for.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    paper: tuple[str, ...] = ("contact", "proximity", "caging")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    protocols: tuple[str, ...] = ("shape-octagon", "shape-hexagon", "shape-square")
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            ("contact", "caging"), (), (0,), ("shape-square",), starts=2, planner=SMOKE_PLANNER
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-shape; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, 1, jobs, progress, settings.starts)
    cases = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    paper = paper_cases(settings.paper, settings.env_kwargs)
    study.plan([*cases, *paper])
    everything = ("nominal", *settings.protocols)
    results = evaluate_all(study, cases, everything)
    planned = get_object(settings.env_kwargs.get("object", "circle"))
    true = [get_object(get_protocol(protocol).params["object"]) for protocol in settings.protocols]
    title = f"Plans for the {planned.name} executed with other shapes"
    rows = mismatch_rows(cases, results)
    tables = [
        *paper_table(study, paper, everything, title, NOTES),
        *write_table(study.out_dir, rows, title, notes(cases, results, NOTES, PICTURES)),
        *write_table(
            study.out_dir,
            _shape_rows(planned, true),
            "How wrong the planned shape is",
            SHAPE_NOTES,
            "shapes",
        ),
    ]
    label = {
        "nominal": planned.name,
        **{p: item.name for p, item in zip(settings.protocols, true, strict=True)},
    }
    drawn = draw_mismatch(study, cases, settings.protocols, everything, label.__getitem__)
    return [*tables, *drawn, shape_mismatches(planned, true, study.out_dir / "shapes.png")]


def _shape_rows(planned: Object, true: Sequence[Object]) -> list[dict[str, Any]]:
    """The second table."""
    rows = []
    for item in true:
        mismatch = shape_mismatch(planned.shapes, item.shapes)
        (displacement, moved) = mismatch.worst_displacement
        (error, turned) = mismatch.worst_normal_error
        rows.append(
            {
                "planned": planned.name,
                "true": item.name,
                "contact displacement, mm": round(1e3 * displacement, 3),
                "in direction, deg": round(float(np.degrees(moved[0])), 2),
                "normal error, deg": round(float(np.degrees(error)), 2),
                "beside direction, deg": round(float(np.degrees(turned[0])), 2),
            }
        )
    return rows

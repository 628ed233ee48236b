"""Which postures enclose an object: CMA-ES and SQP on the static problem (paper, section 4.6).

Object poses near the base are drawn as the environment PlanarArmCage draws them. For each of them
both optimisers begin at the same random postures. What they find is judged by fast marching on a
fine grid, whatever field they optimised.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.figures import PosturePanel, posture_grid, posture_row, value_dots
from evaluation.jobs import Context, Work, run_recorded
from evaluation.studies.posture_work import (
    Method,
    Records,
    best_judged,
    feasible_results,
    field_spec,
    judged_values,
    search_columns,
    search_posture,
    winner,
)
from evaluation.tables import write_table

CAGE = "piec_envs/PlanarArmCage-v0"
ROBOT = "planar_arm"
CLOSE = 0.97  # of the best judged caging of CMA-ES at a pose
NOTES = """\
n counts distinct executions, one for each random start; every row of a pose has the same starts.
Values are caging, 0.02 T_hat: "found" under the optimised field, "judged" by fast marching with 200
nodes a side, best and median over starts, of postures that overlap by at most 1e-6 m ("feasible").
"Enclosed" counts feasible postures that a hard wall (leak = 0) closes on the judging grid. "Near
the best" counts postures judged at least 97 % of the best one of CMA-ES, from whatever start, at
that pose. Overlap: the largest of a feasible posture, with the object or itself. Queries: postures
at which the field was asked, gradients included, mean over starts; seconds: median, one machine,
not to be compared with others."""


METHODS = (
    Method("CMA-ES", "cma-es"),
    Method("SQP", "sqp"),
    Method("SQP, 5 restarts", "sqp", {"restarts": 5}),
)
SMOKE_METHODS = (
    Method("CMA-ES", "cma-es", {"population": 10, "iterations": 3}),
    Method("SQP", "sqp", {"iterations": 3, "restarts": 1, "guesses": 10}),
)


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        fields: escape fields to optimise.
        object: row of the table of objects.
        poses: reset seeds of the environment that draws the object's poses.
        starts: random starts at each pose.
        methods: what is compared; the first is the yardstick.
        judge: nodes a side of the judging grid.
    """

    fields: tuple[str, ...] = ("grid", "network")
    object: str = "three_discs"
    poses: tuple[int, ...] = (0, 1, 2, 3, 4)
    starts: int = 10
    methods: tuple[Method, ...] = METHODS
    judge: int = 200

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(fields=("network",), poses=(0,), starts=2, methods=SMOKE_METHODS, judge=48)


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-caging.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    folder = Path(out_dir)
    cases = [
        (name, seed, method)
        for name in settings.fields
        for seed in settings.poses
        for method in settings.methods
    ]
    works = [
        make_work(settings, *case, start) for case in cases for start in range(settings.starts)
    ]
    context = Context(folder=str(folder), progress=progress)
    records = run_recorded(
        solve_once, works, folder / "records.jsonl", jobs, context, "solving" if progress else ""
    )
    by_case = {
        case: records[i * settings.starts : (i + 1) * settings.starts]
        for i, case in enumerate(cases)
    }
    tables = write_table(
        folder, make_rows(settings, by_case), "Postures that enclose an object", NOTES
    )
    return [*tables, *_draw(settings, by_case, folder)]


# --- one piece of work -------------------------------------------------------------------------


def make_work(
    settings: Settings, field_name: str, pose_seed: int, method: Method, start: int
) -> Work:
    """One optimisation from one start.

    Args:
        settings: the knobs.
        field_name: a row of the table of fields.
        pose_seed: reset seed of the environment that draws the object's pose.
        method: the optimiser.
        start: number of the start, which seeds it.

    Returns:
        The piece of work.
    """
    env: Any = gym.make(CAGE, object=settings.object, disable_env_checker=True).unwrapped
    pose = env.reset(seed=pose_seed)[1]["pose"]
    spec = {
        "work": "posture",
        "object": settings.object,
        "pose": pose.tolist(),
        "pose_seed": pose_seed,
        "field": field_spec(field_name),
        "optimiser": method.spec(),
        "judge": settings.judge,
    }
    return Work(spec, start, f"{method.label}, {field_name}, pose {pose_seed}, start {start}")


def solve_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Optimise from one start and judge the result.

    Args:
        spec: from `make_work`.
        seed: of the start and of the search.
        context: threads.

    Returns:
        What `search_posture` returns.
    """
    return search_posture(ROBOT, spec, seed, context)


# --- table -------------------------------------------------------------------------------------


def make_rows(settings: Settings, by_case: Mapping[Any, Records]) -> list[dict[str, Any]]:
    """One row for each field, method and pose, and one for all poses together.

    Args:
        settings: the knobs.
        by_case: records of all starts by field, pose's seed and method.

    Returns:
        The rows.
    """
    rows = []
    for name in settings.fields:
        best = [best_judged(by_case[name, seed, settings.methods[0]]) for seed in settings.poses]
        for method in settings.methods:
            shown = [by_case[name, seed, method] for seed in settings.poses]
            whole = _row(
                [r for records in shown for r in records], np.repeat(best, settings.starts)
            )
            whole |= {"judged, best": None, "found, best": None}  # of no use across poses
            rows.append({"field": name, "pose": "all", "method": method.label, **whole})
        for seed, top in zip(settings.poses, best, strict=True):
            for method in settings.methods:
                records = by_case[name, seed, method]
                rows.append(
                    {"field": name, "pose": _place(records), "method": method.label}
                    | _row(records, np.full(len(records), top))
                )
    return rows


def _place(records: Records) -> str:
    """Where the object is."""
    x, y, _ = records[0]["spec"]["pose"]
    return f"({x:.2f}, {y:.2f})"


def _row(records: Records, best: np.ndarray) -> dict[str, Any]:
    """Cells of one row; `best` holds the yardstick of each record."""
    n = len(records)
    good = feasible_results(records)
    results = [record["result"] for record in records]
    near = sum(
        bool(result["feasible"] and result["judged"] >= CLOSE * top)
        for result, top in zip(results, best, strict=True)
    )
    return {
        "n": n,
        "feasible": f"{len(good)} of {n}",
        "enclosed": f"{sum(result['enclosed'] for result in results)} of {n}",
        "near the best": f"{near} of {n}",
        **search_columns(records),
    }


# --- figures -----------------------------------------------------------------------------------


def _draw(settings: Settings, by_case: Mapping[Any, Records], folder: Path) -> list[Path]:
    """Start and ends from one start, the best postures at each pose, and all values, of the first
    field.
    """
    name = settings.fields[0]
    yardstick = settings.methods[0]
    other = settings.methods[-1]
    drawings = (
        partial(posture_row, _example(settings, by_case), folder / "postures.png"),
        partial(
            posture_grid,
            [
                [_panel(winner(by_case[name, seed, m]), m.label) for seed in settings.poses]
                for m in (yardstick, other)
            ],
            folder / "best.png",
        ),
        partial(
            value_dots,
            {
                method.label: [
                    judged_values(by_case[name, seed, method]) for seed in settings.poses
                ]
                for method in settings.methods
            },
            ["object at\n" + _place(by_case[name, seed, yardstick]) for seed in settings.poses],
            folder / "values.png",
        ),
    )
    return [draw() for draw in drawings]


def _example(settings: Settings, by_case: Mapping[Any, Records]) -> Sequence[PosturePanel]:
    """The start from which one descent of SQP does best, and what both optimisers make of it."""
    name = settings.fields[0]
    yardstick = settings.methods[0]
    descent = settings.methods[1]
    chosen = winner([record for seed in settings.poses for record in by_case[name, seed, descent]])
    seed = chosen["spec"]["pose_seed"]
    start = chosen["seed"]
    shown = [
        _panel(by_case[name, seed, method][start], method.label) for method in (yardstick, descent)
    ]
    return [_panel(chosen, "start", "start"), *shown]


def _panel(record: Mapping[str, Any], label: str, what: str = "posture") -> PosturePanel:
    result = record["result"]
    spec = record["spec"]
    enclosed = result["enclosed"] if what == "posture" else None
    return PosturePanel(
        ROBOT, spec["object"], np.array(spec["pose"]), np.array(result[what]), label, enclosed
    )

"""Which postures enclose an object: CMA-ES and SQP on the static problem (paper, section 4.6).

Object poses near the base are drawn as the environment PlanarArmCage draws them. For each of them both
optimisers begin at the same random postures. What they find is judged by fast marching on a fine grid,
whatever field they optimised.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.figures import PosturePanel, posture_grid, posture_row, value_dots
from evaluation.jobs import Context, Work, run_recorded
from evaluation.tables import write_table
from piec_envs.escape.field import CAGING_SCALE, make_field
from planners import CagingProblem, CmaEsConfiguration, SqpConfiguration
from planners.configuration import draw_postures

CAGE = "piec_envs/PlanarArmCage-v0"
ROBOT = "planar_arm"
OPTIMISERS: Mapping[str, type] = {"cma-es": CmaEsConfiguration, "sqp": SqpConfiguration}
FIELD_OPTIONS = {"grid": {"resolution": 100, "method": "marching"}}  # finer than the default, which is exploited
CLOSE = 0.97  # of the best judged caging of CMA-ES at a pose
Records = list[dict[str, Any]]
NOTES = """\
n counts distinct executions, one for each random start; every row of a pose has the same starts. Values
are caging, 0.02 T_hat: "found" under the optimised field, "judged" by fast marching with 200 nodes a side,
best and median over starts, of postures that overlap by at most 1e-6 m ("feasible"). "Enclosed" counts
feasible postures that a hard wall (leak = 0) closes on the judging grid. "Near the best" counts postures
judged at least 97 % of the best one of CMA-ES, from whatever start, at that pose. Overlap: the largest of a feasible
posture, with the object or itself. Queries: postures at which the field was asked, gradients included,
mean over starts; seconds: median, one machine, not to be compared with others."""


@dataclass(frozen=True, eq=False)  # hashed by identity
class Method:
    """One optimiser with its arguments, and how tables call it."""

    label: str
    name: str
    options: Mapping[str, Any] = field(default_factory=dict)


METHODS = (Method("CMA-ES", "cma-es"), Method("SQP", "sqp"), Method("SQP, 5 restarts", "sqp", {"restarts": 5}))
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
    cases = [(name, seed, method) for name in settings.fields for seed in settings.poses for method in settings.methods]
    works = [make_work(settings, *case, start) for case in cases for start in range(settings.starts)]
    context = Context(folder=str(folder), progress=progress)
    records = run_recorded(solve_once, works, folder / "records.jsonl", jobs, context, "solving" if progress else "")
    by_case = {case: records[i * settings.starts : (i + 1) * settings.starts] for i, case in enumerate(cases)}
    tables = write_table(folder, make_rows(settings, by_case), "Postures that enclose an object", NOTES)
    return [*tables, *_draw(settings, by_case, folder)]


# --- one piece of work -------------------------------------------------------------------------


def make_work(settings: Settings, field_name: str, pose_seed: int, method: Method, start: int) -> Work:
    """One optimisation from one start."""
    env: Any = gym.make(CAGE, object=settings.object, disable_env_checker=True).unwrapped
    pose = env.reset(seed=pose_seed)[1]["pose"]
    optimiser = OPTIMISERS[method.name](**method.options)  # its defaults are filled in: a change of them counts
    spec = {
        "work": "posture",
        "object": settings.object,
        "pose": pose.tolist(),
        "pose_seed": pose_seed,
        "field": {"name": field_name, **FIELD_OPTIONS.get(field_name, {})},
        "optimiser": {"name": method.name, **dataclasses.asdict(optimiser)},
        "judge": settings.judge,
    }
    return Work(spec, start, f"{method.label}, {field_name}, pose {pose_seed}, start {start}")


def solve_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Optimise from one start and judge the result.

    Returns:
        What was found, how it is judged, and the seconds of the search alone.
    """
    options = dict(spec["optimiser"])
    optimiser = OPTIMISERS[options.pop("name")](**options)
    escape = make_field(robot_name=ROBOT, threads=context.threads, **spec["field"])
    problem = CagingProblem(ROBOT, spec["object"], spec["pose"], escape, threads=context.threads)
    start = draw_postures(problem, "uniform", 1, np.random.default_rng([spec["pose_seed"], seed]))
    problem.escape_time(start), problem.constraints(start), problem.measure(start)  # compiled before the clock starts
    begin = time.perf_counter()
    found = optimiser.solve(problem, seed, start[0])
    seconds = time.perf_counter() - begin
    judged, hard = (
        make_field("grid", ROBOT, resolution=spec["judge"], method="marching", **wall).query(
            problem.key_points, found.posture
        )
        for wall in ({}, {"speed": {"leak": 0.0}})
    )
    return {
        "start": start[0],
        "posture": found.posture,
        "feasible": found.feasible,
        "found": CAGING_SCALE * found.escape_time,
        "judged": CAGING_SCALE * float(judged.mean()),
        "enclosed": bool(np.isinf(hard).any() and found.feasible),
        "overlap": max(0.0, -found.object_distance, -found.self_distance),
        "object_distance": found.object_distance,
        "self_distance": found.self_distance,
        "queries": found.queries,
        "seconds": seconds,
    }


# --- table -------------------------------------------------------------------------------------


def make_rows(settings: Settings, by_case: Mapping[Any, Records]) -> list[dict[str, Any]]:
    """One row for each field, method and pose, and one for all poses together."""
    rows = []
    for name in settings.fields:
        best = [_best(by_case[name, seed, settings.methods[0]]) for seed in settings.poses]
        for method in settings.methods:
            shown = [by_case[name, seed, method] for seed in settings.poses]
            whole = _row([r for records in shown for r in records], np.repeat(best, settings.starts))
            whole |= {"judged, best": None, "found, best": None}  # of no use across poses
            rows.append({"field": name, "pose": "all", "method": method.label, **whole})
        for seed, top in zip(settings.poses, best, strict=True):
            for method in settings.methods:
                records = by_case[name, seed, method]
                rows.append({"field": name, "pose": _place(records), "method": method.label}
                            | _row(records, np.full(len(records), top)))  # fmt: skip
    return rows


def _place(records: Records) -> str:
    """Where the object is."""
    x, y, _ = records[0]["spec"]["pose"]
    return f"({x:.2f}, {y:.2f})"


def _feasible(records: Records) -> Records:
    return [record["result"] for record in records if record["result"]["feasible"]]


def _best(records: Records) -> float:
    """The largest judged caging of a feasible posture; NaN if there is none."""
    return max((result["judged"] for result in _feasible(records)), default=float("nan"))


def _row(records: Records, best: np.ndarray) -> dict[str, Any]:
    """Cells of one row; `best` holds the yardstick of each record."""
    n, good, results = len(records), _feasible(records), [record["result"] for record in records]
    near = sum(
        bool(result["feasible"] and result["judged"] >= CLOSE * top) for result, top in zip(results, best, strict=True)
    )
    over = [result["overlap"] for result in good]
    return {
        "n": n,
        "feasible": f"{len(good)} of {n}",
        "enclosed": f"{sum(result['enclosed'] for result in results)} of {n}",
        "near the best": f"{near} of {n}",
        "found, best": max((result["found"] for result in good), default=None),
        "found, median": float(np.median([result["found"] for result in good])) if good else None,
        "judged, best": max((result["judged"] for result in good), default=None),
        "judged, median": float(np.median([result["judged"] for result in good])) if good else None,
        "overlap, mm": 1e3 * max(over) if over else None,
        "queries": round(np.mean([result["queries"] for result in results])),
        "seconds": float(np.median([result["seconds"] for result in results])),
    }


# --- figures -----------------------------------------------------------------------------------


def _draw(settings: Settings, by_case: Mapping[Any, Records], folder: Path) -> list[Path]:
    """Start and ends from one start, the best postures at each pose, and all values, of the first field."""
    name, yardstick, other = settings.fields[0], settings.methods[0], settings.methods[-1]
    drawings = (
        partial(posture_row, _example(settings, by_case), folder / "postures.png"),
        partial(
            posture_grid,
            [[_panel(_winner(by_case[name, seed, m]), m.label) for seed in settings.poses] for m in (yardstick, other)],
            folder / "best.png",
        ),
        partial(
            value_dots,
            {
                method.label: [_values(by_case[name, seed, method]) for seed in settings.poses]
                for method in settings.methods
            },
            [_place(by_case[name, seed, yardstick]) for seed in settings.poses],
            folder / "values.png",
        ),
    )
    return [draw() for draw in drawings]


def _values(records: Records) -> np.ndarray:
    """Judged caging of feasible postures and whether they enclose, shape (m, 2)."""
    return np.array([(r["judged"], float(r["enclosed"])) for r in _feasible(records)], dtype=float).reshape(-1, 2)


def _winner(records: Records) -> dict[str, Any]:
    """The record with the largest judged caging, enclosing before others, feasible before all."""
    return max(records, key=lambda r: (r["result"]["feasible"], r["result"]["enclosed"], r["result"]["judged"]))


def _example(settings: Settings, by_case: Mapping[Any, Records]) -> Sequence[PosturePanel]:
    """The start from which one descent of SQP does best, and what both optimisers make of it."""
    name, yardstick, descent = settings.fields[0], settings.methods[0], settings.methods[1]
    chosen = _winner([record for seed in settings.poses for record in by_case[name, seed, descent]])
    seed, start = chosen["spec"]["pose_seed"], chosen["seed"]
    shown = [_panel(by_case[name, seed, method][start], method.label) for method in (yardstick, descent)]
    return [_panel(chosen, "start", "start"), *shown]


def _panel(record: Mapping[str, Any], label: str, what: str = "posture") -> PosturePanel:
    result, spec = record["result"], record["spec"]
    enclosed = result["enclosed"] and what == "posture"
    return PosturePanel(ROBOT, spec["object"], np.array(spec["pose"]), np.array(result[what]), label, enclosed)

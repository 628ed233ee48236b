"""What the studies of static caging share: one search from one start, judged by a fine grid, and
its records.
"""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evaluation.jobs import Context
from piec_envs import CAGING_SCALE, make_field
from planners import CagingProblem, CmaEsConfiguration, ExhaustiveConfiguration, SqpConfiguration
from planners.posture_starts import draw_postures

OPTIMISERS: Mapping[str, type] = {
    "cma-es": CmaEsConfiguration,
    "sqp": SqpConfiguration,
    "exhaustive": ExhaustiveConfiguration,
}
# finer than the default, which is exploited
FIELD_OPTIONS = {"grid": {"resolution": 100, "method": "marching"}}
Records = Sequence[Mapping[str, Any]]


@dataclass(frozen=True, eq=False)  # hashed by identity
class Method:
    """One optimiser with its arguments, and how tables call it.

    Args:
        label: what tables call it.
        name: a key of OPTIMISERS.
        options: its arguments, where they are not the defaults.
    """

    label: str
    name: str
    options: Mapping[str, Any] = field(default_factory=dict)

    def spec(self) -> dict[str, Any]:
        """The optimiser as JSON values; its defaults are filled in, so that a change of them
        counts.
        """
        return {"name": self.name, **dataclasses.asdict(OPTIMISERS[self.name](**self.options))}


def field_spec(name: str) -> dict[str, Any]:
    """The field of that name, as searches are given it."""
    return {"name": name, **FIELD_OPTIONS.get(name, {})}


def search_posture(
    robot_name: str, spec: Mapping[str, Any], seed: int, context: Context
) -> dict[str, Any]:
    """Optimise from one start and judge the result.

    Args:
        robot_name: row of the table of robots.
        spec: object, pose, pose_seed, field, optimiser, and judge (nodes a side of the judging
            grid).
        seed: of the start and of the search.
        context: threads.

    Returns:
        What was found, how it is judged, and the seconds of the search alone.
    """
    options = dict(spec["optimiser"])
    optimiser = OPTIMISERS[options.pop("name")](**options)
    escape = make_field(robot_name=robot_name, threads=context.threads, **spec["field"])
    problem = CagingProblem(
        robot_name, spec["object"], spec["pose"], escape, threads=context.threads
    )
    start = draw_postures(problem, "uniform", 1, np.random.default_rng([spec["pose_seed"], seed]))
    # compiled before the clock starts
    problem.escape_time(start), problem.constraints(start), problem.measure(start)
    begin = time.perf_counter()
    found = optimiser.solve(problem, seed, start[0])
    seconds = time.perf_counter() - begin
    judged, hard = (
        make_field("grid", robot_name, resolution=spec["judge"], method="marching", **wall).query(
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
        "key_points": {"T": judged, "enclosed": np.isinf(hard).tolist()},
        "overlap": max(0.0, -found.object_distance, -found.self_distance),
        "object_distance": found.object_distance,
        "self_distance": found.self_distance,
        "queries": found.queries,
        "seconds": seconds,
    }


def feasible_results(records: Records) -> list[Mapping[str, Any]]:
    """The results whose postures keep all constraints."""
    return [record["result"] for record in records if record["result"]["feasible"]]


def best_judged(records: Records) -> float:
    """The largest judged caging of a feasible posture; NaN if there is none."""
    return max((result["judged"] for result in feasible_results(records)), default=float("nan"))


def winner(records: Records) -> Mapping[str, Any]:
    """The record with the largest judged caging, enclosing before others, feasible before all."""
    return max(
        records,
        key=lambda r: (r["result"]["feasible"], r["result"]["enclosed"], r["result"]["judged"]),
    )


def search_columns(records: Records) -> dict[str, Any]:
    """What searches found and what it cost, as cells of a table."""
    n = len(records)
    good = feasible_results(records)
    results = [record["result"] for record in records]
    over = [result["overlap"] for result in good]
    return {
        "found, best": max((result["found"] for result in good), default=None),
        "found, median": float(np.median([result["found"] for result in good])) if good else None,
        "judged, best": max((result["judged"] for result in good), default=None),
        "judged, median": float(np.median([result["judged"] for result in good])) if good else None,
        "overlap, mm": 1e3 * max(over) if over else None,
        "queries": round(sum(result["queries"] for result in results) / n),
        "seconds": float(np.median([result["seconds"] for result in results])),
    }


def judged_values(records: Records) -> np.ndarray:
    """Judged caging of feasible postures and whether they enclose, shape (m, 2), for figures."""
    values = [(r["judged"], float(r["enclosed"])) for r in feasible_results(records)]
    return np.array(values, dtype=float).reshape(-1, 2)

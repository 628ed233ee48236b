"""How the escape time of a posture grows with the radius of the workspace, which the paper does not
give (Table 1).

Beyond the reach of the arm an object flees at u_bar, whatever the posture, so that another metre of
workspace is another 1 / u_bar seconds, for T and T_0 alike.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.jobs import Context, Work, run_recorded
from evaluation.tables import write_table
from piec_envs import CAGING_SCALE, SpeedModel, get_object, get_robot, key_points_world, make_field

# Table 1: mean, min
PAPER = {"water_jug": (0.95, 0.95), "box": (0.93, 0.84), "paper_pack": (0.80, 0.66)}
RISE = CAGING_SCALE / SpeedModel().u_bar  # of the caging with the radius, 1/m
NOTES = """\
The best postures of CMA-ES judged by fast marching in larger workspaces, with nodes as dense as in
the robot's own. Caging, 0.02 T, mean and least over key points; rise: of the mean since the row
above, for a metre. T - T_0, in seconds, is what the arm adds. Of the three objects' means the
paper's are {paper:.3g} on average, ours {ours:.3g} in a workspace of {own:g} m: at {rise:.3g} for a
metre the radius for the paper's average is {radius:.3g} m."""


def least_times(record: Mapping[str, Any], radius: float | None = None) -> np.ndarray:
    """T_0 at the key points of a record's object, shape (k,), s.

    Args:
        record: of a search.
        radius: of the workspace, m; None takes the robot's.

    Returns:
        (R - |p|) / u_bar, shape (k,), s.
    """
    return (
        (radius or own_radius(record)) - np.hypot(*_key_points(record["spec"]).T)
    ) / SpeedModel().u_bar


def own_radius(record: Mapping[str, Any]) -> float:
    """The radius of the workspace of a record's robot, m."""
    return get_robot(record["spec"]["robot"]).workspace_radius


def mean_caging(record: Mapping[str, Any]) -> float:
    """Caging of a record's posture, mean over key points."""
    return CAGING_SCALE * float(np.mean(record["result"]["key_points"]["T"]))


def radius_for(record: Mapping[str, Any], caging: float) -> float:
    """The radius of the workspace at which a record's posture would have some mean caging.

    Args:
        record: of a search.
        caging: the mean over key points.

    Returns:
        The radius, m, if caging rises as in free space.
    """
    return own_radius(record) + (caging - mean_caging(record)) / RISE


def write_radii(
    radii: Sequence[float], judge: int, best: Mapping[str, Any], folder: Path, jobs: Any = 1
) -> list[Path]:
    """Judge postures in workspaces of other radii and write the table `radius`.

    Args:
        radii: of the workspaces, m.
        judge: nodes a side of the grid over the robot's own workspace.
        best: the record of each object's posture.
        folder: of table and records.
        jobs: workers, or an executor.

    Returns:
        The files written.
    """
    works = [_work(record, radius, judge) for record in best.values() for radius in radii]
    records = run_recorded(
        solve_once, works, folder / "records.jsonl", jobs, Context(folder=str(folder))
    )
    rows = radius_rows(best, radii, [record["result"]["T"] for record in records])
    printed = [name for name in best if name in PAPER]
    paper = float(np.mean([PAPER[name][0] for name in printed]))
    ours = float(np.mean([mean_caging(best[name]) for name in printed]))
    radius = float(np.mean([radius_for(best[name], PAPER[name][0]) for name in printed]))
    own = own_radius(next(iter(best.values())))
    notes = NOTES.format(paper=paper, ours=ours, own=own, rise=RISE, radius=radius)
    return write_table(folder, rows, "The same in larger workspaces", notes, "radius")


def _work(record: Mapping[str, Any], radius: float, judge: int) -> Work:
    spec = record["spec"]
    kept = {name: spec[name] for name in ("robot", "geometry_source", "object", "pose")}
    resolution = round(judge * radius / own_radius(record))
    posture = np.asarray(record["result"]["posture"]).tolist()
    return Work(
        {"work": "radius", **kept, "posture": posture, "radius": radius, "resolution": resolution}
    )


def solve_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Escape times of the key points of one posture in a workspace; nothing is drawn.

    Args:
        spec: robot, object, pose, posture, radius (m), and resolution (nodes a side).
        seed: not needed.
        context: threads.

    Returns:
        "T", shape (k,), s.
    """
    options = {"resolution": spec["resolution"], "radius": spec["radius"], "method": "marching"}
    escape = make_field("grid", spec["robot"], threads=context.threads, **options)
    return {"T": escape.query(_key_points(spec), np.array(spec["posture"]))}


def _key_points(spec: Mapping[str, Any]) -> np.ndarray:
    """Key points of a spec's object in the world, shape (k, 2), m."""
    return key_points_world(get_object(spec["object"]).key_points, np.array(spec["pose"]))


def radius_rows(
    best: Mapping[str, Any], radii: Sequence[float], times: Sequence[Any]
) -> list[dict[str, Any]]:
    """One row for each object and radius.

    Args:
        best: the record of each object's posture.
        radii: of the workspaces, m.
        times: T at the key points, s, for each object and radius.

    Returns:
        The rows.
    """
    rows = []
    answers = iter(times)
    for name, record in best.items():
        last: tuple[float, float] | None = None
        for radius in radii:
            T = np.array(next(answers))
            caging = CAGING_SCALE * float(T.mean())
            rise = None if last is None else (caging - last[1]) / (radius - last[0])
            last = radius, caging
            rows.append(
                {
                    "object": name,
                    "n": 1,
                    "radius, m": radius,
                    "mean": caging,
                    "least": CAGING_SCALE * float(T.min()),
                    "rise, 1/m": rise,
                    "T - T_0, s": float((T - least_times(record, radius)).mean()),
                    "paper: mean": PAPER.get(name, (None, None))[0],
                    "paper: least": PAPER.get(name, (None, None))[1],
                }
            )
    return rows

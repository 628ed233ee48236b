"""`piec bench --soak`: many random steps over all ids, dynamics and objects, and what went wrong in
them.

The work is cut into cells, one for each id, dynamics, object and preset. A record is written after
each cell, and a run goes on where the record of the same work ends.
"""

from __future__ import annotations

import json
import os
import platform
import resource
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

from evaluation.records import to_json
from evaluation.tables import markdown, write_atomic
from piec_envs import (
    ALLOWED_PENETRATION,
    DYNAMICS,
    ENVS,
    MOTIONS,
    OBJECTS,
    MissingDependencyError,
    Robot,
    available_threads,
    console,
    object_distances,
    provenance,
)

SHARES = {"mujoco": 0.03, "static": 0.0005}  # of the steps; the quasi-dynamic model has the rest
ROWS = {"quasi_dynamic": 256, "mujoco": 32, "static": 8}
PRESETS = {"quasi_dynamic": ("default", "paper"), "mujoco": ("default",), "static": ("default",)}
COUNTS = ("steps", "episodes", "contact", "diverged", "not finite", "outside")
HOLD = 50  # steps that a random action lasts
PLANT = {"friction": [0.1, 1.0], "disturbance": [0.0, 0.01]}  # drawn for each episode
NEAR = (0.015, 0.04)  # m, from arm to object at the start
ROAM = 0.8  # m, of the base from the object at the start
RIGID = [name for name, item in OBJECTS.items() if not item.loose]


@dataclass(frozen=True)
class Cell:
    """A part of the work.

    Args:
        env_id: id of the environment.
        dynamics: a row of the table of dynamics, or "static" where nothing moves.
        object: a row of the table of objects.
        preset: of weights and contact model.
        steps: of all rows together, at least.
    """

    env_id: str
    dynamics: str
    object: str
    preset: str
    steps: int


def make_cells(steps: int) -> list[Cell]:
    """All cells of a run of so many steps."""
    parts = [(name, kind) for kind in DYNAMICS for name in MOTIONS]
    parts += [(name, "static") for name in ENVS if name not in MOTIONS]
    rows = [
        (name, kind, item, preset)
        for name, kind in parts
        for item in (OBJECTS if kind == "mujoco" else RIGID)
        for preset in PRESETS[kind]
    ]
    share = {**SHARES, "quasi_dynamic": 1.0 - sum(SHARES.values())}
    number = {kind: sum(row[1] == kind for row in rows) for kind in share}
    return [Cell(*row, steps=max(1, round(steps * share[row[1]] / number[row[1]]))) for row in rows]


def run_cell(cell: Cell, seed: int) -> dict[str, Any]:
    """Step one cell with random actions.

    Args:
        cell: what is stepped.
        seed: of all randomness.

    Returns:
        The cell, its counts by COUNTS, its worst penetrations, m, its seconds, and the memory of
        this process, MB.
    """
    moving = cell.dynamics != "static"
    rows = min(ROWS[cell.dynamics], cell.steps)
    found = dict.fromkeys(COUNTS, 0)
    worst = {"penetration": 0.0, "start": 0.0}
    rng = np.random.default_rng(seed)
    envs: Any = _make_envs(cell, rows, rng)
    began = time.perf_counter()
    overlap = _penetration(envs.reset(seed=seed)[1], rows)  # of each episode's start
    while found["steps"] < cell.steps:
        if found["steps"] % (HOLD * rows) == 0 or not moving:
            action = rng.uniform(-1.0, 1.0, envs.action_space.shape)
        observation, reward, _, truncated, info = envs.step(action)
        depth = _penetration(info, rows)
        if moving:
            fresh = envs.unwrapped.get_state().step == 0
            overlap = np.where(fresh, depth, overlap)
            clear = ~fresh & (overlap <= ALLOWED_PENETRATION)
            worst["penetration"] = max(worst["penetration"], float(depth[clear].max(initial=0.0)))
            worst["start"] = max(worst["start"], float(overlap.max()))
            found["contact"] += int(np.count_nonzero(info["contact_links"].any(axis=1)))
            found["diverged"] += int(np.count_nonzero(info["diverged"]))
        found["steps"] += rows
        found["episodes"] += int(np.count_nonzero(truncated)) if moving else rows
        found["not finite"] += int(np.count_nonzero(~np.isfinite(reward)))
        found["outside"] += not envs.observation_space.contains(observation)
    envs.close()
    seconds = time.perf_counter() - began
    return {**asdict(cell), **found, **worst, "seconds": seconds, "memory": resident_memory()}


def _make_envs(cell: Cell, rows: int, rng: np.random.Generator) -> Any:
    """The environments of a cell, whose arm starts beside the object; capsules where there are no
    meshes.
    """
    kwargs: dict[str, Any] = {"object": cell.object}
    if cell.dynamics == "static":
        return _make(cell, rows, kwargs)
    kwargs |= {"dynamics": cell.dynamics, "preset": cell.preset, "randomize": PLANT}
    kwargs |= {"start_noise": (0.01, 0.05), "escape_field": None, "prior": "contact"}
    model = _make(cell, rows, kwargs).unwrapped.model
    return _make(
        cell, rows, {**kwargs, "start": _beside(model.robot, cell.object, model.task.start, rng)}
    )


def _make(cell: Cell, rows: int, kwargs: dict[str, Any]) -> Any:
    try:
        return gym.make_vec(cell.env_id, num_envs=rows, **kwargs)
    except MissingDependencyError:
        return gym.make_vec(cell.env_id, num_envs=rows, geometry="capsules", **kwargs)


def _beside(
    robot: Robot, object_name: str, pose: np.ndarray, rng: np.random.Generator
) -> list[float]:
    """A random posture in which the arm is near the object and clear of it."""
    low = robot.joint_array("lower").copy()
    high = robot.joint_array("upper").copy()
    low[: robot.base_dof] = pose[: robot.base_dof] - ROAM
    high[: robot.base_dof] = pose[: robot.base_dof] + ROAM
    while True:
        q = rng.uniform(low, high)
        nearest = object_distances(robot.name, object_name, q, pose).min()
        if NEAR[0] < nearest < NEAR[1]:
            return q.tolist()


def _penetration(info: dict[str, Any], rows: int) -> np.ndarray:
    return np.asarray(info["penetration"], dtype=float) if "penetration" in info else np.zeros(rows)


def resident_memory() -> float:
    """Memory of this process, MB: present where the system tells it, else its peak."""
    try:
        pages = int(Path("/proc/self/statm").read_text().split()[1])
        return pages * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3


def run_soak(steps: int, out: Path, seed: int = 0, progress: bool = True) -> dict[str, Any]:
    """Run all cells that the record does not hold yet.

    Args:
        steps: in all.
        out: the record, JSON; a table stands beside it.
        seed: of actions and episodes.
        progress: whether to show a progress bar.

    Returns:
        The record: "rows" (one for each cell), "summary", "steps", "seed", "machine", "versions"
        and "source".
    """
    cells = make_cells(steps)
    done = _recorded(out, steps, seed)
    for number, cell in enumerate(tqdm(cells, disable=console.no_bar(progress), desc="soak")):
        if number < len(done):
            continue
        done.append({**run_cell(cell, seed + number), "process": os.getpid()})
        write_record(done, steps, seed, out)
    return write_record(done, steps, seed, out)


def _recorded(out: Path, steps: int, seed: int) -> list[dict[str, Any]]:
    """Rows of an unfinished record of the same work by the same sources and versions."""
    if not out.is_file():
        return []
    record = json.loads(out.read_text())
    wanted = {
        "steps": steps,
        "seed": seed,
        "versions": provenance.versions(),
        "source": provenance.source(),
    }
    same = all(record.get(name) == to_json(value) for name, value in wanted.items())
    return record["rows"] if same and not record["summary"]["complete"] else []


def summarise(rows: list[dict[str, Any]], steps: int) -> dict[str, Any]:
    """Totals and worst figures of a run.

    Args:
        rows: from `run_cell`, each with its process.
        steps: asked for, of all cells together.

    Returns:
        The figures by name, with the memory of the last row's process midway and at its end, MB.
    """
    totals = {name: sum(row[name] for row in rows) for name in COUNTS}
    depths = {
        f"penetration, {kind}": max(
            (row["penetration"] for row in rows if row["dynamics"] == kind), default=0.0
        )
        for kind in DYNAMICS
    }
    memory = [row["memory"] for row in rows if row["process"] == rows[-1]["process"]]
    return {
        **totals,
        **depths,
        "seconds": sum(row["seconds"] for row in rows),
        "memory, midway": memory[len(memory) // 2],
        "memory, end": memory[-1],
        "complete": len(rows) == len(make_cells(steps)),
    }


def write_record(rows: list[dict[str, Any]], steps: int, seed: int, out: Path) -> dict[str, Any]:
    """Write the record of a run and its table.

    Args:
        rows: from `run_cell`, each with its process.
        steps: asked for, of all cells together.
        seed: of the run.
        out: the record's JSON file; the table stands beside it as .md.

    Returns:
        The record.
    """
    machine = {
        "cores": available_threads(),
        "system": platform.system(),
        "architecture": platform.machine(),
    }
    summary = summarise(rows, steps)
    made_by = {"machine": machine, "versions": provenance.versions(), "source": provenance.source()}
    record = {"rows": rows, "summary": summary, "steps": steps, "seed": seed, **made_by}
    write_atomic(out, json.dumps(to_json(record), indent=1, allow_nan=False) + "\n")
    table = markdown([{"figure": name, "value": value} for name, value in summary.items()])
    cells = markdown(
        [{name: row[name] for name in row if name not in ("process", "memory")} for row in rows]
    )
    text = (
        f"# Soak\n\n`piec bench --soak {steps}`: random actions, each held for {HOLD} "
        f"steps.\n\n{table}\n\n{cells}\n"
    )
    write_atomic(out.with_suffix(".md"), text)
    return record

"""Where the moving Franka begins: static problems with the base free or fixed (paper, section 7.2).

For each base, geometry and choice of parts that can touch the object, the best posture by
exhaustive search: "cage" maximises T_hat of those parts. For the whole arm, "open" maximises it
with elbow and wrist at right angles, so that the arm touches the object and does not close around
it. No part of the arm may overlap the object, whether it can touch it or not. A base that slides
leaves the heading free: it is chosen so that the base stands opposite to the goal. The package
ships what the study finds as its table of start postures.
"""

from __future__ import annotations

import itertools
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import PosturePanel, posture_row
from evaluation.jobs import Context, Work, run_recorded
from evaluation.tables import write_atomic, write_table
from piec_envs import (
    CAGING_SCALE,
    FRANKA_BASES,
    FRANKA_CONTACTS,
    FRANKA_GEOMETRIES,
    Task,
    franka_name,
    get_robot,
    get_task,
    make_field,
)
from planners import CagingProblem, ExhaustiveConfiguration
from planners.exhaustive import outer_postures

TASKS: Mapping[str, Task] = {  # by base
    "mobile": get_task("mobile_franka_push"),
    "fixed": get_task("franka_push"),
}
KINDS = {"whole_arm": ("cage", "open")}  # of starts; others have a cage alone
RIGHT_ANGLES = (-np.pi / 2, np.pi / 2)  # q4, q6 of "open"
CLEARANCE = 1e-3  # m, between arm and object
DECIMALS = 6  # of the postures that ship
NOTES = """\
n counts distinct executions: the search is exhaustive and draws nothing but in its polish. Caging,
0.02 T_hat, of the parts that can touch the object, under the table field that is optimised; "free"
is that of the same place without an arm. Distance: the nearest part of the whole arm to the object.
Base (m) and joints (rad) as they ship."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        bases: "mobile", "fixed".
        contacts: which parts touch the object.
        geometries: "meshes", "capsules".
        search: arguments of `ExhaustiveConfiguration`, by base.
        table: arguments of the table field.
    """

    bases: tuple[str, ...] = tuple(reversed(FRANKA_BASES))
    contacts: tuple[str, ...] = tuple(FRANKA_CONTACTS)
    geometries: tuple[str, ...] = tuple(FRANKA_GEOMETRIES)
    search: Mapping[str, Mapping[str, Any]] = field(
        default_factory=lambda: {
            "mobile": {"headings": 1, "spacing": 0.1, "offset": 0.04},
            "fixed": {"headings": 90, "spacing": 0.1},
        }
    )
    table: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        tiny = {"spacing": 0.8, "polished": 1, "population": 4, "iterations": 2}
        search = {"mobile": {"headings": 1, "offset": 0.1, **tiny}}
        return cls(
            ("mobile",), ("whole_arm",), ("capsules",), search, {"resolution": 49, "spacing": 0.3}
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-starts.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    folder = Path(out_dir)
    words = list(itertools.product(settings.bases, settings.geometries, settings.contacts))
    works = [
        make_work(settings, *row, kind) for row in words for kind in KINDS.get(row[2], ("cage",))
    ]
    context = Context(folder=str(folder), progress=progress)
    records = run_recorded(
        solve_once, works, folder / "records.jsonl", jobs, context, "solving" if progress else ""
    )
    starts: dict[str, dict[str, list[float]]] = {}
    for record in records:
        starts.setdefault(record["spec"]["robot"], {})[record["spec"]["kind"]] = record["result"][
            "posture"
        ]
    return [
        write_atomic(folder / "starts.json", json.dumps(starts, indent=1) + "\n"),
        *write_table(
            folder, [_row(record) for record in records], "Where the moving Franka begins", NOTES
        ),
        *_draw(records, folder),
    ]


def make_work(settings: Settings, base: str, geometry: str, contact: str, kind: str) -> Work:
    """One static problem.

    Args:
        settings: the knobs.
        base, geometry, contact: words as in `franka`.
        kind: "cage" for the best posture, "open" for the best with elbow and wrist at right angles.

    Returns:
        The piece of work.
    """
    task = TASKS[base]
    robot = franka_name(base, contact, geometry)
    spec = {
        "work": "start",
        "robot": robot,
        "object": task.object,
        "pose": task.start.tolist(),
        "goal": task.goal.tolist(),
        "kind": kind,
        "search": dict(settings.search[base]),
        "table": dict(settings.table),
    }
    return Work(spec, 0, f"{robot}, {kind}")


def solve_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Solve one static problem and turn the arm towards the goal.

    Args:
        spec: from `make_work`.
        seed: of the search.
        context: threads.

    Returns:
        The posture, its caging, that of the place alone, and the arm's distance to the object, m.
    """
    robot = get_robot(spec["robot"])
    escape = make_field("table", robot.name, **spec["table"])
    problem = CagingProblem(
        robot.whole_name,
        spec["object"],
        spec["pose"],
        escape,
        clearance=CLEARANCE,
        threads=context.threads,
    )
    search = ExhaustiveConfiguration(**spec["search"])
    found = (
        search.solve(problem, seed).posture if spec["kind"] == "cage" else _open(problem, search)
    )
    if robot.base_dof:
        found = turned(found, problem.pose[:2], np.array(spec["goal"]))
    posture = np.round(found, DECIMALS)
    judged = problem.measure(posture[None])
    base = posture[: robot.base_dof] if robot.base_dof else np.zeros(2)
    # (k,)
    free = (robot.workspace_radius - np.hypot(*(problem.key_points - base).T)) / escape.u_bar
    return {
        "posture": posture.tolist(),
        "caging": CAGING_SCALE * float(judged.escape_time[0]),
        "free": CAGING_SCALE * float(free.mean()),
        "distance": CLEARANCE + float(judged.phi[0, : problem.object_rows].min()),
    }


def _open(problem: CagingProblem, search: ExhaustiveConfiguration) -> np.ndarray:
    """The best place of the base and heading with elbow and wrist at right angles, shape (n,)."""
    outer = outer_postures(problem, search.headings, search.offset / 4)
    q = np.column_stack([outer, np.tile(RIGHT_ANGLES, (len(outer), 1))])
    judged = problem.measure(q)
    return q[int(np.argmax(np.where(judged.feasible, judged.escape_time, -np.inf)))]


def turned(q: np.ndarray, place: np.ndarray, goal: np.ndarray) -> np.ndarray:
    """The arm turned about a round object until its base stands opposite to the goal.

    Args:
        q: base x, y, and joints, shape (n,).
        place: of the object, shape (2,), m.
        goal: shape (2,), m.

    Returns:
        Shape (n,); the distance to the object and its escape time are those of `q`.
    """
    behind = place - q[:2]
    angle = np.arctan2(*(goal - place)[::-1]) - np.arctan2(*behind[::-1])
    heading = (q[2] + angle + np.pi) % (2 * np.pi) - np.pi
    c = np.cos(angle)
    s = np.sin(angle)
    base = place - np.array([c * behind[0] - s * behind[1], s * behind[0] + c * behind[1]])
    return np.concatenate([base, [heading], q[3:]])


def _row(record: Mapping[str, Any]) -> dict[str, Any]:
    spec = record["spec"]
    result = record["result"]
    return {
        "robot": spec["robot"],
        "object": spec["object"],
        "start": spec["kind"],
        "n": 1,
        "caging": result["caging"],
        "free": result["free"],
        "distance, mm": 1e3 * result["distance"],
        "posture": ", ".join(f"{value:.3f}" for value in result["posture"]),
    }


def _draw(records: Sequence[Mapping[str, Any]], folder: Path) -> list[Path]:
    """The postures of each base, with the geometry that comes first."""
    files = []
    for base in dict.fromkeys(get_robot(record["spec"]["robot"]).base_dof for record in records):
        name = "mobile" if base else "fixed"
        rows = [r for r in records if get_robot(r["spec"]["robot"]).base_dof == base]
        source = get_robot(rows[0]["spec"]["robot"]).geometry_source
        shown = [_panel(r) for r in rows if get_robot(r["spec"]["robot"]).geometry_source == source]
        files.append(posture_row(shown, folder / f"{name}.png"))
    return files


def _panel(record: Mapping[str, Any]) -> PosturePanel:
    spec = record["spec"]
    pose = np.array(spec["pose"])
    q = np.array(record["result"]["posture"])
    return PosturePanel(
        spec["robot"], spec["object"], pose, q, f"{spec['robot']}, {spec['kind']}".replace("_", " ")
    )

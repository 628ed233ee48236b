"""How well a Franka Panda encloses everyday objects with its whole arm (paper, section 7.1, Table
1).

Three objects lie at the paper's place in front of a fixed base. CMA-ES begins at random postures,
and an exhaustive search says what the best posture is. What they find is judged by fast marching on
a fine grid, whatever field they optimised.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures import PosturePanel, posture_grid, posture_scenes, value_dots
from evaluation.jobs import Context, Work, run_recorded
from evaluation.studies.franka_caging_rows import CLOSE, object_rows, point_rows, search_rows
from evaluation.studies.posture_work import (
    Method,
    Records,
    field_spec,
    judged_values,
    search_posture,
    winner,
)
from evaluation.studies.workspace_radius import PAPER, write_radii
from evaluation.tables import write_table
from piec_envs import get_robot

ROBOT = "franka"
EXHAUSTIVE = Method("exhaustive", "exhaustive")
METHODS = {
    "grid": (Method("CMA-ES", "cma-es"),),
    "network": (Method("CMA-ES", "cma-es"),),
    "table": (Method("CMA-ES", "cma-es"), Method("CMA-ES, 4 restarts", "cma-es", {"restarts": 4})),
}
SMOKE_METHODS = {"network": (Method("CMA-ES", "cma-es", {"population": 10, "iterations": 3}),)}
SMOKE_EXHAUSTIVE = Method(
    "exhaustive",
    "exhaustive",
    {"spacing": 0.8, "headings": 12, "polished": 1, "population": 4, "iterations": 2},
)
NOTES = """\
Caging, 0.02 T, at the key points of each object, mean (T_hat) and least; T / T_0 divides T_hat by
that of an object without a robot. Best posture of n searches of CMA-ES, from all starts and on all
fields, and that of the exhaustive search, both judged by fast marching on a fine grid (`judge`); T
- T_0 in seconds. The paper does not give the radius of its workspace, and caging grows by 0.02 /
u_bar = 0.4 with every metre of it (table `radius`), so that its values (last columns) cannot be
compared with ours; T - T_0 alone does not depend on it. Nor is the order the same: the paper's box
is caged better than its pack, ours less. "Radius": at which the posture of CMA-ES would have the
paper's mean."""
POINT_NOTES = """\
Every key point of the same postures, judged in the same way: T in seconds, less T_0, the time
without a robot, and over it. Enclosed: under the hard wall (leak = 0) nothing leads out. "Share" is
T over that of the exhaustive search's posture at the same key point."""
SEARCH_NOTES = f"""\
n counts distinct executions, one for each random start; all rows of an object have the same starts.
Caging, 0.02 T_hat: "found" under the optimised field, "judged" by fast marching on a fine grid,
best and median over starts, of postures that overlap by at most 1e-6 m ("feasible"). "Reached"
counts feasible postures judged at least {100 * CLOSE:g} % of that of the exhaustive search.
Overlap: the largest of a feasible posture, of the planar shapes of links with each other or with
the object; links next to each other at a joint are not compared. Limits are kept by construction.
Queries: postures at which the field was asked, mean over starts; the exhaustive search asks once
for all headings of an inner posture. Seconds: median, one machine, not to be compared with
others."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objects: rows of the table of objects.
        pose: x, y, angle of each, m and rad.
        methods: searches to compare, by the escape field that they optimise.
        exhaustive: the search that says what can be reached.
        exhaustive_field: the field that it optimises.
        starts: random starts of every other search.
        judge: nodes a side of the judging grid.
        radii: of the workspace, at which the best postures are judged as well, m.
    """

    objects: tuple[str, ...] = tuple(PAPER)
    pose: tuple[float, float, float] = (0.3, 0.1, 0.0)
    methods: Mapping[str, tuple[Method, ...]] = field(default_factory=lambda: METHODS)
    exhaustive: Method = EXHAUSTIVE
    exhaustive_field: str = "grid"
    starts: int = 10
    judge: int = 200
    radii: tuple[float, ...] = (1.0, 1.5, 2.0, 2.25, 2.5)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            objects=("paper_pack",),
            methods=SMOKE_METHODS,
            exhaustive=SMOKE_EXHAUSTIVE,
            exhaustive_field="network",
            starts=2,
            judge=48,
            radii=(1.0, 2.25),
        )

    @property
    def cases(self) -> list[tuple[str, str, Method]]:
        """Object, field and method of every search but the exhaustive one."""
        return [
            (item, name, method)
            for item in self.objects
            for name in self.methods
            for method in self.methods[name]
        ]


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-caging.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    folder = Path(out_dir)
    starts = settings.starts
    works = [
        make_work(settings, *case, start) for case in settings.cases for start in range(starts)
    ]
    works += [
        make_work(settings, item, settings.exhaustive_field, settings.exhaustive, 0)
        for item in settings.objects
    ]
    context = Context(folder=str(folder), progress=progress)
    records = run_recorded(
        search_once, works, folder / "records.jsonl", jobs, context, "searching" if progress else ""
    )
    by_case = {
        case: records[i * starts : (i + 1) * starts] for i, case in enumerate(settings.cases)
    }
    yardstick = dict(zip(settings.objects, records[len(by_case) * starts :], strict=True))
    by_object = {
        item: [r for case, found in by_case.items() if case[0] == item for r in found]
        for item in settings.objects
    }
    best = {item: winner(found) for item, found in by_object.items()}
    counts = {item: len(found) for item, found in by_object.items()}
    return [
        *write_table(
            folder,
            object_rows(best, yardstick, counts),
            "Everyday objects in the arm of a Franka",
            NOTES,
        ),
        *write_table(
            folder, point_rows(best, yardstick), "The same by key point", POINT_NOTES, "key-points"
        ),
        *write_table(folder, search_rows(by_case, yardstick), "Searches", SEARCH_NOTES, "searches"),
        *write_radii(settings.radii, settings.judge, best, folder, jobs),
        *_draw(settings, by_case, best, yardstick, folder),
    ]


def make_work(
    settings: Settings, object_name: str, field_name: str, method: Method, start: int
) -> Work:
    """One search from one start.

    Args:
        settings: the knobs.
        object_name: row of the table of objects.
        field_name: row of the table of fields, which is optimised.
        method: the search.
        start: number of the start, which seeds it.

    Returns:
        The piece of work.
    """
    spec = {
        "work": "posture",
        "robot": ROBOT,
        "geometry_source": get_robot(ROBOT).geometry_source,
        "object": object_name,
        "pose": list(settings.pose),
        "pose_seed": 0,
        "field": field_spec(field_name),
        "optimiser": method.spec(),
        "judge": settings.judge,
    }
    return Work(spec, start, f"{method.label}, {field_name}, {object_name}, start {start}")


def search_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Search from one start and judge the result.

    Args:
        spec: from `make_work`.
        seed: of the start and of the search.
        context: threads.

    Returns:
        What `search_posture` returns.
    """
    return search_posture(spec["robot"], spec, seed, context)


# --- tables ------------------------------------------------------------------------------------


# --- figures -----------------------------------------------------------------------------------


def _draw(
    settings: Settings, by_case: Mapping[Any, Records], best, yardstick, folder: Path
) -> list[Path]:
    """The best postures in space and in their field, the exhaustive search's beside them, and all
    values.
    """
    ours = [_panel(best[name], name.replace("_", " ")) for name in settings.objects]
    searches = [(name, method) for name, methods in settings.methods.items() for method in methods]
    rivals = (("CMA-ES", best), ("exhaustive", yardstick))
    drawings = (
        partial(posture_scenes, ours, folder / "objects.png"),
        partial(
            posture_grid,
            [[_panel(found[name], label) for name in settings.objects] for label, found in rivals],
            folder / "best.png",
        ),
        partial(
            value_dots,
            {
                f"{method.label}, {field}": [
                    judged_values(by_case[name, field, method]) for name in settings.objects
                ]
                for field, method in searches
            }
            | {"exhaustive": [judged_values([yardstick[name]]) for name in settings.objects]},
            [name.replace("_", " ") for name in settings.objects],
            folder / "values.png",
        ),
    )
    return [draw() for draw in drawings]


def _panel(record: Mapping[str, Any], label: str) -> PosturePanel:
    result = record["result"]
    spec = record["spec"]
    pose = np.array(spec["pose"])
    q = np.array(result["posture"])
    return PosturePanel(spec["robot"], spec["object"], pose, q, label, result["enclosed"])

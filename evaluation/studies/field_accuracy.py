"""How good the escape fields are: exact grids, the trained network, and label-free attempts (paper,
section 4.6).

All are held against the second-order grid at 200 x 200 on held-out sets (`evaluation.field_sets`),
and those that matter against one at 800 x 800 as well, which says how far that truth is to be
trusted.
"""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.field_sets import exact_field
from evaluation.figures import error_map, field_comparison
from evaluation.jobs import Context, Work, run_recorded
from evaluation.studies.common import SMOKE_PLANNER
from evaluation.studies.field_work import do, learned_case, load_field
from evaluation.tables import write_table
from piec_envs import BatchedField

NOTES = """\
Relative errors of T in %, against the second-order grid at 200 x 200, median / mean / 95th
percentile. H: 50 curled configurations x 400 points around the arm; hard: those of H where the arm
costs more than 5 %. U: 50 uniform configurations x 400 points anywhere. P: all states of five
caging plans. Rank over points: Spearman, mean over the configurations of H; C rank: over 1500
curled configurations at one point; AUC: enclosed or not, on C. Cosine: median of dT/dq with the
exact one on H, where it is felt. Cages: how many of the postures that CMA-ES (100 x 100) finds with
the field for three discs within 0.4 m of the base are closed under the hard wall, n of them; true
T: their mean T by the exact grid, s. Seconds: training, labels included. us: a point, one core, in
batches of 5000 and of 50.

The last four rows had an eighth of the paper's 20,000 iterations: pinn-paper-short is its recipe
stopped there, each of the others is that with one addition of the literature (docs/fields.md). None
makes it learn: C rank below 0, AUC below 0.25, no cage. They were trained and timed beside other
work on the same machine, so that their seconds and us, with the network of pinn-paper, say
little."""
FINE_NOTES = """\
Relative errors of T in %, median / mean, against the second-order grid at 800 x 800: the grid that
the other table takes for the truth, at 200 x 200, stands among the rows. P and C are thinned; n
counts points. Enclosed: points without a way out under the hard wall, whose T is the time through
the leaky one."""


DRAWN = ("network", "pinn", "pinn-paper")  # of the learned fields


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        robot: row of the table of robots.
        grids: (nodes a side, method) of the grids.
        recipes: learned fields, by the recipe that trains them; those that do not ship are trained
            first.
        further: more of them, left out of what records are found by, so that the others keep
            theirs.
        seed: of the trainings.
        rows: configurations in H and U.
        points: for each.
        ranking: configurations in C.
        starts: static caging problems, one start each.
        optimiser: arguments of `CmaEsConfiguration`.
        planner: arguments of the planner whose plans make P.
        planner_seeds: its seeds.
        fine: nodes a side of the finest grid.
        fine_points: points of each set that are asked there.
        drawn: configurations in the figures.
    """

    robot: str = "planar_arm"
    grids: tuple[tuple[int, str], ...] = ((100, "marching"), (100, "sweeping"), (64, "sweeping"))
    recipes: tuple[str, ...] = ("network", "pinn", "pinn-lines", "pinn-factorised", "pinn-paper")
    further: tuple[str, ...] = (
        "pinn-paper-short",
        "pinn-paper-viscous",
        "pinn-paper-progressive",
        "pinn-paper-td",
    )
    seed: int = 0
    rows: int = 50
    points: int = 400
    ranking: int = 1500
    starts: int = 10
    optimiser: dict[str, Any] = field(default_factory=dict)
    planner: dict[str, Any] = field(default_factory=dict)
    planner_seeds: tuple[int, ...] = (0, 1, 2, 3, 4)
    fine: int = 800
    fine_points: int = 250
    drawn: tuple[tuple[float, ...], ...] = (
        (0.4, 1.5, 1.4, 1.5),
        (0.2, -1.2, -1.7, -1.0),
        (0.9, 1.1, 1.9, 1.9),
    )

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            grids=((64, "sweeping"),),
            recipes=("network",),
            further=(),
            rows=2,
            points=20,
            ranking=40,
            starts=1,
            optimiser={"population": 4, "iterations": 2},
            planner=SMOKE_PLANNER,
            planner_seeds=(0,),
            fine=64,
            fine_points=10,
            drawn=((0.4, 1.5, 1.4, 1.5),),
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/field-accuracy.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    return judge_fields(settings, make_cases(settings), NOTES, Path(out_dir), jobs, progress)


def judge_fields(
    settings: Settings,
    cases: dict[str, dict[str, Any]],
    notes: str,
    folder: Path,
    jobs: Any,
    progress: bool,
) -> list[Path]:
    """Score fields, write the tables and draw the figures.

    Args:
        settings: the knobs.
        cases: what makes each field, by its label; see `load_field`.
        notes: what the columns of the table mean.
        folder: of the results.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    common = json.loads(json.dumps(dataclasses.asdict(settings)))
    del common["further"]
    works = [
        Work({"work": "score", "field": spec, **common}, settings.seed, label)
        for label, spec in cases.items()
    ]
    exact = {"kind": "grid", "nodes": 200, "method": "marching"}
    compared = {
        "grid 200, marching": exact,
        **{k: spec for k, spec in cases.items() if spec["kind"] != "bound"},
    }
    works += [
        Work({"work": "fine", "field": spec, **common}, settings.seed, label)
        for label, spec in compared.items()
    ]
    context = Context(folder=str(folder), progress=progress)
    records = run_recorded(
        do, works, folder / "records.jsonl", jobs, context, "judging fields" if progress else ""
    )
    results = [record["result"] for record in records]
    rows = [
        {"field": label, **_columns(result)}
        for label, result in zip(cases, results[: len(cases)], strict=True)
    ]
    fine = [
        {"field": label, **_fine_columns(result)}
        for label, result in zip(compared, results[len(cases) :], strict=True)
    ]
    return [
        *write_table(folder, rows, "Escape fields against the exact one", notes),
        *write_table(folder, fine, "The same against a finer grid", FINE_NOTES, name="fine"),
        *_draw(settings, cases, folder, context),
    ]


def make_cases(settings: Settings) -> dict[str, dict[str, Any]]:
    """What makes each field that is judged, by its label."""
    grids = {
        f"grid {nodes}, {method}": {"kind": "grid", "nodes": nodes, "method": method}
        for nodes, method in settings.grids
    }
    learned = {
        name: learned_case(settings.robot, name) for name in settings.recipes + settings.further
    }
    return {"T_0, no arm": {"kind": "bound"}, **grids, **learned}


# --- tables and figures ------------------------------------------------------------------------


def _percent(values: Sequence[float]) -> str:
    return " / ".join("0" if value < 5e-6 else f"{100 * value:.2g}" for value in values)


def _columns(result: dict[str, Any]) -> dict[str, Any]:
    """One row of the table, after its name."""
    shown: dict[str, Any] = {
        label: _percent([result[name][key] for key in ("median", "mean", "p95")])
        for label, name in (("H", "H"), ("hard", "hard"), ("U", "U"), ("P", "P"))
    }
    shown["rank over points"] = f"{result['rank_points']:.4f}"
    shown["C rank"] = f"{result['rank_c']:.4f}"
    shown["AUC"] = f"{result['auc']:.4f}"
    if "cosine" in result:
        shown["cosine"] = f"{result['cosine']:.4f}"
        shown["cages"] = f"{result['cages']} of {result['starts']}"
        shown["n"] = result["starts"]
        shown["true T, s"] = f"{result['posture_T']:.1f}"
        shown["seconds"] = "" if result["seconds"] is None else f"{result['seconds']:.0f}"
        shown["us, 5000"] = f"{result['us_5000']:.3g}"
        shown["us, 50"] = f"{result['us_50']:.3g}"
    return shown


def _fine_columns(result: dict[str, Any]) -> dict[str, Any]:
    shown: dict[str, Any] = {}
    for name, (n, median, mean) in result.items():
        shown[f"{name}, n"] = n
        shown[name] = "" if n == 0 else _percent([median, mean])
    return shown


def _draw(
    settings: Settings, cases: dict[str, dict[str, Any]], folder: Path, context: Context
) -> list[Path]:
    """The fields side by side, and where those that are not solved are off, on curled postures."""
    spec = dataclasses.asdict(settings)
    tables = [label for label, case in cases.items() if case["kind"] == "table"][:1]
    shown = [*tables, *(recipe for recipe in DRAWN if recipe in cases)]
    learned: dict[str, BatchedField] = {
        label.partition(" ")[0]: load_field(cases[label], spec, settings.seed, context)
        for label in shown
    }
    exact = exact_field(settings.robot, context.threads)
    configurations = [np.array(q) for q in settings.drawn]
    points = [_inner_point(exact, q) for q in configurations]
    return [
        field_comparison(
            {"exact grid": exact, **learned}, configurations, points, folder / "fields.png"
        ),
        error_map(exact, learned, configurations, folder / "errors.png"),
    ]


def _inner_point(exact: BatchedField, q: np.ndarray) -> np.ndarray:
    """The point outside the wall from which leaving takes longest, shape (2,), m."""
    solved = exact.solve(q)
    free = solved.speed > exact.speed.leak * exact.u_bar * 1.01
    row, column = np.unravel_index(int(np.argmax(np.where(free, solved.T, -1.0))), solved.T.shape)
    return np.array([solved.x[column], solved.y[row]])

"""Pushing with a mobile Franka and four contact geometries (paper, section 7.2.1, Tables 2 and 3).

Plans of four methods and of controls are executed open loop without noise, with the object displaced in every
step, and on plants with other friction, the box for which the circle stands, and MuJoCo with the real meshes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.studies.common import DRAWN_STARTS, PLANNER_SEEDS, SMOKE_PLANNER, StudyRun
from evaluation.studies.contact_methods import (
    CARRY,
    CARRY_NOTE,
    CONTROLS,
    METHODS,
    STARTS_NOTE,
    Budget,
    all_cases,
    disturbed_rows,
    draw_methods,
    mismatch_d2g_rows,
    usage_rows,
)
from evaluation.studies.mismatch import evaluate_all
from evaluation.tables import write_table

ENV = "piec_envs/MobileFrankaPush-v0"
MISMATCHES = {  # protocols in the order of the paper's columns, and what figures call them
    "friction-0.80": "friction 0.8",
    "friction-0.20": "friction 0.2",
    "shape-box_212": "box",
    "dynamics-mujoco": "MuJoCo",
}
PAPER_NOISE = {  # Table 2: d2g and success
    "Point": ("0.383 ± 0.165", "4 %"),
    "Link": ("0.399 ± 0.201", "4 %"),
    "WAContact": ("0.308 ± 0.208", "15 %"),
    "WACaging": ("0.003 ± 0.018", "87 %"),
}
PAPER_MISMATCH = {  # Table 3: d2g, nominal and in the order of MISMATCHES
    "Point": (0.373, 0.421, 0.217, 0.416, 0.207),
    "Link": (0.000, 0.080, 0.027, 0.378, 0.008),
    "WAContact": (0.000, 0.001, 0.058, 0.008, 0.132),
    "WACaging": (0.000, 0.000, 0.001, 0.002, 0.002),
}
PLANNER = {"sigma": 0.05, "restarts": 2, "survivors": 1, "robust_samples": 4}
NOTES = f"""\
n counts distinct executions: plans x rollouts, under `disturbance-5mm` (Gaussian, sigma = 5 mm for each axis in each
step of 0.1 s). First plan: rate of the first planner seed with Wilson's 95 % interval; each plan: rates of all seeds,
their mean with a bootstrap over plans, and the least. d2g: distance to the goal region at the end, mean ± standard
deviation over executions. Last columns: the paper's Table 2.

{STARTS_NOTE}{CARRY_NOTE}"""
MISMATCH_NOTES = f"""\
d2g, m: distance to the goal region at the end, mean over executions; success: rate of each plan. From the task's
start a plan is one execution; drawn starts lie within 0.01 m and 0.05 rad of it. n counts distinct executions in each
column: plans x executions. The plans are made for friction 0.5, the circle and the quasi-dynamic model. Rows called
"paper" are its Table 3.

{STARTS_NOTE}{CARRY_NOTE}"""
USAGE_NOTES = """\
n counts distinct executions, one of each plan, without noise. Mean over time, mean ± standard deviation over plans.
Caging, 0.02 T_hat, is that of the parts that can touch the object; whole-arm caging is what all parts together would
give. Arm distance: mean over the links that can touch."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        methods: keys of METHODS.
        controls: keys of CONTROLS, "rigid-carry", or methods followed by ", paper".
        planner_seeds: one plan of each case for each.
        noise: protocol of Table 2.
        mismatches: protocols of Table 3 beside the nominal one.
        episodes: rollouts of each plan under noise.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective, alike for all methods.
        env_kwargs: keyword arguments of the environment beside a method's own.
    """

    methods: tuple[str, ...] = tuple(METHODS)
    controls: tuple[str, ...] = (CARRY, *CONTROLS, "WAContact, paper", "WACaging, paper")
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    noise: str = "disturbance-5mm"
    mismatches: tuple[str, ...] = tuple(MISMATCHES)
    episodes: int = 100
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=lambda: PLANNER)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            methods=("Link", "WACaging"),
            controls=(CARRY,),
            planner_seeds=(0,),
            mismatches=("shape-box_212",),
            episodes=2,
            starts=2,
            planner=SMOKE_PLANNER,
            env_kwargs={"geometry": "capsules"},
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-push; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts)
    budget = Budget(ENV, settings.planner, settings.env_kwargs)
    main, others = all_cases(budget, settings.methods, settings.controls)
    cases, columns = [*main, *others], ("nominal", *settings.mismatches)
    plans = study.plan(cases)
    noisy, results = study.evaluate(cases, settings.noise), evaluate_all(study, cases, columns)
    printed = PAPER_MISMATCH if columns == ("nominal", *MISMATCHES) else {}
    rows = mismatch_d2g_rows(cases, results, columns, printed)
    return [
        *write_table(
            study.out_dir, disturbed_rows(cases, plans, noisy, PAPER_NOISE), "Pushing under displacements", NOTES
        ),
        *write_table(study.out_dir, rows, "Pushing on other plants", MISMATCH_NOTES, "mismatch"),
        *write_table(
            study.out_dir, usage_rows(study, cases, results["nominal"]), "How the arm is used", USAGE_NOTES, "usage"
        ),
        *draw_methods(study, main, settings.noise, {name: MISMATCHES[name] for name in settings.mismatches}),
    ]

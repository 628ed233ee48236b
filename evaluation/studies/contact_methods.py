"""What the studies of contact geometries share (paper, section 7.2): methods, controls, tables and
pictures.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from evaluation.figures import (
    animate_rollouts,
    keyframes,
    mismatch_paths,
    over_time,
    space_keyframes,
    trajectories,
)
from evaluation.studies.common import DRAWN_STARTS, PLANNER_SEEDS, Case, StudyRun
from evaluation.studies.contact_notes import (
    CARRY,
    MISMATCH_NOTES,
    NOISE_NOTES,
    USAGE_NOTES,
    method_notes,
)
from evaluation.studies.contact_rows import (
    Printed,
    disturbed_rows,
    mismatch_rows,
    printed_rows,
    usage_rows,
)
from evaluation.studies.mismatch import evaluate_all, executed
from evaluation.studies.paper import paper_case
from evaluation.studies.pictures import first_trajectories, over_plans
from evaluation.tables import write_table
from piec_envs import (
    PAPER_PRESETS,
)

# keyword arguments of the environment
CAGE = {"start": "cage"}
OPEN = {"start": "open"}
# What each method may touch the object with, where it starts, and what it optimises.
METHODS: Mapping[str, tuple[Mapping[str, Any], str]] = {
    "Point": ({"contact": "point", **CAGE}, "contact"),
    "Link": ({"contact": "link", **CAGE}, "contact"),
    "WAContact": (OPEN, "contact"),
    "WACaging": (CAGE, "caging"),
}
CONTROLS: Mapping[str, tuple[Mapping[str, Any], str]] = {
    "WAContact, caged start": (CAGE, "contact"),
    "WACaging, open start": (OPEN, "caging"),
}
PAPER_CONTROLS = tuple(
    f"{name}, {preset}" for preset in PAPER_PRESETS for name in ("WAContact", "WACaging")
)
ANIMATED_EVERY = 20  # steps between two frames
# solved in no time, for smoke runs
SMALL_TABLE = {"name": "table", "resolution": 49, "spacing": 0.3}


@dataclass(frozen=True)
class MethodSettings:
    """Knobs of a comparison of methods.

    Args:
        methods: keys of METHODS.
        controls: keys of CONTROLS, "rigid-carry", or methods followed by ", " and one of the
            paper's presets.
        planner_seeds: one plan of each case for each.
        noise: protocol of the table of displacements.
        mismatches: protocols of the table of other plants, and what figures call them.
        episodes: rollouts of each plan under noise.
        starts: executions of each plan from drawn starts.
        planner: arguments of `CmaEsPlanner` beside the objective, alike for all methods.
        env_kwargs: keyword arguments of the environment beside a method's own.
    """

    methods: tuple[str, ...] = tuple(METHODS)
    controls: tuple[str, ...] = ()
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    noise: str = "disturbance-5mm"
    mismatches: Mapping[str, str] = field(default_factory=dict)
    episodes: int = 100
    starts: int = DRAWN_STARTS
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)


def compare_methods(
    settings: MethodSettings, env_id: str, study: StudyRun, printed: Printed
) -> list[Path]:
    """Plan and evaluate all cases and write three tables and the figures.

    Args:
        settings: the knobs.
        env_id: id of the environment.
        study: the run.
        printed: the paper's values, shown beside ours.

    Returns:
        The files written.
    """
    budget = Budget(env_id, settings.planner, settings.env_kwargs)
    main, others = all_cases(budget, settings.methods, settings.controls)
    cases = [*main, *others]
    columns = ("nominal", *settings.mismatches)
    plans = study.plan(cases)
    noisy = study.evaluate(cases, settings.noise)
    results = evaluate_all(study, cases, columns)
    disturbed = disturbed_rows(cases, plans, noisy, printed.noise)
    mismatch = mismatch_rows(cases, results, columns)
    usage = usage_rows(study, cases, results["nominal"])
    folder = study.out_dir
    methods = method_notes(settings.controls)
    for row in printed_rows(printed, columns):
        last = max(k for k, other in enumerate(mismatch) if other["method"] == row["method"])
        mismatch.insert(last + 1, row)
    return [
        *write_table(
            folder, disturbed, "Pushing under displacements", f"{NOISE_NOTES}\n\n{methods}"
        ),
        *write_table(
            folder,
            mismatch,
            "Pushing on other plants",
            f"{MISMATCH_NOTES}\n\n{methods}",
            "mismatch",
        ),
        *write_table(folder, usage, "How the arm is used", USAGE_NOTES, "usage"),
        *draw_methods(study, main, settings.noise, settings.mismatches),
    ]


@dataclass(frozen=True)
class Budget:
    """What all methods of a study are planned with.

    Args:
        env_id: id of the environment.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment beside a method's own.
    """

    env_id: str
    planner: Mapping[str, Any]
    env_kwargs: Mapping[str, Any]

    def case(self, label: str, env_kwargs: Mapping[str, Any], objective: str) -> Case:
        """A method under this budget.

        Args:
            label: what tables and figures call it.
            env_kwargs: keyword arguments of the environment that make the method.
            objective: row of the table of objectives.

        Returns:
            The case.
        """
        return Case(
            label,
            {**self.planner, "objective": objective},
            {**self.env_kwargs, **env_kwargs},
            self.env_id,
        )

    def carry(self) -> Case:
        """The control that optimises nothing."""
        return Case(CARRY, {"name": CARRY}, {**self.env_kwargs, **CAGE}, self.env_id)


def all_cases(
    budget: Budget, methods: Sequence[str], controls: Sequence[str]
) -> tuple[list[Case], list[Case]]:
    """Methods and controls.

    Args:
        budget: of all of them.
        methods: keys of METHODS.
        controls: keys of CONTROLS, `rigid-carry`, or methods followed by ", " and one of the
            paper's presets.

    Returns:
        (methods, controls): their cases.
    """
    main = [budget.case(name, *METHODS[name]) for name in methods]
    others = []
    for name in controls:
        method, _, rest = name.partition(", ")
        if name == CARRY:
            others.append(budget.carry())
        elif rest in PAPER_PRESETS:
            caged = {**budget.env_kwargs, **CAGE}
            others.append(paper_case(method, rest, METHODS[method][1], caged, budget.env_id))
        else:
            others.append(budget.case(name, *CONTROLS[name]))
    return main, others


def draw_methods(
    study: StudyRun, cases: Sequence[Case], noise: str, mismatches: Mapping[str, str]
) -> list[Path]:
    """Key frames, disturbed paths, still and moving, mismatched ones of the first plans; caging
    over time of all.

    Args:
        study: the run.
        cases: what is compared.
        noise: protocol of the disturbed paths.
        mismatches: protocols of the mismatched paths and what the figure calls them.

    Returns:
        The files written.
    """
    folder = study.out_dir
    nominal = first_trajectories(study, cases)
    noisy = first_trajectories(study, cases, noise)
    caging = {case.label: over_plans(study, case, "nominal", "caging") for case in cases}
    runs = [
        [executed(study, case, name, label) for name, label in mismatches.items()] for case in cases
    ]
    return study.draw(
        partial(keyframes, nominal, folder / "keyframes.png"),
        partial(space_keyframes, nominal, folder / "space_keyframes.png"),
        partial(trajectories, noisy, folder / "object_paths.png"),
        partial(animate_rollouts, noisy, folder / "animation.gif", every=ANIMATED_EVERY),
        partial(mismatch_paths, nominal, runs, folder / "mismatch_paths.png"),
        partial(over_time, caging, "caging", folder / "caging.png"),
    )

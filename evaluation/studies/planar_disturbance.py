"""Which plans survive random displacements of the object (paper, section 6.2).

The plans of `planar-objectives` are executed open loop while the object is displaced in every step:
by a Gaussian for each axis, and by a vector of fixed length in a uniform direction (the paper's
bound), at 1, 3 and 5 mm. Each plan is executed with independent noise, alike for every objective.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

from evaluation.figures import distance_bands, final_distances, overview, trajectories
from evaluation.studies.columns import distance_columns, success_columns
from evaluation.studies.common import PLANNER_SEEDS, SMOKE_PLANNER, Case, StudyRun, mode_cases
from evaluation.studies.paper import all_notes, paper_cases
from evaluation.studies.pictures import first_trajectories, over_plans, sigma_of
from evaluation.tables import write_table

NOTES = """\
n counts distinct executions: plans x rollouts of each. An execution succeeds if the object's centre
ends within 0.05 m of the goal's. First plan: rate of the plan of the first seed with Wilson's 95 %
interval. Each plan: rates of all planner seeds; their mean with a bootstrap over plans (95 %), and
the least. Distances at the end: mean ± standard deviation over all executions. Deviation: largest
distance of the object from the undisturbed execution at the same time, mean over executions. Noise:
`disturbance-5mm` is Gaussian with sigma = 5 mm for each axis in each step of 0.1 s;
`disturbance-5mm-direction` has the length 5 mm and a uniform direction. Caging is planned with the
robot's default field; rows called "grid" with fast sweeping at 64 x 64 on every 20th step."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        objectives: what to compare.
        paper: objectives planned with the paper's presets and budget as well.
        fields: escape fields that the caging plans are made with as well, beside the default one.
        planner_seeds: one plan of each objective for each.
        protocols: the noises; those in `drawn` go into the figures.
        drawn: the protocols of the figures, by growing sigma.
        episodes: rollouts of each plan under each protocol.
        planner: arguments of `CmaEsPlanner` beside the objective.
        env_kwargs: keyword arguments of the environment.
    """

    objectives: tuple[str, ...] = ("contact", "proximity", "caging")
    paper: tuple[str, ...] = ("contact", "proximity", "caging")
    fields: tuple[str, ...] = ("grid",)
    planner_seeds: tuple[int, ...] = PLANNER_SEEDS
    protocols: tuple[str, ...] = (
        "disturbance-1mm",
        "disturbance-3mm",
        "disturbance-5mm",
        "disturbance-1mm-direction",
        "disturbance-3mm-direction",
        "disturbance-5mm-direction",
    )
    drawn: tuple[str, ...] = ("disturbance-1mm", "disturbance-3mm", "disturbance-5mm")
    episodes: int = 100
    planner: Mapping[str, Any] = field(default_factory=dict)
    env_kwargs: Mapping[str, Any] = field(default_factory=dict)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            objectives=("contact", "caging"),
            paper=(),
            fields=(),
            planner_seeds=(0,),
            protocols=("disturbance-5mm",),
            drawn=("disturbance-5mm",),
            episodes=2,
            planner=SMOKE_PLANNER,
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/planar-disturbance; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress)
    modes = mode_cases(settings.objectives, settings.planner, settings.env_kwargs)
    # a grid takes its time
    planner = {"escape_every": 20, **settings.planner, "objective": "caging"}
    other = [
        Case(f"caging, {name}", {**planner, "escape_field": name}, settings.env_kwargs)
        for name in settings.fields
    ]
    cases = [*modes, *other, *paper_cases(settings.paper, settings.env_kwargs)]
    study.plan(cases)
    rows = []
    for protocol in settings.protocols:
        for case, results in zip(cases, study.evaluate(cases, protocol), strict=True):
            rows.append({"noise": protocol, "objective": case.title, **success_columns(results)})
            rows[-1].update(distance_columns(results))
    title = "Which plans survive random displacements of the object"
    tables = write_table(study.out_dir, rows, title, all_notes(NOTES, settings.paper))
    return [*tables, *draw_disturbed(study, modes, settings.drawn)]


def draw_disturbed(study: StudyRun, cases: list[Case], protocols: tuple[str, ...]) -> list[Path]:
    """Distance over time and at the end over all plans; object paths of the first plans.

    Args:
        study: the run.
        cases: what to compare.
        protocols: by growing sigma; the last one is drawn in the plane.

    Returns:
        The files written.
    """
    folder = study.out_dir
    distance = {
        case.label: {
            sigma_of(name): over_plans(study, case, name, "goal_distance") for name in protocols
        }
        for case in cases
    }
    first = first_trajectories(study, cases, protocols[-1])
    final = {
        label: {sigma: rows[:, -1] for sigma, rows in row.items()}
        for label, row in distance.items()
    }
    return study.draw(
        partial(distance_bands, distance, folder / "distance_over_time.png"),
        partial(final_distances, final, folder / "final_distance.png"),
        partial(trajectories, first, folder / "object_paths.png"),
        partial(overview, first, folder / "overview.png"),
    )

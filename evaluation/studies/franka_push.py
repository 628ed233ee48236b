"""Pushing with a mobile Franka and four contact geometries (paper, section 7.2.1, Tables 2 and 3).

Plans of four methods and of controls are executed open loop without noise, with the object
displaced in every step, and on plants with other friction, the box for which the circle stands, and
MuJoCo with the real meshes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.studies.common import SMOKE_PLANNER, StudyRun
from evaluation.studies.contact_methods import (
    CARRY,
    CONTROLS,
    PAPER_CONTROLS,
    SMALL_TABLE,
    MethodSettings,
    compare_methods,
)
from evaluation.studies.contact_rows import Printed

ENV = "piec_envs/MobileFrankaPush-v0"
MISMATCHES = {  # in the order of the paper's columns
    "friction-0.80": "friction 0.8",
    "friction-0.20": "friction 0.2",
    "shape-box_212": "box",
    "dynamics-mujoco": "MuJoCo",
}
NOISE = {  # Table 2: d2g and success
    "Point": ("0.383 ± 0.165", "4 %"),
    "Link": ("0.399 ± 0.201", "4 %"),
    "WAContact": ("0.308 ± 0.208", "15 %"),
    "WACaging": ("0.003 ± 0.018", "87 %"),
}
TABLE_3 = {  # d2g, nominal and in the order of MISMATCHES
    "Point": (0.373, 0.421, 0.217, 0.416, 0.207),
    "Link": (0.000, 0.080, 0.027, 0.378, 0.008),
    "WAContact": (0.000, 0.001, 0.058, 0.008, 0.132),
    "WACaging": (0.000, 0.000, 0.001, 0.002, 0.002),
}
PAPER = Printed(
    NOISE,
    {name: dict(zip(("nominal", *MISMATCHES), row, strict=True)) for name, row in TABLE_3.items()},
)
PLANNER = {"sigma": 0.05, "restarts": 2, "survivors": 1, "robust_samples": 4}


@dataclass(frozen=True)
class Settings(MethodSettings):
    """All knobs of the study, with its own defaults.

    Args:
        controls, mismatches, planner: as in `MethodSettings`.
    """

    controls: tuple[str, ...] = (CARRY, *CONTROLS, *PAPER_CONTROLS)
    mismatches: Mapping[str, str] = field(default_factory=lambda: MISMATCHES)
    planner: Mapping[str, Any] = field(default_factory=lambda: PLANNER)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            methods=("Link", "WACaging"),
            controls=(CARRY,),
            planner_seeds=(0,),
            mismatches={"shape-box_212": "box"},
            episodes=2,
            starts=2,
            planner=SMOKE_PLANNER,
            env_kwargs={"geometry": "capsules", "escape_field": SMALL_TABLE},
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
    study = StudyRun(
        Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts
    )
    shown = {name: values for name, values in PAPER.mismatch.items() if name in settings.methods}
    return compare_methods(settings, ENV, study, Printed(PAPER.noise, shown))

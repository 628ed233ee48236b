"""Pushing a pack of paper rolls with a Franka on a fixed base (the task of the paper's section
7.3).

There is no base to carry a cage, so that all depends on planning. Methods, controls and tables are
those of `franka-push`; the plants are those that a pack can be mistaken for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from evaluation.studies.common import SMOKE_PLANNER, StudyRun
from evaluation.studies.contact_methods import (
    CONTROLS,
    PAPER_CONTROLS,
    SMALL_TABLE,
    MethodSettings,
    compare_methods,
)
from evaluation.studies.contact_rows import Printed

ENV = "piec_envs/FrankaPush-v0"
MISMATCHES = {
    "friction-0.80": "friction 0.8",
    "friction-0.20": "friction 0.2",
    "shape-paper_pack_wrapped": "wrapped",
    "shape-a4_box": "box",
    "dynamics-mujoco": "MuJoCo",
}
# Planned under noise from the first guess on: what is found on the nominal model first lets go of
# the object half-way.
PLANNER: Mapping[str, Any] = {
    "arrive": 0.4,
    "restarts": 1,
    "survivors": 1,
    "screening": 0,
    "iterations": 1,
    "sigma": 0.01,
    "population": 40,
    "robust_points": 5,
    "robust_sigma": 0.1,
    "robust_samples": 16,
    "robust_iterations": 60,
}


@dataclass(frozen=True)
class Settings(MethodSettings):
    """All knobs of the study, with its own defaults.

    Args:
        controls, mismatches, planner: as in `MethodSettings`.
    """

    controls: tuple[str, ...] = (*CONTROLS, *PAPER_CONTROLS)
    mismatches: Mapping[str, str] = field(default_factory=lambda: MISMATCHES)
    planner: Mapping[str, Any] = field(default_factory=lambda: PLANNER)

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        return cls(
            methods=("WACaging",),
            planner_seeds=(0,),
            controls=(),
            mismatches={"shape-a4_box": "box"},
            episodes=1,
            starts=1,
            planner=SMOKE_PLANNER,
            env_kwargs={"geometry": "capsules", "escape_field": SMALL_TABLE},
        )


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-fixed; plans are cached in the folder above.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    study = StudyRun(
        Path(out_dir), settings.planner_seeds, settings.episodes, jobs, progress, settings.starts
    )
    return compare_methods(settings, ENV, study, Printed())

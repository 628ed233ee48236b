"""The table of studies: each reproduces one part of the paper and is one readable file."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from piec_envs import check_name

PUSH = "piec_envs/PlanarArmPush-v0"  # the env of the planar studies


@dataclass(frozen=True)
class Study:
    """One row of the table of studies.

    Args:
        name: its key in the table, and its folder under results.
        module: where `Settings` and `run(settings, out_dir, jobs, progress)` stand.
        description: one line for people.
    """

    name: str
    module: str
    description: str

    def load(self) -> Any:
        """The study's module."""
        return import_module(self.module)


STUDIES = {
    row.name: row
    for row in (
        Study(
            "eikonal-toy",
            "evaluation.studies.eikonal_toy",
            "the escape time of a point mass in a square annulus (paper, section 3.4)",
        ),
        Study(
            "field-accuracy",
            "evaluation.studies.field_accuracy",
            "how good the learned escape fields are, beside exact ones (paper, section 4.6)",
        ),
        Study(
            "planar-caging",
            "evaluation.studies.planar_caging",
            "which postures enclose an object, by CMA-ES and SQP (paper, section 4.6)",
        ),
        Study(
            "planar-objectives",
            "evaluation.studies.planar_objectives",
            "what the three objectives make the arm do (paper, section 5.4)",
        ),
        Study(
            "planar-disturbance",
            "evaluation.studies.planar_disturbance",
            "which plans survive random displacements of the object (paper, section 6.2)",
        ),
        Study(
            "planar-adversary",
            "evaluation.studies.planar_adversary",
            "planning against a fleeing object, mode 4, beside mode 3 (paper, appendix B.1)",
        ),
        Study(
            "planar-dynamics",
            "evaluation.studies.planar_dynamics",
            "plans of the quasi-dynamic model executed under MuJoCo (paper, section 6.3.1)",
        ),
        Study(
            "planar-shape",
            "evaluation.studies.planar_shape",
            "plans for a circle executed with polygons (paper, section 6.3.2)",
        ),
        Study(
            "planar-friction",
            "evaluation.studies.planar_friction",
            "plans for one friction executed under others (paper, section 6.3.3)",
        ),
        Study(
            "planar-robustness",
            "evaluation.studies.planar_robustness",
            "all perturbations in one table: contact models and displacements (paper, section 6)",
        ),
        Study(
            "franka-fields",
            "evaluation.studies.franka_fields",
            "how good the escape fields of the Franka are (paper, appendix B.2)",
        ),
        Study(
            "franka-caging",
            "evaluation.studies.franka_caging",
            "how well the whole arm of a Franka encloses everyday objects (paper, section 7.1)",
        ),
        Study(
            "franka-starts",
            "evaluation.studies.franka_starts",
            "where the moving Franka begins: static problems with the base free (paper, section "
            "7.2)",
        ),
        Study(
            "franka-push",
            "evaluation.studies.franka_push",
            "a mobile Franka with four contact geometries under noise and mismatch (paper, "
            "section 7.2.1)",
        ),
        Study(
            "franka-tracking",
            "evaluation.studies.franka_tracking",
            "a mobile Franka that follows arcs: tracking against caging (paper, section 7.2.2)",
        ),
        Study(
            "franka-fixed",
            "evaluation.studies.franka_fixed",
            "a Franka on a fixed base, where all depends on planning (the task of the paper's "
            "section 7.3)",
        ),
        Study(
            "sim-to-real",
            "evaluation.studies.sim_to_real",
            "plans of a simple model on a detailed plant in MuJoCo (paper, section 7.3)",
        ),
        Study(
            "rl-comparison",
            "evaluation.studies.rl_comparison",
            "planning against learning, closed and open loop, on nominal and mismatched plants",
        ),
    )
}


def get_study(name: str) -> Study:
    """The study of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("study", name, STUDIES)
    return STUDIES[name]

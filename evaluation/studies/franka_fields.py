"""How good the escape fields of the Franka are: tables, the trained network, label-free ones
(paper, appendix B.2).

Judged as those of the planar arm are, by `field_accuracy`, on sets drawn in the same way.
"""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from evaluation.studies import field_accuracy

ROBOT = "franka"
NOTES = """\
Relative errors of T in %, against the second-order grid at 200 x 200, median / mean / 95th
percentile. H: 50 curled configurations x 400 points around the arm; hard: those of H where the arm
costs more than 5 %. U: 50 uniform configurations x 400 points anywhere. P: the object's centre
while the arm closes on it, from straight to a posture that CMA-ES finds, at five poses. Rank over
points: Spearman, mean over the configurations of H; C rank: over 1500 curled configurations at the
point (0.2, 0.06), nearer than the planar arm's, since no cage of this arm reaches that one; AUC:
enclosed or not, on C. Cosine: median of dT/dq with the exact one on H, where it is felt. Cages: how
many of the postures that CMA-ES (100 x 100) finds with the field for a water jug within 0.4 m of
the base are closed under the hard wall, n of them; true T: their mean T by the exact grid, s.
Seconds: training, labels included. us: a point, one core, in batches of 5000 and of 50.

pinn-paper is the paper's recipe with all of its 20,000 iterations, trained and timed beside other
work on the same machine, so that its seconds and us say little."""


@dataclass(frozen=True)
class Settings:
    """All knobs of the study.

    Args:
        common: those that it shares with `field_accuracy`.
        tables: (nodes a side, spacing of the joints in rad) of the tables.
    """

    common: field_accuracy.Settings = field_accuracy.Settings(  # noqa: RUF009  it is frozen
        robot=ROBOT,
        recipes=("network", "pinn"),
        further=("pinn-paper",),
        drawn=((2.74, -2.56, 0.84), (-0.51, -2.5, 0.83), (0.9, -1.9, 1.1)),
    )
    tables: tuple[tuple[int, float], ...] = ((101, 0.07), (81, 0.1), (65, 0.1))

    @classmethod
    def smoke(cls) -> Settings:
        """Tiny budgets, to see that everything runs."""
        common = dataclasses.replace(
            field_accuracy.Settings.smoke(), robot=ROBOT, drawn=((0.9, -2.3, 1.0),)
        )
        return cls(common, tables=((33, 0.4),))


def run(settings: Settings, out_dir: Path, jobs: Any = 1, progress: bool = True) -> list[Path]:
    """Run the study, or go on where it was stopped.

    Args:
        settings: the knobs.
        out_dir: results/franka-fields.
        jobs: workers, or an executor.
        progress: whether to show progress.

    Returns:
        The files written.
    """
    tables = {
        f"table {nodes}, {spacing:g} rad": {
            "kind": "table",
            "resolution": nodes,
            "spacing": spacing,
        }
        for nodes, spacing in settings.tables
    }
    cases = {**field_accuracy.make_cases(settings.common), **tables}
    return field_accuracy.judge_fields(settings.common, cases, NOTES, Path(out_dir), jobs, progress)

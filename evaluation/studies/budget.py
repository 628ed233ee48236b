"""What studies plan with, whatever the planner does by default."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

# The budget of every recorded plan, in full. Studies state what they change of it, so that records
# keep their keys whatever `CmaEsPlanner` does by default.
STUDY_PLANNER: Mapping[str, Any] = {
    "objective": "caging",
    "preset": "default",
    "population": 50,
    "iterations": 100,
    "restarts": 6,
    "screening": 15,
    "survivors": 2,
    "via_points": 5,
    "sigma": 0.2,
    "start": "enclose",
    "arrive": 0.6,
    "escape_field": "auto",
    "escape_every": 5,
    "robust_iterations": 40,
    "robust_samples": 8,
    "robust_disturbance": 0.005,
    "robust_sigma": 0.06,
    "robust_points": 3,
    "moving_points": 5,
    "robust_share": 1.0,
    "robust_screening": 0,
    "judge": "commanded",
    "adversary": None,
}
# Settings younger than the first records: specs leave them out where they are as above.
YOUNGER = ("moving_points", "robust_share", "robust_screening", "judge", "adversary")

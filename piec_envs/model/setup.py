"""What a model is made of: names, numbers and a task, resolved; nothing in it has been built."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from piec_envs.dynamics.contact_model import ContactModel
from piec_envs.dynamics.plant import PlantParams
from piec_envs.model.task import CostWeights, Task


@dataclass(frozen=True, eq=False)
class Setup:
    """A task with everything that decides how it is simulated.

    Args:
        task: what is to be done.
        robot: row of the table of robots.
        plant: parameters of episodes of which nothing is drawn.
        posture: joint positions at the start, shape (n,), rad or m.
        weights: of the stage cost.
        prior: index into PRIORS, or -1 for none.
        escape_field: name of the escape field, or its options with a "name"; None computes none.
        escape_every: steps between two refreshes of the escape time.
        start_noise: (position in m, angle in rad) by which the object's start is drawn, uniformly.
        randomize: plant parameters to draw at each reset, as ranges [low, high] or lists of names.
        solver: "fast" or "osqp", of the quasi-dynamic model.
        contact: settings of the quasi-dynamic model.
        threads: threads of a batch; None takes all cores.
        posture_given: whether the posture is one of the user's own, which must not overlap the
            object.
    """

    task: Task
    robot: str
    plant: PlantParams
    posture: np.ndarray
    weights: CostWeights
    prior: int = -1
    escape_field: str | Mapping[str, Any] | None = None
    escape_every: int = 1
    start_noise: tuple[float, float] = (0.0, 0.0)
    randomize: Mapping[str, Any] = field(default_factory=dict)
    solver: str = "fast"
    contact: ContactModel = field(default_factory=ContactModel)
    threads: int | None = None
    posture_given: bool = False

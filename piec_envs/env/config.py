"""Keyword arguments of the environments, validated once and JSON-able."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from piec_envs.dynamics.contact_model import PAPER_MODEL, ContactModel
from piec_envs.dynamics.plant import PARAMETERS, PlantParams, check_randomize
from piec_envs.dynamics.quasi_dynamic import SOLVERS
from piec_envs.errors import InvalidParameterError, as_count, as_floats, check_name
from piec_envs.escape.field import FIELDS, resolve_field
from piec_envs.model.reach import goal_ring
from piec_envs.model.setup import Setup
from piec_envs.model.start_postures import checked_start, start_posture
from piec_envs.model.task import PAPER_PRESETS, PRESETS, PRIORS, CostWeights, check_weight, get_task
from piec_envs.plain import make_plain

# a learned field is refreshed at every step
DEFAULT_ESCAPE_EVERY: dict[str | None, int] = {"grid": 10}
NOISE_ENTRIES = ("qp", "state")
START_NOISE_BOUND = (1.0, np.pi)  # m, rad


@dataclass(frozen=True, kw_only=True)
class EnvConfig(PlantParams):
    """All keyword arguments of an environment of motion except those that Gymnasium itself takes.

    Args:
        task: row of the table of tasks.
        dynamics, object, friction, disturbance, disturbance_kind, adversary, adversary_after:
            the plant's, as in `PlantParams`; the object "auto" is the task's.
        mass, delay, inertia: the plant's as well.
        solver: "fast" or "osqp", for the quasi-dynamic model.
        start_noise: (position in m, angle in rad) by which the object's start is drawn, uniformly.
        randomize: plant parameters to draw at each reset, as ranges [low, high] or lists of names.
        escape_field: name of the escape field, or its options with a "name"; "auto" is the robot's
            best, a table for few joints, else a network where weights ship, else a grid; None
            computes none.
        escape_every: steps between two refreshes of the escape time; None takes the field's
            default.
        prior: "caging", "contact", "proximity" or None; "auto" is caging where a field is computed.
        goal: centre of the goal region, (x, y) in m, where the arm can bring the object; None takes
            the task's.
        goal_conditioned: False, or True (sparse reward) or "dense", for dictionary observations.
        action_repeat: control steps of 0.1 s that one action lasts; their rewards add up, or the
            last counts if `goal_conditioned`.
        preset: weights of the stage cost and settings of the contact model: "default"; "paper", the
            paper's to the letter; or "paper-miss", those with the default's weight on a miss of the
            goal region.
        weights: changes to the preset's weights.
        noise_entry: "qp" (a displacement pushes against the arm) or "state" (the pose is displaced,
            then repaired), for the quasi-dynamic model.
        start: the arm's posture at the start: joint positions in rad and m, or a name: "home" or a
            row of the table of starts for this robot; "auto" is the table's first, or "home" where
            it has none.
        threads: threads of a batch; None takes all cores.
        robot: row of the table of robots; "auto" is the task's.

    Raises:
        UnknownNameError: for a name in no table.
        InvalidParameterError: for a value outside its range.
    """

    task: str
    object: str = "auto"
    solver: str = "fast"
    start_noise: tuple[float, float] = (0.0, 0.0)
    randomize: Mapping[str, Any] | None = None
    escape_field: str | Mapping[str, Any] | None = "auto"
    escape_every: int | None = None
    prior: str | None = "auto"
    goal: tuple[float, float] | None = None
    goal_conditioned: bool | str = False
    action_repeat: int = 1
    preset: str = "default"
    weights: Mapping[str, Any] | None = None
    noise_entry: str = "qp"
    start: str | Sequence[float] = "auto"
    threads: int | None = None
    robot: str = "auto"

    def __post_init__(self):
        make_plain(self)
        task = get_task(self.task)
        for name, own in (("robot", task.robot), ("object", task.object)):
            if getattr(self, name) == "auto":
                object.__setattr__(self, name, own)
        if self.escape_field is not None:
            object.__setattr__(self, "escape_field", resolve_field(self.escape_field, self.robot))
        object.__setattr__(self, "start", checked_start(self.start, self.robot))
        super().__post_init__()
        _ = self.cost_weights, self.contact_model
        object.__setattr__(self, "randomize", check_randomize(self.randomize, self.params))
        for argument, value, known in (
            ("solver", self.solver, SOLVERS),
            ("noise_entry", self.noise_entry, NOISE_ENTRIES),
            ("prior", self.prior, (*PRIORS, "auto", None)),
            ("goal_conditioned", self.goal_conditioned, (False, True, "dense")),
        ):
            check_name(argument, value, known)
        noise = as_floats("start_noise (m, rad)", self.start_noise, (2,), InvalidParameterError)
        if (noise < 0).any() or (noise > START_NOISE_BOUND).any():
            raise InvalidParameterError(
                f"start_noise must be at least 0 and at most {START_NOISE_BOUND[0]:g} m and pi "
                f"rad, "
                f"got {self.start_noise!r}"
            )
        # As JSON would bring them back, so that a round trip gives an equal config.
        object.__setattr__(self, "start_noise", tuple(noise.tolist()))
        if self.goal is not None:
            object.__setattr__(self, "goal", self._checked_goal())
        for name in ("escape_every", "threads"):
            if getattr(self, name) is not None:
                as_count(name, getattr(self, name))
        as_count("action_repeat", self.action_repeat)
        if task.horizon % self.action_repeat:
            raise InvalidParameterError(
                f"action_repeat must divide {task.horizon}, got {self.action_repeat}"
            )
        self._check_field()

    def _checked_goal(self) -> tuple[float, ...]:
        least, most = goal_ring(self.robot, self.object)
        bounds = f"within {most:g} m of the origin" + (
            f" and at least {least:.3g} m from it" if least > 0 else ""
        )
        goal = as_floats(f"goal, (x, y) {bounds},", self.goal, (2,), InvalidParameterError)
        if not least <= np.linalg.norm(goal) <= most:
            raise InvalidParameterError(
                f"goal must be (x, y) {bounds}, where {self.robot!r} can bring {self.object!r}, "
                f"got {self.goal!r}"
            )
        return tuple(goal.tolist())

    def _check_field(self) -> None:
        if not isinstance(self.escape_field, str | Mapping | None):
            raise InvalidParameterError(
                f"escape_field must be a name, a mapping of options with a name, or None, got "
                f"{self.escape_field!r}"
            )
        check_name("escape field", self._field_name, (*FIELDS, None))

    @property
    def _field_name(self) -> str | None:
        if isinstance(self.escape_field, Mapping):
            return self.escape_field.get("name", "grid")
        return self.escape_field

    @classmethod
    def field_names(cls) -> list[str]:
        """Names of all keyword arguments but the task and the robot, which an environment
        decides.
        """
        return [item.name for item in dataclasses.fields(cls) if item.name not in ("task", "robot")]

    @property
    def params(self) -> PlantParams:
        """Plant parameters of an episode of which nothing is drawn."""
        return PlantParams(**{name: getattr(self, name) for name in PARAMETERS})

    @property
    def cost_weights(self) -> CostWeights:
        """Weights of the stage cost."""
        check_name("preset", self.preset, PRESETS)
        base = PRESETS[self.preset][get_task(self.task).kind]
        if not isinstance(self.weights, Mapping | None):
            raise InvalidParameterError(f"weights must map names to numbers, got {self.weights!r}")
        for name, value in (self.weights or {}).items():
            check_name("weight", name, CostWeights._fields)
            check_weight(name, value)
        kinds = base._asdict()  # the kernels want floats where the preset has floats
        return base._replace(
            **{name: type(kinds[name])(value) for name, value in (self.weights or {}).items()}
        )

    @property
    def contact_model(self) -> ContactModel:
        """Settings of the quasi-dynamic model."""
        model = PAPER_MODEL if self.preset in PAPER_PRESETS else ContactModel()
        if self.noise_entry == "state":
            # Displacing the pose makes overlaps, which a stiffer contact would throw back.
            model = model._replace(state_noise=True, compliance=max(model.compliance, 1e-3))
        return model

    @property
    def prior_index(self) -> int:
        """Index of the prior into PRIORS, or -1."""
        prior = self.prior
        if prior == "auto":
            prior = "caging" if self.escape_field is not None else None
        return -1 if prior is None else PRIORS.index(prior)

    def resolve(self) -> Setup:
        """What the model of these arguments is made of; builds nothing."""
        task = get_task(self.task)
        if self.goal is not None:
            task = dataclasses.replace(task, goal=np.asarray(self.goal, dtype=float))
        return Setup(
            task,
            self.robot,
            self.params,
            start_posture(self.start, self.robot),
            self.cost_weights,
            self.prior_index,
            self.escape_field,
            self.escape_every or DEFAULT_ESCAPE_EVERY.get(self._field_name, 1),
            self.start_noise,
            self.randomize or {},
            self.solver,
            self.contact_model,
            self.threads,
            posture_given=not isinstance(self.start, str),
        )

"""Plant parameters and the state of a batch of episodes."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from piec_envs.dynamics.base import CONTROL_PERIOD, INERTIAS, NO_MEMORY
from piec_envs.dynamics.quasi_dynamic import check_first_order
from piec_envs.dynamics.table import DYNAMICS
from piec_envs.episodes.observation import JOINT_BOUND, POSITION_BOUND
from piec_envs.episodes.plain import plain
from piec_envs.errors import InvalidParameterError, InvalidStateError, as_floats, check_name
from piec_envs.world.objects import OBJECTS
from piec_envs.world.robots import Robot

DISTURBANCE_KINDS = ("gaussian", "direction")


@dataclass(frozen=True)
class PlantParams:
    """What may differ between the planner's nominal model and the plant, in one episode.

    Args:
        dynamics: name of the contact dynamics.
        object: name of the object.
        friction: mu between arm and object, at most 5.
        disturbance: sigma of the object's displacement in each step, m, at most 0.05.
        disturbance_kind: "gaussian" (sigma for each axis) or "direction" (length sigma, uniform
            direction: the paper's bound).
        adversary: speed at which the object flees down the escape-time field, as a fraction of
            the field's u_bar, at most 10.
        mass: of the object, as a factor (0.01 to 100) of its nominal one, inertia along with it. The
            quasi-dynamic model is of first order and the same for every mass, so that it takes 1 alone.
        delay: from a command to the drives, s, at most a control step, in steps of 2 ms; until then
            the command before holds. The quasi-dynamic model knows none.
        inertia: how readily the quasi-dynamic model turns the object: "paper" (M_o,theta = 0.042, stiff) or
            "own", as an even solid of its shape. Under MuJoCo it turns as it stands on the table.

    Raises:
        UnknownNameError: for a name in no table.
        InvalidParameterError: for a number outside its range, or a delay, a mass or an object with
            loose bodies under the quasi-dynamic model.
    """

    dynamics: str = "quasi_dynamic"
    object: str = "circle"
    friction: float = 0.5
    disturbance: float = 0.0
    disturbance_kind: str = "gaussian"
    adversary: float = 0.0
    mass: float = 1.0
    delay: float = 0.0
    inertia: str = "paper"

    def __post_init__(self):
        for kind, known in (
            ("dynamics", DYNAMICS),
            ("object", OBJECTS),
            ("disturbance_kind", DISTURBANCE_KINDS),
            ("inertia", INERTIAS),
        ):
            check_name(kind, getattr(self, kind), known)
        for name in _RANGES:
            object.__setattr__(self, name, _number(name, getattr(self, name)))
        if self.dynamics == "quasi_dynamic":
            check_first_order(self.object, self.delay)
            self._check_mass()

    def _check_mass(self) -> None:
        if self.mass != 1.0:
            raise InvalidParameterError(
                f"mass must be 1 under dynamics='quasi_dynamic', which moves every mass alike; got {self.mass:g} "
                "(take dynamics='mujoco', given together with the mass)"
            )

    def replace(self, *changes: Mapping[str, Any]) -> PlantParams:
        """The same parameters with some changed; what they are together is checked once, at the end.

        Args:
            changes: values by name, of which later ones count.

        Raises:
            UnknownNameError: for a parameter that does not exist.
        """
        names = [field.name for field in dataclasses.fields(self)]
        values: dict[str, Any] = {}
        for given in changes:
            if not isinstance(given, Mapping):
                raise InvalidParameterError(f"plant parameters must be a mapping, got {given!r}")
            for name in given:
                check_name("plant parameter", name, names)
            values |= given
        return dataclasses.replace(self, **values)


# What a number may be. Beyond it stands a slip of the unit: an object displaced by its own size in every step, or a
# surface that holds better than rubber on rubber.
_RANGES = {
    "friction": (0.0, 5.0, ""),
    "disturbance": (0.0, 0.05, " m"),
    "adversary": (0.0, 10.0, ""),
    "mass": (0.01, 100.0, ""),
    "delay": (0.0, CONTROL_PERIOD, " s"),
}


def _number(name: str, given: Any) -> float:
    """A plant parameter that is a number, within its range."""
    low, high, unit = _RANGES[name]
    value = plain(given)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and low <= value <= high):
        raise InvalidParameterError(f"{name} must be from {low:g} to {high:g}{unit}, got {given!r}")
    return float(value)


PARAM_KINDS = {field.name: field.type for field in dataclasses.fields(PlantParams)}  # "str" or "float"


def draw_params(randomize: Mapping[str, Sequence], rng: np.random.Generator) -> dict[str, Any]:
    """Draw plant parameters for one episode.

    Args:
        randomize: for each parameter a range [low, high] of numbers, or a list of names.
        rng: source of randomness.

    Returns:
        One value for each parameter named.
    """
    drawn: dict[str, Any] = {}
    for name, choices in randomize.items():
        if isinstance(choices[0], str):
            drawn[name] = str(choices[int(rng.integers(len(choices)))])
        else:
            drawn[name] = float(rng.uniform(choices[0], choices[1]))
    return drawn


def check_randomize(randomize: Mapping[str, Sequence] | None, params: PlantParams) -> dict[str, list]:
    """Validate a `randomize` argument and return it as a plain dict of lists.

    Args:
        randomize: the argument.
        params: what the other parameters are.

    Raises:
        InvalidParameterError: if an entry is neither a range [low, high] nor a list of names, or if values
            that do not fit together could be drawn.
        UnknownNameError: for an unknown parameter or name.
    """
    checked = {}
    if not isinstance(randomize, Mapping | None):
        raise InvalidParameterError(f"randomize must map plant parameters to ranges or lists, got {randomize!r}")
    for name, choices in (randomize or {}).items():
        choices = list(choices) if isinstance(choices, Sequence) and not isinstance(choices, str) else []
        names = bool(choices) and all(isinstance(choice, str) for choice in choices)
        numbers = len(choices) == 2 and all(isinstance(choice, int | float) for choice in choices)
        if not names and not (numbers and choices[0] <= choices[1]):
            raise InvalidParameterError(
                f"randomize[{name!r}] must be a range [low, high] or a list of names, got {randomize[name]!r}"  # type: ignore[index]
            )
        checked[name] = choices
    for drawn in product(*checked.values()):
        params.replace(dict(zip(checked, drawn, strict=True)))
    return checked


@dataclass
class State:
    """Everything that decides how B episodes go on; time index and parameters included.

    Args:
        q_r: joint positions, shape (B, n), rad or m.
        q_cmd: commanded joint positions, shape (B, n).
        pose: object x, y, angle, shape (B, 3), m and rad.
        start: object pose at the start of the episode, shape (B, 3).
        step: steps taken, shape (B,).
        seed: episode seed, from which the disturbance is drawn, shape (B,).
        escape_time: object's escape time, held since its last refresh, shape (B,), s.
        drift: the adversary's displacement in each step, held likewise, shape (B, 2), m.
        error_sum: tracking errors added up over the episode, shape (B,), m.
        diverged: whether the simulation of a row has become unstable; it rests since then, shape (B,).
        params: plant parameters of each row, length B.
        memory: what a row's dynamics needs beside all this to go on, length B; see `Motion`.
    """

    q_r: np.ndarray
    q_cmd: np.ndarray
    pose: np.ndarray
    start: np.ndarray
    step: np.ndarray
    seed: np.ndarray
    escape_time: np.ndarray
    drift: np.ndarray
    error_sum: np.ndarray
    diverged: np.ndarray
    params: list[PlantParams]
    memory: list[np.ndarray]

    @property
    def rows(self) -> int:
        """B, the number of episodes."""
        return len(self.q_r)

    @staticmethod
    def zeros(rows: int, dof: int) -> State:
        """A blank state of the right shapes."""
        return State(
            q_r=np.zeros((rows, dof)),
            q_cmd=np.zeros((rows, dof)),
            pose=np.zeros((rows, 3)),
            start=np.zeros((rows, 3)),
            step=np.zeros(rows, dtype=np.int64),
            seed=np.zeros(rows, dtype=np.int64),
            escape_time=np.zeros(rows),
            drift=np.zeros((rows, 2)),
            error_sum=np.zeros(rows),
            diverged=np.zeros(rows, dtype=bool),
            params=[PlantParams()] * rows,
            memory=[NO_MEMORY] * rows,
        )

    def take(self, rows: Sequence[int] | np.ndarray) -> State:
        """A copy of some rows; a row may be taken more than once."""
        taken: dict[str, Any] = {name: getattr(self, name)[rows] for name in _ARRAYS}
        taken |= {name: [getattr(self, name)[int(i)] for i in rows] for name in _LISTS}
        return State(**taken)

    def check(self, rows: int, robot: Robot) -> None:
        """Refuse a state that could not have come from `rows` episodes of a robot.

        Raises:
            InvalidStateError: if an array has the wrong shape or is not finite, a step is negative, or the object or a
                joint stands where no observation would show it.
        """
        self._check_arrays(rows, robot.dof)
        self._check_places(robot)
        if len(self.params) != rows or not all(isinstance(params, PlantParams) for params in self.params):
            raise InvalidStateError(f"state field 'params' must be {rows} PlantParams, got {self.params!r}")
        if len(self.memory) != rows:
            raise InvalidStateError(f"state field 'memory' must have {rows} arrays, got {len(self.memory)}")
        for memory in self.memory:
            as_floats("state field 'memory'", memory, (np.size(memory),), InvalidStateError)

    def _check_arrays(self, rows: int, dof: int) -> None:
        """Refuse wrong shapes, numbers that are not finite, and counts that are none."""
        blank = State.zeros(rows, dof)
        for name in _ARRAYS:
            if name == "escape_time":  # behind a hard wall it may be infinite
                as_floats("state field 'escape_time'", np.nan_to_num(self.escape_time, posinf=0.0, nan=np.nan),
                          (rows,), InvalidStateError)  # fmt: skip
                continue
            value = as_floats(f"state field {name!r}", getattr(self, name), getattr(blank, name).shape,
                              InvalidStateError)  # fmt: skip
            if name in ("step", "seed") and ((value < 0) | (value != np.floor(value))).any():
                raise InvalidStateError(
                    f"state field {name!r} must be whole numbers of at least 0, got {value.tolist()}"
                )

    def _check_places(self, robot: Robot) -> None:
        """Refuse an object or a joint beyond what an observation holds."""
        for name in ("pose", "start"):
            places = np.asarray(getattr(self, name))[:, :2]
            if (np.abs(places) > POSITION_BOUND).any():
                raise InvalidStateError(
                    f"state field {name!r} must lie within {POSITION_BOUND:g} m of the origin along x and y, "
                    f"got {_worst(places)}"
                )
        lower = robot.joint_array("lower")
        upper = robot.joint_array("upper")
        middle = (upper + lower) / 2
        half = (upper - lower) / 2
        for name in ("q_r", "q_cmd"):
            share = (np.asarray(getattr(self, name)) - middle) / half
            if (np.abs(share) > JOINT_BOUND).any():
                raise InvalidStateError(
                    f"state field {name!r} must stay near the joint limits {lower.tolist()} to {upper.tolist()}, "
                    f"got {_worst(share * half + middle, share)}"
                )

    def copy(self) -> State:
        """An independent copy."""
        return self.take(np.arange(self.rows))


def _worst(rows: np.ndarray, measure: np.ndarray | None = None) -> list[float]:
    """The row of the largest absolute entry, of `rows` themselves or of `measure`."""
    size = np.abs(rows if measure is None else measure).max(axis=1)
    return np.asarray(rows)[int(size.argmax())].tolist()


_LISTS = ("params", "memory")
_ARRAYS = tuple(field.name for field in dataclasses.fields(State) if field.name not in _LISTS)

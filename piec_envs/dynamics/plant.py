"""What may differ between a planner's model and the plant, defined once.

From the fields of `PlantParams` follow the keyword arguments of the environments, what `set_params`
and `randomize` take, what `get_params` tells, and the columns that a batch is simulated with. What
a dynamics cannot vary stands in its row of the table of dynamics.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import product
from typing import Any

import numpy as np

from piec_envs.dynamics.by_row import DYNAMICS, check_moves, check_varies
from piec_envs.dynamics.protocol import CONTROL_PERIOD, INERTIAS, Plant
from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.plain import plain
from piec_envs.world.objects import OBJECTS

DISTURBANCE_KINDS = ("gaussian", "direction")


def _number(default: float, low: float, high: float, unit: str = "") -> Any:
    """A parameter that is a number. Beyond its range stands a slip of the unit, or a surface better
    than rubber.
    """
    return field(default=default, metadata={"low": low, "high": high, "unit": unit})


def _name(default: str, known: Iterable[str]) -> Any:
    """A parameter that names a row of a table."""
    return field(default=default, metadata={"known": known})


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
        adversary_after: time from which it flees, s.
        mass: of the object, as a factor (0.01 to 100) of its nominal one, inertia along with it.
            The quasi-dynamic model is of first order and the same for every mass, so that it takes
            1 alone.
        delay: from a command to the drives, s, at most a control step, in steps of 2 ms; until then
            the command before holds. The quasi-dynamic model knows none.
        inertia: how readily the quasi-dynamic model turns the object: "paper" (M_o,theta = 0.042,
            stiff) or "own", as an even solid of its shape. Under MuJoCo it turns as it stands on
            the table.

    Raises:
        UnknownNameError: for a name in no table.
        InvalidParameterError: for a number outside its range, or what the dynamics cannot vary.
    """

    dynamics: str = _name("quasi_dynamic", DYNAMICS)
    object: str = _name("circle", OBJECTS)
    friction: float = _number(0.5, 0.0, 5.0)
    disturbance: float = _number(0.0, 0.0, 0.05, " m")
    disturbance_kind: str = _name("gaussian", DISTURBANCE_KINDS)
    adversary: float = _number(0.0, 0.0, 10.0)
    adversary_after: float = _number(0.0, 0.0, 1e6, " s")
    mass: float = _number(1.0, 0.01, 100.0)
    delay: float = _number(0.0, 0.0, CONTROL_PERIOD, " s")
    inertia: str = _name("paper", INERTIAS)

    def __post_init__(self):
        for item in PARAMETERS.values():
            value = getattr(self, item.name)
            if "known" in item.metadata:
                check_name(item.name, value, item.metadata["known"])
            else:
                object.__setattr__(self, item.name, _checked_number(item, value))
        for name in DYNAMICS[self.dynamics].fixed:
            item = PARAMETERS[name]
            default = float(item.default)  # type: ignore[arg-type]
            check_varies(self.dynamics, name, getattr(self, name), default, item.metadata["unit"])
        check_moves(self.dynamics, self.object)

    def replace(self, *changes: Mapping[str, Any]) -> PlantParams:
        """The same parameters with some changed; what they are together is checked once, at the
        end.

        Args:
            changes: values by name, of which later ones count.

        Raises:
            UnknownNameError: for a parameter that does not exist.
            InvalidParameterError: for changes that are no mapping, or values that do not fit.
        """
        values: dict[str, Any] = {}
        for given in changes:
            if not isinstance(given, Mapping):
                raise InvalidParameterError(f"plant parameters must be a mapping, got {given!r}")
            for name in given:
                check_name("plant parameter", name, PARAMETERS)
            values |= given
        return dataclasses.replace(self, **values) if values else self


PARAMETERS = {item.name: item for item in dataclasses.fields(PlantParams)}


def _checked_number(item: dataclasses.Field, given: Any) -> float:
    """A plant parameter that is a number, within its range."""
    low = item.metadata["low"]
    high = item.metadata["high"]
    unit = item.metadata["unit"]
    value = plain(given)
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if not (number and low <= value <= high):
        raise InvalidParameterError(
            f"{item.name} must be from {low:g} to {high:g}{unit}, got {given!r}"
        )
    return float(value)


class PlantRows(Sequence[PlantParams]):
    """Plant parameters of the rows of a batch, and what follows from them, derived once.

    Args:
        rows: one for each row.
    """

    def __init__(self, rows: Iterable[PlantParams]):
        self._rows = tuple(rows)
        self._plants = dict[str, Plant]()

    def __len__(self) -> int:
        return len(self._rows)

    def __iter__(self) -> Iterator[PlantParams]:
        return iter(self._rows)

    def __getitem__(self, index: Any) -> Any:
        return self._rows[index]

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Sequence) and self._rows == tuple(other)

    def __hash__(self) -> int:
        return hash(self._rows)

    def __repr__(self) -> str:
        return f"PlantRows({list(self._rows)!r})"

    def __reduce__(self) -> tuple:
        return PlantRows, (self._rows,)

    def take(self, rows: Sequence[int] | np.ndarray) -> PlantRows:
        """Some of them; all of them in their order are these themselves."""
        if len(rows) == len(self) and (
            len(rows) == 1 or np.array_equal(rows, np.arange(len(self)))
        ):
            return self
        return PlantRows(self._rows[int(i)] for i in rows)

    def replaced(
        self, rows: Sequence[int] | np.ndarray, others: Sequence[PlantParams]
    ) -> PlantRows:
        """The same with other parameters in some rows.

        Args:
            rows: numbers of rows.
            others: parameters for each of them.

        Returns:
            New rows; these stay as they are.
        """
        changed = list(self._rows)
        for row, params in zip(rows, others, strict=True):
            changed[int(row)] = params
        return PlantRows(changed)

    @cached_property
    def are_params(self) -> bool:
        """Whether all of them are what they must be."""
        return all(isinstance(params, PlantParams) for params in self._rows)

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """One array for each parameter, shape (B,): numbers, or names as objects."""
        return {
            name: np.array(
                [getattr(params, name) for params in self._rows],
                dtype=object if "known" in item.metadata else float,
            )
            for name, item in PARAMETERS.items()
        }

    @cached_property
    def fleeing(self) -> np.ndarray:
        """Rows whose object flees, as numbers of rows."""
        return np.flatnonzero(self.columns["adversary"] > 0)

    @cached_property
    def disturbed(self) -> bool:
        """Whether any row is displaced at random."""
        return bool(self.columns["disturbance"].any())

    @cached_property
    def by_object(self) -> dict[str, np.ndarray]:
        """Numbers of the rows of each object."""
        names = self.columns["object"]
        return {str(name): np.flatnonzero(names == name) for name in dict.fromkeys(names)}

    def plant(self, robot_name: str) -> Plant:
        """The columns that dynamics simulate with.

        Args:
            robot_name: a row of the table of robots.
        """
        if robot_name not in self._plants:
            columns = self.columns
            self._plants[robot_name] = Plant(
                robot_name,
                [params.object for params in self._rows],
                columns["friction"],
                [params.dynamics for params in self._rows],
                columns["mass"],
                columns["delay"],
                [params.inertia for params in self._rows],
            )
        return self._plants[robot_name]


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


def check_randomize(
    randomize: Mapping[str, Sequence] | None, params: PlantParams
) -> dict[str, list]:
    """Validate a `randomize` argument and return it as a plain dict of lists.

    Args:
        randomize: the argument.
        params: what the other parameters are.

    Returns:
        Choices by name of the parameter; empty for None.

    Raises:
        InvalidParameterError: if an entry is neither a range [low, high] nor a list of names, or if
            values that do not fit together could be drawn.
        UnknownNameError: for an unknown parameter or name.
    """
    checked: dict[str, list] = {}
    if not isinstance(randomize, Mapping | None):
        raise InvalidParameterError(
            f"randomize must map plant parameters to ranges or lists, got {randomize!r}"
        )
    for name, given in (randomize or {}).items():
        choices = list(given) if isinstance(given, Sequence) and not isinstance(given, str) else []
        names = bool(choices) and all(isinstance(choice, str) for choice in choices)
        numbers = len(choices) == 2 and all(isinstance(choice, int | float) for choice in choices)
        if not names and not (numbers and choices[0] <= choices[1]):
            raise InvalidParameterError(
                f"randomize[{name!r}] must be a range [low, high] or a list of names, got {given!r}"
            )
        checked[name] = choices
    for drawn in product(*checked.values()):
        params.replace(dict(zip(checked, drawn, strict=True)))
    return checked

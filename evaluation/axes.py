"""The table of axes: perturbations by their size.

A protocol is one point of an axis: `sigma=0.02` names the one at 0.02 m of the axis `sigma`.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from evaluation.protocol import START_NOISE, Protocol
from piec_envs import InvalidParameterError, check_name


@dataclass(frozen=True)
class Axis:
    """One row of the table of axes.

    Args:
        name: its key in the table.
        label: what tables and figures call it, with the unit.
        scale: from the parameter's unit to the label's, such as 1000 for mm.
        nominal: the value that planners plan with.
        values: where it tells plans apart, growing.
        params: plant parameters at a value.
        start_noise: bounds of the object's start at a value (m, rad); None keeps the env's own.
    """

    name: str
    label: str
    scale: float
    nominal: float
    values: tuple[float, ...]
    params: Callable[[float], Mapping[str, Any]]
    start_noise: Callable[[float], tuple[float, float]] | None = None

    def at(self, value: float) -> Protocol:
        """The protocol at a value, in the parameter's unit.

        Args:
            value: in the parameter's unit: m, s, or none.

        Returns:
            The protocol.
        """
        noise = None if self.start_noise is None else self.start_noise(value)
        said = f"{self.label.partition(' [')[0]} is {self.scale * value:g}"
        return Protocol(f"{self.name}={value:g}", said, self.params(value), noise)

    def described(self) -> str:
        """What it is, its unit as VALUE has it, and where it tells plans apart."""
        what, _, shown = self.label.partition(" [")
        unit = {"mm]": " m", "ms]": " s"}.get(shown, "")
        return f"{what}, such as {self.values[0]:g} to {self.values[-1]:g}{unit}"


def _drawn(value: float) -> tuple[float, float]:
    """Starts as protocols draw them, whatever the value."""
    return START_NOISE


AXES = {
    row.name: row
    for row in (
        Axis(
            "sigma", "displacement in each step, sigma [mm]", 1e3, 0.0,
            (0.0, 0.0025, 0.005, 0.0075, 0.01, 0.015, 0.02, 0.025, 0.03, 0.035, 0.04),
            lambda value: {"disturbance": value, "disturbance_kind": "gaussian"},
        ),
        Axis(
            "flee", "flee speed, share of u_bar", 1.0, 0.0,
            (0.0, 0.05, 0.1, 0.2, 0.3, 0.4, 0.6, 0.8, 1.0, 1.25, 1.5),
            lambda value: {"adversary": value}, _drawn,
        ),
        Axis(
            "friction", "friction between arm and object", 1.0, 0.5,
            (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 1.0, 1.25, 1.5),
            lambda value: {"friction": value}, _drawn,
        ),
        Axis(
            "start", "displacement of the start [mm]", 1e3, 0.0,
            (0.0, 0.005, 0.01, 0.015, 0.02, 0.03, 0.04, 0.05, 0.06),
            lambda value: {}, lambda value: (value, 0.0),
        ),
        Axis(
            "delay", "delay of the drives under MuJoCo [ms]", 1e3, 0.0,
            (0.0, 0.02, 0.04, 0.06, 0.08, 0.1),
            lambda value: {"dynamics": "mujoco", "delay": value}, _drawn,
        ),
        Axis(
            "mass", "mass of the object under MuJoCo, times its own", 1.0, 1.0,
            (0.25, 0.5, 1.0, 1.5, 2.0, 3.0, 5.0),
            lambda value: {"dynamics": "mujoco", "mass": value}, _drawn,
        ),
    )
}  # fmt: skip


def get_axis(name: str) -> Axis:
    """The axis of that name.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("axis", name, AXES)
    return AXES[name]


def protocol_at(name: str) -> Protocol:
    """The protocol of a name such as `sigma=0.02`.

    Raises:
        UnknownNameError: for an unknown axis.
        InvalidParameterError: for a value that is no number.
    """
    axis, _, text = name.partition("=")
    try:
        value = float(text)
    except ValueError:
        raise InvalidParameterError(
            f"a protocol AXIS=VALUE needs a number behind the sign, got {name!r}"
        ) from None
    return get_axis(axis).at(value)

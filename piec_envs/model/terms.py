"""The terms of an observation and the measures of a state: their names, places, bounds and units,
each listed once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from piec_envs.dynamics.protocol import POSITION_LIMIT
from piec_envs.world.robots import Robot

POSITION_BOUND = POSITION_LIMIT  # m; positions are clipped here so that the space is bounded
JOINT_BOUND = 1.5  # joint positions over their limits; a pressed joint can pass its limit a little


class Tracking(Protocol):
    """What a task says of itself here."""

    @property
    def tracks(self) -> bool:
        """Whether the object is to be moved along a reference."""
        ...


@dataclass(frozen=True)
class Term:
    """A part of an observation.

    Args:
        name: its key in the layout.
        size: how many entries it has for a robot and a task; 0 leaves it out.
        bound: largest absolute value of its entries, a number or one for each entry, given the
            robot.
        unit: of its entries.
        meaning: in words.
        write: what computes it, shape (B, size), from the state, the task and the robot; None for
            the terms that `observe_rows` writes.
    """

    name: str
    size: Callable[[Robot, Tracking], int]
    bound: Callable[[Robot], Any]
    unit: str
    meaning: str
    write: Callable[[Any, Any, Robot], np.ndarray] | None = None


def _joints(robot: Robot, task: Tracking) -> int:
    return robot.dof


def _turning(robot: Robot, task: Tracking) -> int:
    return robot.dof - robot.base_dof


def _reference(robot: Robot, task: Tracking) -> int:
    return 2 * task.tracks


def _object_bound(robot: Robot) -> list[float]:
    place = POSITION_BOUND * (2 if robot.base_dof else 1)
    return [place, place, 1.0, 1.0]


_UNIT = 1.0
TERMS: list[Term] = [
    Term("cos_q", _turning, lambda robot: _UNIT, "", "cosine of each joint that turns"),
    Term("sin_q", _turning, lambda robot: _UNIT, "", "sine of each joint that turns"),
    Term(
        "q_r",
        _joints,
        lambda robot: JOINT_BOUND,
        "",
        "joints over their limits: -1 is the lower, 1 the upper",
    ),
    Term("q_cmd", _joints, lambda robot: JOINT_BOUND, "", "commanded joints, likewise"),
    Term(
        "object",
        lambda robot, task: 4,
        _object_bound,
        "m",
        "x, y from the base, cosine and sine of the angle",
    ),
    Term("goal", lambda robot, task: 2, lambda robot: 2 * POSITION_BOUND, "m", "goal minus object"),
    Term(
        "reference",
        _reference,
        lambda robot: 2 * POSITION_BOUND,
        "m",
        "reference of the next step minus object",
    ),
    Term("time", lambda robot, task: 1, lambda robot: _UNIT, "", "step over horizon"),
]
# places in TERMS of those that the kernel writes
COS_Q, SIN_Q, Q_R, Q_CMD, OBJECT, GOAL, REFERENCE, TIME = range(8)


class Layout(NamedTuple):
    """Where the terms of one robot and task stand in an observation."""

    slices: dict[str, slice]  # places of the terms in it, by name
    bound: np.ndarray  # (size,) largest absolute values
    # (terms,) int64, first entry of each term of TERMS; -1 where it is left out
    offsets: np.ndarray
    written: tuple[Term, ...]  # terms that no kernel writes

    @property
    def size(self) -> int:
        """Entries of an observation."""
        return len(self.bound)


def observation_layout(robot: Robot, task: Tracking) -> Layout:
    """Names, places and bounds of the entries of an observation.

    Args:
        robot: the robot.
        task: the task.

    Returns:
        The layout, in the order of TERMS.
    """
    slices: dict[str, slice] = {}
    bounds: list[np.ndarray] = []
    offsets: list[int] = []
    first = 0
    for term in TERMS:
        size = int(term.size(robot, task))
        offsets.append(first if size else -1)
        if size:
            slices[term.name] = slice(first, first + size)
            bounds.append(np.broadcast_to(np.asarray(term.bound(robot), dtype=float), (size,)))
            first += size
    written = tuple(term for term in TERMS if term.write is not None and term.name in slices)
    return Layout(slices, np.concatenate(bounds), np.array(offsets, dtype=np.int64), written)


class Measure(NamedTuple):
    """A number measured of each state."""

    name: str  # as in MEASURES
    unit: str  # "" without one
    meaning: str  # in a few words


MEASURES: tuple[Measure, ...] = (
    Measure("goal_distance", "m", "from the object's centre to the goal"),
    Measure("d2g", "m", "from the object's centre to the goal region"),
    Measure("min_distance", "m", "signed distance of the nearest link"),
    Measure("mean_distance", "m", "mean signed distance over the links"),
    Measure("penetration", "m", "depth of the deepest overlap"),
    Measure("tracking_error", "m", "from the object's centre to the reference of this time"),
    Measure("cost_task", "m^2 or m", "task term of the stage cost"),
    Measure("cost_command", "rad^2/s^2", "command term of the stage cost"),
    Measure("cost_prior", "", "prior term of the stage cost"),
    Measure("cost", "", "stage cost, weighted"),
)
MEASURE_COLUMNS = {measure.name: i for i, measure in enumerate(MEASURES)}

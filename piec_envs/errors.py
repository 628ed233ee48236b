"""Exceptions of the suite: each says what was given and what would be valid."""

from __future__ import annotations

import difflib
import math
from collections.abc import Iterable

import numpy as np
from gymnasium.error import ResetNeeded

from piec_envs.versions import install_command

FEW = 4096  # numbers whose squares are added on the calling thread


class PiecError(Exception):
    """Base class of every error that this suite raises on purpose."""


class UnknownNameError(PiecError, ValueError):
    """A name that stands in no table; the message lists the known ones.

    Args:
        kind: what the name was meant to name, such as "object".
        name: the name given.
        known: the valid names.
    """

    def __init__(self, kind: str, name: object, known: Iterable[object]):
        self._given: tuple = (kind, name, tuple(known))
        super().__init__(f"unknown {kind} {name!r}; {_choices(name, self._given[2])}")

    def __reduce__(self):
        return type(self), self._given  # so that it crosses process borders


def _choices(name: object, known: Iterable[object]) -> str:
    """The known names, and the one that was probably meant."""
    names = sorted(map(str, known))
    close = closest(name, names)
    hint = f" Did you mean {close!r}?" if close is not None else ""
    return f"known: {', '.join(names)}.{hint}"


def closest(name: object, known: Iterable[str]) -> str | None:
    """The known name that was probably meant, upper and lower case alike; None if none comes near.

    Args:
        name: the name given.
        known: the valid names.

    Returns:
        The known name, or None.
    """
    plain = str(name).casefold()
    by_plain: dict[str, str] = {}
    for one in known:
        by_plain.setdefault(one.casefold(), one)
        by_plain.setdefault(one.casefold().rpartition("/")[2], one)  # an id without its namespace
    close = difflib.get_close_matches(plain, by_plain, n=1)
    return by_plain[close[0]] if close else None


def check_name(kind: str, name: object, known: Iterable[object]) -> None:
    """Refuse a name that is not one of the known ones.

    Args:
        kind: what the name was meant to name.
        name: the name given; anything, also what has no hash.
        known: the valid names.

    Raises:
        UnknownNameError: if it is not among them.
    """
    known = tuple(known)
    if name not in known:
        raise UnknownNameError(kind, name, known)


class UnknownArgumentError(UnknownNameError, TypeError):
    """A keyword argument that does not exist, said as Python itself says it; the message lists the
    valid ones.

    Args:
        name: the name given, or, without `known`, the whole message: Gymnasium makes the error
            again of its text.
        known: the valid names.
    """

    def __init__(self, name: str, known: Iterable[str] | None = None):
        if known is None:
            self._given = (name,)
            text = name
        else:
            known = tuple(known)
            self._given = (name, known)
            text = f"got an unexpected keyword argument {name!r}; {_choices(name, known)}"
        PiecError.__init__(self, text)


def check_arguments(given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse keyword arguments that do not exist.

    Args:
        given: their names.
        known: the valid names.

    Raises:
        UnknownArgumentError: for the first that is not among them.
    """
    known = tuple(known)
    for name in given:
        if name not in known:
            raise UnknownArgumentError(name, known)


class InvalidShapeError(PiecError, ValueError):
    """A polygon that is not convex, not counter-clockwise, or has a negative radius."""


class InvalidActionError(PiecError, ValueError):
    """An action of the wrong shape, or with NaN or infinite entries."""


class InvalidObservationError(InvalidActionError):
    """What cannot be an observation of the environment, so that no action follows from it."""


class InvalidStateError(PiecError, ValueError):
    """A state of the wrong shape, not finite, outside its limits, or in penetration."""


class ResetNeededError(PiecError, ResetNeeded):
    """An episode that has not begun was to be stepped, drawn or saved; Gymnasium's `ResetNeeded`
    too.
    """


class InvalidParameterError(PiecError, ValueError):
    """A keyword argument or plant parameter outside its valid range."""


class PlanError(PiecError, ValueError):
    """A plan file that is broken or foreign, or a plan for another env."""


class AgentError(PiecError, ValueError):
    """A trained agent or its checkpoint that is missing, broken, foreign, or made for another env
    or training.
    """


class WeightsError(PiecError, ValueError):
    """A weight file of a learned field that is missing, broken, or made for another robot."""


class MeshError(PiecError, ValueError):
    """A mesh file that is missing, or not the one that the suite was made with."""


class DistanceFieldError(PiecError, ValueError):
    """A file of a robot distance field that is missing, broken, or made from other meshes."""


class RenderingError(PiecError, RuntimeError):
    """Frames that cannot be drawn on this machine."""


class RecordError(PiecError, ValueError):
    """A record file that cannot be read."""


class EngineError(PiecError, RuntimeError):
    """Workers that cannot be started, that are lost again and again, or that have other versions
    installed.
    """


class ShadowedPackageError(PiecError, ImportError):
    """A file of the user's that Python takes for a package of this suite."""


def all_finite(array: np.ndarray) -> bool:
    """Whether no number of an array is infinite or none.

    One sum tells it quickly, unless it is too large: of the squares where there are few. A dot
    product of many would wake the threads of BLAS, which then keep the other cores busy for long.

    Args:
        array: of floats.
    """
    flat = array.ravel()
    if len(flat) <= FEW:
        total = np.vdot(flat, flat)  # which, unlike @, says nothing about squares too large
    else:
        with np.errstate(over="ignore", invalid="ignore"):
            total = np.add.reduce(flat)
    return math.isfinite(total) or bool(np.isfinite(array).all())


def as_floats(
    name: str, value: object, shape: tuple[int, ...], error: type[PiecError]
) -> np.ndarray:
    """A finite array of the given shape, as a copy.

    Args:
        name: what the value is called.
        value: anything that NumPy can make an array of numbers from.
        shape: the only valid shape.
        error: what is raised otherwise.

    Returns:
        Shape `shape`, float64.

    Raises:
        PiecError: of that class, if the value is no array of numbers of that shape, or not finite.
    """
    if (
        type(value) is np.ndarray
        and value.dtype == np.float64
        and value.shape == shape
        and all_finite(value)
    ):
        return value.copy()
    try:
        given = np.asarray(value)
        if given.dtype.kind not in "biufO":  # NumPy would read numbers out of text
            raise TypeError(f"{given.dtype} is no type of numbers")
        array = np.array(given, dtype=float)
    except (TypeError, ValueError) as cause:
        raise error(f"{name} must be numbers of shape {shape}, got {value!r}") from cause
    if array.shape != shape:
        raise error(f"{name} must have shape {shape}, got {array.shape}")
    if not all_finite(array):
        raise error(f"{name} must be finite, got {array.tolist()}")
    return array


def as_count(name: str, value: object, least: int = 1) -> int:
    """A whole number of at least `least`, from an int or a NumPy integer.

    Args:
        name: what the value is called.
        value: anything.
        least: the smallest valid number.

    Returns:
        The number as an int.

    Raises:
        InvalidParameterError: otherwise, True and False included.
    """
    if (
        isinstance(value, bool | np.bool_)
        or not isinstance(value, int | np.integer)
        or value < least
    ):
        raise InvalidParameterError(
            f"{name} must be a whole number of at least {least}, got {value!r}"
        )
    return int(value)


class MissingDependencyError(PiecError, ImportError):
    """An optional package is not installed; the message names the extra that brings it.

    Args:
        package: the import name of the missing package.
        extra: the extra of this distribution that installs it.
        instead: what can be done without it, as half a sentence.
    """

    def __init__(self, package: str, extra: str, instead: str = ""):
        self._given = (package, extra, instead)
        self.extra = extra
        super().__init__(
            f"{package!r} is not installed; it comes with the extra {extra!r}: "
            f"{install_command(extra)}" + (f", or {instead}" if instead else "")
        )

    def __reduce__(self):
        return type(self), self._given

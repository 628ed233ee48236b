"""Values that compiled code keeps: a named tuple of arrays that is taken apart once, not at every
call.

Numba takes a tuple apart into its arrays whenever Python hands it over, about 0.1 us for each
array: more than a step of a single environment takes. A held value is handed over as one pointer.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Any

from numba.core import types
from numba.experimental import structref

from piec_envs.kernels import batch_kernel


@structref.register
class _HeldType(types.StructRef):  # type: ignore[name-defined]
    """Numba's type of a held value."""

    def preprocess_fields(self, fields: Any) -> Any:
        """Types without the values that some of them name."""
        plain: Any = types
        return tuple((name, plain.unliteral(kind)) for name, kind in fields)


class Held(structref.StructRefProxy):
    """A value that compiled code keeps; kernels read it as `held.value`."""


structref.define_constructor(Held, _HeldType, ["value"])
structref.define_attributes(_HeldType)
structref.define_boxing(_HeldType, Held)


@batch_kernel
def hold(value):
    """Keep a value.

    Args:
        value: a named tuple of arrays and numbers, of other such tuples too; the arrays are shared,
            not copied.

    Returns:
        A `Held`, for kernels called from Python.
    """
    return Held(value)


class PerThread(threading.local):
    """A held value with scratch in it, of which each thread has its own.

    Args:
        make: makes one, a `Held`.
    """

    def __init__(self, make: Callable[[], Held]):
        self._make = make
        self._held: Held | None = None

    @property
    def held(self) -> Held:
        """This thread's."""
        if self._held is None:
            self._held = self._make()
        return self._held


class Keeper:
    """A value, and the same held from its first use on; copies and pickles hold it anew.

    Args:
        value: as in `hold`.
    """

    def __init__(self, value: Any):
        self.value = value
        self._held: Held | None = None

    @property
    def held(self) -> Held:
        """The value for kernels."""
        if self._held is None:
            self._held = hold(self.value)
        return self._held

    def __deepcopy__(self, memo: dict) -> Keeper:
        return Keeper(self.value)

    def __reduce__(self) -> tuple:
        return Keeper, (self.value,)

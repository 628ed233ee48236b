"""Keyword arguments as JSON would bring them back."""

from __future__ import annotations

import dataclasses
import os
from collections.abc import Mapping
from enum import Enum
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """A value without NumPy, enumerations and paths, as far as it is made of them; what is
    something else stays.

    Args:
        value: anything, such as keyword arguments with arrays in them.

    Returns:
        Arrays as lists, NumPy scalars as Python's, mappings as dicts, members of an enumeration as
        their values, types of entries and paths as text, also inside of lists, tuples and mappings.
    """
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Mapping):
        return {name: plain(item) for name, item in value.items()}
    if type(value) in (list, tuple):
        return type(value)(plain(item) for item in value)
    if isinstance(value, Enum):
        return value.value
    if isinstance(value, np.dtype):
        return value.name
    return os.fspath(value) if isinstance(value, os.PathLike) else value


def make_plain(item: Any) -> None:
    """Take the fields of a frozen dataclass, while it is made, for what NumPy's numbers and arrays
    stand for.

    Args:
        item: the dataclass; see `plain` for what becomes of its fields.
    """
    for field in dataclasses.fields(item):
        object.__setattr__(item, field.name, plain(getattr(item, field.name)))

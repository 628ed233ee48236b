"""What a kept table is found by: a version, and a digest of all that is given to what
computes it.
"""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from typing import Any

import numpy as np

# of the numbers in a table: raised with every change of code that moves them, which a test notices
VERSION = 1


def table_key(*inputs: Any) -> str:
    """Digest of what a table is computed from.

    Args:
        inputs: numbers, arrays, and tuples of them.

    Returns:
        SHA-256, in hexadecimal digits.
    """
    digest = hashlib.sha256(f"{VERSION} {sys.byteorder}".encode())
    for item in _leaves(inputs):
        array = np.asarray(item, dtype=float) + 0.0  # which leaves no negative zeros
        digest.update(f" {array.shape} ".encode() + array.tobytes())
    return digest.hexdigest()


def _leaves(item: Any) -> Iterator[Any]:
    if isinstance(item, tuple | list):
        for part in item:
            yield from _leaves(part)
    else:
        yield item

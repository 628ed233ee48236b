"""How this suite compiles its kernels.

A `batch_kernel` is called from Python with a row range: it allocates its scratch once and loops.
A `kernel` is called by other kernels and owns no memory: it is compiled without Numba's reference
counting, whose atomic increments for every array of a packed scene cost ten times the arithmetic.
A `lane_kernel` is a `kernel` whose inner loops run over a fixed number of lanes, so that every lane
goes through the same instructions; it may fuse a product and a sum into one rounding.
All release the GIL, follow IEEE rules for division, and are cached on disk where some folder can be
written. There is no other fastmath: row i of a batch must be bit-equal to a batch of one.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import Any

from numba import njit

from piec_envs.compilation import announce_compilation
from piec_envs.console import note


def _compiled(function: Callable, **options: Any) -> Any:
    """A function compiled with Numba's options, and kept on disk where that can be."""
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError as error:  # Numba finds no folder that it can write
        if "cannot cache" not in str(error):
            raise
        _say_unkept()
        return njit(**options)(function)


@cache
def _say_unkept() -> None:
    note(
        "neither the installation nor a home folder can be written, so that every process compiles "
        "for minutes; set NUMBA_CACHE_DIR to a folder that keeps what is compiled"
    )


batch_kernel = partial(_compiled, nogil=True, error_model="numpy")
kernel = partial(_compiled, nogil=True, error_model="numpy", _nrt=False)
lane_kernel = partial(_compiled, nogil=True, error_model="numpy", _nrt=False, fastmath={"contract"})
announce_compilation()

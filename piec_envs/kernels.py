"""How this suite compiles its kernels.

A `batch_kernel` is called from Python with a row range: it allocates its scratch once and loops.
A `kernel` is called by other kernels and owns no memory: it is compiled without Numba's reference
counting, whose atomic increments for every array of a packed scene cost ten times the arithmetic.
One whose name begins with an underscore cannot be called from Python: what converts the arguments
would take longer to compile than the kernel.
An `inlined_kernel` is a `kernel` that becomes part of its caller: a packed scene with its scratch
has some 400 words, and each call copies all of them. It is for what is called at one or two places.
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
from numba.core.caching import FunctionCache

from piec_envs.compilation import announce_compilation
from piec_envs.console import note


class _Cache(FunctionCache):
    """Kernels on disk; those of another version, whose argument types may have moved or gone, are
    made again.
    """

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled kernel, None where there is none that fits."""
        try:
            return super().load_overload(sig, target_context)
        # Numba unpickles its index before it looks at the file's date
        except (AttributeError, ImportError):
            self.flush()
            return None


def _compiled(function: Callable, **options: Any) -> Any:
    """A function compiled with Numba's options, and kept on disk where that can be."""
    options["no_cfunc_wrapper"] = True  # no kernel is an argument of another
    try:
        dispatcher = njit(cache=True, **options)(function)
        dispatcher._cache = _Cache(function)
        return dispatcher
    except RuntimeError as error:  # Numba finds no folder that it can write
        if "cannot cache" not in str(error):
            raise
        _say_unkept()
        return njit(**options)(function)


def _inner(function: Callable, **options: Any) -> Any:
    """A function that kernels call; Python can do so if its name has no leading underscore."""
    if not function.__name__.startswith("_"):
        return _compiled(function, **options)

    compiled = _compiled(function, no_cpython_wrapper=True, **options)
    # Numba would jump to the entry that is not there.
    compiled._insert = lambda signature, entry, object_mode: None
    compiled._compile_for_args = partial(_refuse, f"{function.__module__}.{function.__name__}")
    return compiled


def _refuse(name: str, *args: Any, **kwargs: Any) -> None:
    """What Python gets from a kernel that is made for other kernels alone."""
    raise TypeError(f"{name} is called by other kernels alone")


@cache
def _say_unkept() -> None:
    note(
        "neither the installation nor a home folder can be written, so that every process compiles "
        "for minutes; set NUMBA_CACHE_DIR to a folder that keeps what is compiled"
    )


batch_kernel = partial(_compiled, nogil=True, error_model="numpy")
kernel = partial(_inner, nogil=True, error_model="numpy", _nrt=False)
inlined_kernel = partial(kernel, forceinline=True)
lane_kernel = partial(kernel, fastmath={"contract"})
announce_compilation()

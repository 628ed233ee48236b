"""Split the rows of a batched kernel over threads.

Kernels are serial and release the GIL, and each row's arithmetic does not depend on the split, so
results are the same for every number of threads.
"""

from __future__ import annotations

import os
import sys
import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor

COMPILE_NOTICE_SECONDS = 1.5  # loading a cached kernel takes less, compiling one takes longer
_compiled: set[Callable] = set()
_pool: ThreadPoolExecutor | None = None


def _forget_pool() -> None:
    """A forked child has no threads: let it make its own pool."""
    global _pool
    _pool = None


os.register_at_fork(after_in_child=_forget_pool)


def available_threads() -> int:
    """Number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_rows(kernel: Callable, rows: int, threads: int | None, *args) -> None:
    """Call `kernel(lo, hi, *args)` over row ranges that together cover all rows.

    Args:
        kernel: compiled with `nogil=True`; writes its results into arrays among `args`.
        rows: number of rows.
        threads: number of threads; None takes all cores of this process.
        args: the kernel's other arguments, the same for every range.
    """
    threads = 1 if rows <= 1 else min(threads or available_threads(), rows)
    if kernel not in _compiled:  # the first call compiles; do it once, with a word to the user
        _announce_if_slow(kernel, *args)
    if threads <= 1:
        kernel(0, rows, *args)
        return
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(available_threads(), thread_name_prefix="piec")
    bounds = [rows * i // threads for i in range(threads + 1)]
    jobs = [_pool.submit(kernel, lo, hi, *args) for lo, hi in zip(bounds[1:-1], bounds[2:], strict=True)]
    kernel(bounds[0], bounds[1], *args)
    for job in jobs:
        job.result()


def _announce_if_slow(kernel: Callable, *args) -> None:
    """Compile on an empty range; say so if the compiled code was not in the cache."""
    name = getattr(kernel, "__name__", "kernel")
    notice = threading.Timer(
        COMPILE_NOTICE_SECONDS,
        lambda: print(f"piec_envs: compiling {name} (first use only)", file=sys.stderr, flush=True),
    )
    notice.daemon = True
    notice.start()
    try:
        kernel(0, 0, *args)
    finally:
        notice.cancel()
    _compiled.add(kernel)

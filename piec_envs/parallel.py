"""Split the rows of a batched kernel over threads.

Kernels are serial and release the GIL, and each row's arithmetic does not depend on the split, so
results are the same for every number of threads.
"""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager

from piec_envs.console import note

NOTICE_SECONDS = 1.5
# us of work on one core below which a second thread, which takes about 100 us to wake and to be
# waited for, costs more than it brings
WORTH_THREADS = 400.0
_compiled: set[Callable] = set()
_pool: ThreadPoolExecutor | None = None


def _forget_pool() -> None:
    """A forked child has no threads: let it make its own pool."""
    global _pool
    _pool = None


if hasattr(os, "register_at_fork"):  # Windows has no forks
    os.register_at_fork(after_in_child=_forget_pool)


def available_threads() -> int:
    """Number of cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def run_rows(
    kernel: Callable, rows: int, threads: int | None, *args, work: float = math.inf
) -> None:
    """Call `kernel(lo, hi, *args)` over row ranges that together cover all rows.

    Args:
        kernel: compiled with `nogil=True`; writes its results into arrays among `args`.
        rows: number of rows.
        threads: number of threads; None takes all cores of this process.
        args: the kernel's other arguments, the same for every range.
        work: of all rows together on one core, about, us; little work is not shared.
    """
    threads = 1 if rows <= 1 or work < WORTH_THREADS else min(threads or available_threads(), rows)
    if kernel not in _compiled:  # the first call compiles: once, not in every thread
        kernel(0, 0, *args)
        _compiled.add(kernel)
    if threads <= 1:
        kernel(0, rows, *args)
        return
    global _pool
    if _pool is None:
        _pool = ThreadPoolExecutor(available_threads(), thread_name_prefix="piec")
    bounds = [rows * i // threads for i in range(threads + 1)]
    jobs = [
        _pool.submit(kernel, lo, hi, *args) for lo, hi in zip(bounds[1:-1], bounds[2:], strict=True)
    ]
    kernel(bounds[0], bounds[1], *args)
    for job in jobs:
        job.result()


@contextmanager
def notice(text: str) -> Iterator[None]:
    """Say on stderr what is going on if the body takes longer than NOTICE_SECONDS."""
    timer = threading.Timer(NOTICE_SECONDS, lambda: note(text))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()

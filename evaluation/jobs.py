"""Work that fans out: one function over JSON specs and integer seeds, never over live envs.

The function is importable and called as `function(spec, seed, context)`, in this process or in
workers; what it returns is JSON. So the same call runs on one core, on all cores (joblib's loky),
on whatever backend `joblib.parallel_config` has set (Dask), or on anything with `submit`
(concurrent.futures, and the engines of `evaluation.engines`), and the results are the same
everywhere.
"""

from __future__ import annotations

import os
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import Any

from tqdm import tqdm

from evaluation.records import RecordFile, make_record, work_key
from evaluation.reuse import current_ledger
from piec_envs import EngineError, InvalidParameterError, UnknownNameError, console, provenance

POLL_SECONDS = 0.05  # between two looks at an executor's futures
RETRIES = 3  # how often what a lost worker had in hand is begun anew


@dataclass(frozen=True)
class Context:
    """What a piece of work is told beside its spec; it must not change the result.

    Args:
        folder: where its files go.
        threads: how many it may use; None is all cores.
        progress: whether it may show a progress bar of its own.
    """

    folder: str = ""
    threads: int | None = None
    progress: bool = False


@dataclass(frozen=True)
class Work:
    """One piece of work.

    Args:
        spec: what to do, JSON values.
        seed: its seed.
        label: what the progress bar calls it.
    """

    spec: Mapping[str, Any]
    seed: int = 0
    label: str = ""

    @property
    def key(self) -> str:
        """Key of its record."""
        return work_key(self.spec, self.seed)


def function_name(function: str | Callable) -> str:
    """`module:function` of a function that workers can import."""
    return (
        function if isinstance(function, str) else f"{function.__module__}:{function.__qualname__}"
    )


def resolve(name: str) -> Callable[..., Any]:
    """The function called `module:function`.

    Raises:
        UnknownNameError: if there is none.
    """
    module, _, attribute = name.partition(":")
    try:
        return getattr(import_module(module), attribute)
    except (ImportError, AttributeError, ValueError) as error:
        raise UnknownNameError("function", name, ["module:function"]) from error


def call(
    name: str, spec: Mapping[str, Any], seed: int, context: Context
) -> tuple[Any, float, dict[str, Any]]:
    """Do one piece of work; this is what workers run.

    Args:
        name: `module:function` of what does it, a function of (spec, seed, context).
        spec: what to do, JSON values.
        seed: its seed.
        context: what it is told beside that.

    Returns:
        The result, the seconds it took, and the sources of this very process: a worker that is
        begun while the tree is edited has others than the process that began it.
    """
    here = provenance.source()
    function = resolve(name)
    begin = time.perf_counter()
    result = function(dict(spec), seed, context)
    return result, time.perf_counter() - begin, here


def run_jobs(
    function: str | Callable, works: Sequence[Work], jobs: Any = 1, context: Context | None = None
) -> Iterator[tuple[Work, Any, float]]:
    """Do all pieces of work.

    Args:
        function: `module:function`, or a function of a module, of (spec, seed, context).
        works: what to do.
        jobs: 1 for a plain loop in this process, which leaves all threads to each piece of work;
            more for that many joblib workers with one thread each; or an executor: its
            `submit(function, *args)` returns something with `done()` and `result()`, and it is
            handed no more than `limit` pieces at once, if it has this attribute.
        context: for every piece of work; workers get one thread and no progress bar, and the folder
            as an absolute path, since they may run elsewhere.

    Yields:
        Each piece of work with its result and seconds, as they arrive.

    Raises:
        InvalidParameterError: if `jobs` is none of these.
        EngineError: if workers are lost again and again.
    """
    for work, result, seconds, _ in _done(function, works, jobs, context):
        yield work, result, seconds


Done = tuple[Work, Any, float, dict[str, Any]]  # with what `call` returns


def _done(
    function: str | Callable, works: Sequence[Work], jobs: Any, context: Context | None
) -> Iterator[Done]:
    """`run_jobs`, with the sources of the process that did each piece."""
    name = function_name(function)
    context = context or Context()
    folder = os.path.abspath(context.folder) if context.folder else ""
    alone = replace(context, folder=folder, threads=1, progress=False)
    if hasattr(jobs, "submit"):
        yield from _run_submitted(name, works, jobs, alone)
    elif not isinstance(jobs, int) or isinstance(jobs, bool) or jobs < 1:
        raise InvalidParameterError(
            f"jobs must be a whole number of at least 1 or have `submit`, got {jobs!r}"
        )
    elif jobs == 1:
        for work in works:
            yield work, *call(name, work.spec, work.seed, context)
    else:
        yield from _run_joblib(name, works, jobs, alone)


def say(text: str) -> None:
    """One line on the standard error, above the progress bar."""
    tqdm.write(f"piec: {text}", file=sys.stderr)


def _run_joblib(name: str, works: Sequence[Work], jobs: int, context: Context) -> Iterator[Done]:
    """What is left is begun anew with new workers when one of them was killed, for instance for its
    memory.
    """
    left = dict(enumerate(works))
    losses = 0
    while left:
        try:
            for index, *answer in _joblib_results(name, left, jobs, context):
                losses = 0
                yield left.pop(index), *answer
        except BrokenProcessPool as error:  # joblib's TerminatedWorkerError is one
            losses += 1
            if losses > RETRIES:
                raise EngineError(
                    f"a worker was lost {losses} times in a row and nothing got done; if memory "
                    f"is short, take "
                    "fewer jobs. What is recorded is kept: run the same again to go on"
                ) from error
            say(f"a worker was lost; what is left is begun anew ({losses} of {RETRIES})")


def _indexed_call(index: int, *arguments: Any) -> tuple[Any, ...]:
    return index, *call(*arguments)


def _joblib_results(
    name: str, works: Mapping[int, Work], jobs: int, context: Context
) -> Iterator[tuple[Any, ...]]:
    import joblib

    delayed = joblib.delayed(_indexed_call)
    calls = [delayed(i, name, dict(work.spec), work.seed, context) for i, work in works.items()]
    try:
        parallel = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)
        pieces = [calls]
    # this backend hands back nothing before everything is done: give it little at a time
    except ValueError:
        parallel = joblib.Parallel(n_jobs=jobs, batch_size=1)
        pieces = [calls[lo : lo + jobs] for lo in range(0, len(calls), jobs)]
    for piece in pieces:
        yield from parallel(piece)


def _run_submitted(
    name: str, works: Sequence[Work], executor: Any, context: Context
) -> Iterator[Done]:
    limit = getattr(executor, "limit", len(works))
    todo = iter(works)
    waiting: dict[Any, Work] = {}
    while True:
        for work in islice(todo, limit - len(waiting)):
            waiting[executor.submit(call, name, dict(work.spec), work.seed, context)] = work
        if not waiting:
            return
        done = [future for future in waiting if future.done()]
        for future in done:
            yield waiting.pop(future), *future.result()
        if not done:
            time.sleep(POLL_SECONDS)


def run_recorded(
    function: str | Callable,
    works: Sequence[Work],
    path: str | Path,
    jobs: Any = 1,
    context: Context | None = None,
    progress: str = "",
) -> list[dict[str, Any]]:
    """Do the work that a record file does not hold yet, and record each piece as it arrives.

    Args:
        function: as in `run_jobs`.
        works: what to do.
        path: of the record file.
        jobs, context: as in `run_jobs`.
        progress: what the progress bar says; "" for none.

    Returns:
        The records of `works`, in their order; those that `evaluation.reuse` keeps as committed are
        taken from there, without a trace in the file.
    """
    ledger = current_ledger()
    labels = {work.key: work.label for work in works}
    with RecordFile(path) as file:
        todo = {}
        for work in works:
            kind, kept = (
                ("earlier", file.records)
                if work.key in file.records
                else ("taken", ledger.committed)
            )
            if work.key in kept:
                ledger.note(work.key, work.label, kind, kept[work.key])
            else:
                todo[work.key] = work
        bar = tqdm(
            total=len(labels),
            initial=len(labels) - len(todo),
            desc=progress,
            disable=console.no_bar(bool(progress)),
            delay=0.5,
        )
        with bar:
            for work, result, seconds, made_by in _done(
                function, list(todo.values()), jobs, context
            ):
                file.append(make_record(work.spec, work.seed, result, seconds, made_by))
                ledger.note(work.key, work.label, "done", file.records[work.key])
                bar.set_postfix_str(work.label)
                bar.update()
        all_records = {**ledger.committed, **file.records}
        return [all_records[work.key] for work in works]

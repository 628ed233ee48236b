"""Engines: where the workers of `run_jobs` are, in this machine, in a Ray cluster or behind Slurm.

An engine opens what `run_jobs` takes as `jobs`. Beyond this machine that is an executor, whose
`submit(function, *args)` returns a future with `done()` and `result()`. Workers get JSON specs and
seeds alone, one piece of work on one core at a time. A piece whose worker was lost is done again, a
bounded number of times; an exception of the work itself is raised here at once, as it was raised
there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from typing import Any

from evaluation.ray_workers import ray_workers
from evaluation.slurm_workers import slurm_workers
from piec_envs import InvalidParameterError, as_count, check_name


@dataclass(frozen=True)
class Engine:
    """One row of the table of engines.

    Args:
        name: what users type.
        description: one line.
        open: of (jobs, options); a context manager with what `run_jobs` takes as `jobs`.
    """

    name: str
    description: str
    open: Callable[[int, Mapping[str, Any]], AbstractContextManager[Any]]


@contextmanager
def open_engine(
    name: str = "local", jobs: int = 1, options: Mapping[str, Any] | None = None
) -> Iterator[Any]:
    """Workers, until the `with` statement ends.

    Args:
        name: a row of the table of engines.
        jobs: how many pieces of work are done at once.
        options: of the engine: what `ray.init` takes; or `folder` (of pickles and logs), `cluster`
            and parameters of submitit's AutoExecutor.

    Yields:
        What `run_jobs`, `run_recorded` and every study's `run` take as `jobs`.

    Raises:
        UnknownNameError: for an unknown engine.
        InvalidParameterError: for fewer than one job, or options of an engine that has none.
        MissingDependencyError: if the package that the engine needs is not installed.
        EngineError: if the engine cannot be started so.
    """
    check_name("engine", name, ENGINES)
    with ENGINES[name].open(as_count("jobs", jobs), dict(options or {})) as workers:
        yield workers


@contextmanager
def _local(jobs: int, options: Mapping[str, Any]) -> Iterator[int]:
    if options:
        raise InvalidParameterError(f"the engine 'local' has no options, got {', '.join(options)}")
    yield jobs


ENGINES = {
    row.name: row
    for row in (
        Engine("local", "this process for one job, processes of this machine for more", _local),
        Engine("ray", "the Ray cluster at $RAY_ADDRESS, or one of this machine alone", ray_workers),
        Engine("slurm", "one Slurm job for each piece of work, through submitit", slurm_workers),
    )
}

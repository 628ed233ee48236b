"""Engines: where the workers of `run_jobs` are, in this machine, in a Ray cluster or behind Slurm.

An engine opens what `run_jobs` takes as `jobs`. Beyond this machine that is an executor, whose
`submit(function, *args)` returns a future with `done()` and `result()`. Workers get JSON specs and
seeds alone, one piece of work on one core at a time. A piece whose worker was lost is done again, a
bounded number of times; an exception of the work itself is raised here at once, as it was raised
there.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec
from typing import Any

from evaluation.jobs import POLL_SECONDS, RETRIES, say
from evaluation.workers import answer, installed, value_of
from piec_envs import (
    EngineError,
    InvalidParameterError,
    MissingDependencyError,
    as_count,
    check_name,
)

RAY_STORE = 100 * 2**20  # bytes; results are small, and Ray would take a third of the memory
SLURM_FOLDER = "runs/slurm"
LATE_SECONDS = 15.0  # by which the file of an answer may be seen later than the end of its job
SLURM_OPTIONS = {
    "name": "piec",
    "cpus_per_task": 1,
    "timeout_min": 240,
    "slurm_setup": ["export OMP_NUM_THREADS=1"],  # where Slurm does not bind a job to its core
}


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


@contextmanager
def _ray(jobs: int, options: Mapping[str, Any]) -> Iterator[_RayWorkers]:
    _need("ray", "ray")
    import ray

    running = ray.is_initialized()
    if running and options:
        raise EngineError(
            f"Ray runs already in this process, too late for its options {', '.join(options)}"
        )
    if not running:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")  # a study does not call home
        here = {
            "address": "local",
            "num_cpus": jobs,
            "include_dashboard": False,
            "object_store_memory": RAY_STORE,
        }
        where = (
            {"address": "auto"} if os.environ.get("RAY_ADDRESS") or options.get("address") else here
        )
        try:
            ray.init(**{"logging_level": "ERROR", **where, **options})
        except (RuntimeError, ValueError, TypeError, ConnectionError) as error:
            raise EngineError(f"Ray does not start with {dict(options)}: {error}") from error
    try:
        yield _RayWorkers(jobs)
    finally:
        if not running:
            ray.shutdown()  # of a cluster this leaves all but our own tasks alone


class _RayWorkers:
    """Plain remote tasks: Ray itself runs a task again whose worker or node was lost.

    joblib's Ray backend would need no class here, but it is a pool of actors: with one of them
    killed, the whole call ends with ActorDiedError (Ray 2.60).

    Args:
        limit: tasks at once.
    """

    def __init__(self, limit: int):
        import ray

        self.limit = limit
        # retry_exceptions: what the work itself raises comes back as its answer and is not tried
        # again
        self._task = ray.remote(num_cpus=1, max_retries=RETRIES, retry_exceptions=False)(answer)

    def submit(self, function: Callable, *args: Any) -> _RayFuture:
        """Start a task."""
        return _RayFuture(self._task.remote(installed(), function, *args).future())


class _RayFuture:
    def __init__(self, future: Any):
        self._future = future

    def done(self) -> bool:
        """Whether the task has ended, well or not."""
        return self._future.done()

    def result(self) -> Any:
        """What the work returned or raised; raises EngineError if Ray lost it too often."""
        from ray.exceptions import RayError

        try:
            answer = self._future.result()
        except RayError as error:
            raise EngineError(
                f"Ray could not do a piece of work in {1 + RETRIES} tries: {error}"
            ) from error
        return value_of(answer)


@contextmanager
def _slurm(jobs: int, options: Mapping[str, Any]) -> Iterator[_SlurmWorkers]:
    _need("submitit", "slurm")
    import submitit

    chosen = {**SLURM_OPTIONS, **options}
    folder = chosen.pop("folder", SLURM_FOLDER)
    cluster = chosen.pop("cluster", "slurm")
    try:
        executor = submitit.AutoExecutor(folder, cluster=cluster)
        executor.update_parameters(**chosen)
    except (NameError, AssertionError, ValueError, TypeError, RuntimeError) as error:
        raise EngineError(f"submitit does not start with {dict(options)}: {error}") from error
    workers = _SlurmWorkers(executor, jobs)
    try:
        yield workers
    finally:
        workers.cancel()


class _SlurmWorkers:
    """One Slurm job for each piece of work.

    Args:
        executor: submitit's.
        limit: jobs in the queue at once.
    """

    def __init__(self, executor: Any, limit: int):
        self.limit = limit
        self._executor = executor
        self._futures: list[_SlurmFuture] = []

    def submit(self, function: Callable, *args: Any) -> _SlurmFuture:
        """Put a job into the queue; raises EngineError if Slurm takes none."""
        self._futures = [future for future in self._futures if not future.answer]
        self._futures.append(_SlurmFuture(partial(self._send, installed(), function, *args)))
        return self._futures[-1]

    def _send(self, *args: Any) -> Any:
        from submitit.core.utils import FailedJobError, FailedSubmissionError

        try:
            return self._executor.submit(answer, *args)
        # such as a partition that there is not
        except (FailedJobError, FailedSubmissionError) as error:
            raise EngineError(f"Slurm takes no job: {error}") from error

    def cancel(self) -> None:
        """Leave nothing in the queue."""
        for future in self._futures:
            if not future.answer:
                future.job.cancel(check=False)


class _SlurmFuture:
    """A job, submitted again when it is gone without an answer.

    Preempted jobs do not come here: submitit and Slurm put them back into the queue themselves.
    """

    def __init__(self, submit: Callable[[], Any]):
        self._submit = submit
        self.job = submit()
        self._losses = 0
        self._ended = -1.0
        self.answer: tuple[Any, Exception | None] | None = None

    def done(self) -> bool:
        """Whether there is an answer; a lost job is submitted again, and raises EngineError if lost
        too often.

        It waits for nothing, so that the other jobs go on: an answer that may only be late is
        looked for again.
        """
        from submitit.core.utils import FailedJobError

        if self.answer or not self.job.done():
            self._ended = -1.0
            return self.answer is not None
        if not self.job.paths.result_pickle.exists():
            self._miss(time.monotonic())
            return False
        try:
            self.answer = self.job.result()
        # it ran and could not even answer, as where the suite is not installed
        except FailedJobError as error:
            raise EngineError(f"a Slurm job failed: {error}") from error
        return True

    def _miss(self, now: float) -> None:
        """Submit a job again that has ended without an answer for long enough."""
        self._ended = now if self._ended < 0 else self._ended
        if now - self._ended < LATE_SECONDS:
            return
        self._losses = self._losses + 1
        self._ended = -1.0
        if self._losses > RETRIES:
            last = f"Slurm job {self.job.job_id} ({self.job.state}): {self.job.stderr()}"
            raise EngineError(
                f"a piece of work was lost {self._losses} times, the last time as {last}"
            )
        say(
            f"Slurm job {self.job.job_id} was lost; it is submitted again ({self._losses} of "
            f"{RETRIES})"
        )
        self.job = self._submit()

    def result(self) -> Any:
        """Wait for what the work returned or raised; raises EngineError if its time ran out."""
        from submitit.core.utils import UncompletedJobError

        while not self.done():
            time.sleep(POLL_SECONDS)
        try:
            return value_of(self.answer)
        # submitit raises it amid the work when the time is nearly up
        except UncompletedJobError as error:
            raise EngineError(
                f"a Slurm job needs more time, or the option timeout_min: {error}"
            ) from error


def _need(package: str, extra: str) -> None:
    if find_spec(package) is None:
        raise MissingDependencyError(package, extra, "use the engine 'local'")


ENGINES = {
    row.name: row
    for row in (
        Engine("local", "this process for one job, processes of this machine for more", _local),
        Engine("ray", "the Ray cluster at $RAY_ADDRESS, or one of this machine alone", _ray),
        Engine("slurm", "one Slurm job for each piece of work, through submitit", _slurm),
    )
}

"""Workers behind Slurm: one job for each piece of work, through submitit."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from typing import Any

from evaluation.jobs import POLL_SECONDS, RETRIES, say
from evaluation.workers import answer, installed, need_package, value_of
from piec_envs import EngineError

SLURM_FOLDER = "runs/slurm"
LATE_SECONDS = 15.0  # by which the file of an answer may be seen later than the end of its job
SLURM_OPTIONS = {
    "name": "piec",
    "cpus_per_task": 1,
    "timeout_min": 240,
    "slurm_setup": ["export OMP_NUM_THREADS=1"],  # where Slurm does not bind a job to its core
}


@contextmanager
def slurm_workers(jobs: int, options: Mapping[str, Any]) -> Iterator[_SlurmWorkers]:
    """Slurm's queue, until the block ends.

    Args:
        jobs: in the queue at once.
        options: `folder` (of pickles and logs), `cluster` and parameters of submitit's
            AutoExecutor.

    Yields:
        What `run_jobs` takes as `jobs`.

    Raises:
        MissingDependencyError: if submitit is not installed.
        EngineError: if it does not start so.
    """
    need_package("submitit", "slurm")
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

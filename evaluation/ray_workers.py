"""Workers in a Ray cluster: one plain remote task for each piece of work."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from typing import Any

from evaluation.jobs import RETRIES
from evaluation.workers import answer, installed, need_package, value_of
from piec_envs import EngineError

RAY_STORE = 100 * 2**20  # bytes; results are small, and Ray would take a third of the memory


@contextmanager
def ray_workers(jobs: int, options: Mapping[str, Any]) -> Iterator[_RayWorkers]:
    """The Ray cluster at $RAY_ADDRESS, or one of this machine alone, until the block ends.

    Args:
        jobs: tasks at once.
        options: what `ray.init` takes.

    Yields:
        What `run_jobs` takes as `jobs`.

    Raises:
        MissingDependencyError: if Ray is not installed.
        EngineError: if it does not start so.
    """
    need_package("ray", "ray")
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

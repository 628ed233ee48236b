"""What a command that takes minutes is doing: a line before each stage with an estimate, and one
after it.

The lines go to the standard error, each at once, so that a log without a terminal shows them too.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from piec_envs import available_threads

REFERENCE_CORES = 2  # the cores that expected times hold for


class Stages:
    """Announces the stages of a command, each with an estimate that learns from those before it.

    Args:
        expected: seconds that each stage takes on REFERENCE_CORES cores, in order.
        quiet: whether to say nothing.
        done: how much is recorded by now; a stage that adds nothing was done by an earlier run, and
            teaches nothing about how long others take. None counts every stage.
    """

    def __init__(
        self,
        expected: Mapping[str, float],
        quiet: bool = False,
        done: Callable[[], int] | None = None,
    ):
        self._expected = dict(expected)
        self._quiet = quiet
        self._done = done
        self._begin = time.perf_counter()
        self._number = 0
        self._paces = [REFERENCE_CORES / available_threads()]
        total = sum(expected.values()) * self._pace
        self._say(
            f"{len(expected)} stages, about {seconds(total)}; kernels not compiled yet add "
            f"minutes once"
        )

    @contextmanager
    def stage(self, name: str, recorded: bool = False) -> Iterator[None]:
        """One stage.

        Args:
            name: a key of the expected times.
            recorded: whether its results are recorded, so that an earlier run may have done it.
        """
        self._number += 1
        place = f"{self._number} of {len(self._expected)}"
        before = self._records
        self._say(f"{place}: {name}, about {seconds(self._expected[name] * self._pace)}")
        begin = time.perf_counter()
        yield
        spent = time.perf_counter() - begin
        if recorded and self._done is not None and self._records == before:
            self._say(f"{place}: {name} was done by an earlier run")
            return
        self._paces.append(spent / self._expected[name])
        self._say(f"{place}: {name} took {seconds(spent)}")

    def end(self) -> None:
        """Say how long it took in all."""
        self._say(f"took {seconds(time.perf_counter() - self._begin)} in all")

    @property
    def _records(self) -> int:
        return 0 if self._done is None else self._done()

    @property
    def _pace(self) -> float:
        """Seconds here for each expected one: the least so far, since compiling comes once and only
        adds.
        """
        return min(self._paces[1:], default=self._paces[0])

    def _say(self, line: str) -> None:
        if not self._quiet:
            print(f"piec: {line}", file=sys.stderr, flush=True)


def seconds(value: float) -> str:
    """A duration as people say it: 8 s, 2 min 40 s."""
    whole = max(1, round(value))
    return f"{whole} s" if whole < 100 else f"{whole // 60} min {whole % 60} s"

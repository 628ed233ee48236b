"""What workers of Ray and Slurm run: they check that they are the same suite, and answer with
errors as values.
"""

from __future__ import annotations

import pickle
import traceback
from collections.abc import Callable, Mapping
from importlib.util import find_spec
from typing import Any

from piec_envs import EngineError, MissingDependencyError, provenance


def need_package(package: str, extra: str) -> None:
    """Refuse to go on without what an engine needs.

    Args:
        package: its name.
        extra: of this suite, which brings it.

    Raises:
        MissingDependencyError: if it is not installed.
    """
    if find_spec(package) is None:
        raise MissingDependencyError(package, extra, "use the engine 'local'")


def installed() -> dict[str, str]:
    """What workers must have as well: versions, and the suite's own sources."""
    return {**provenance.versions(), "sources": provenance.source()["digest"]}


def answer(
    expected: Mapping[str, str], function: Callable, *args: Any
) -> tuple[Any, Exception | None]:
    """What workers run.

    Args:
        expected: `installed` where the records are written, which say that the work was done with
            that.
        function: what to call.
        args: its arguments.

    Returns:
        The result and None, or None and what was raised: only lost workers look like failures to an
        engine.
    """
    here = installed()
    other = [
        f"{name} {here[name]} instead of {expected[name]}"
        for name in expected
        if here[name] != expected[name]
    ]
    if other:
        return None, EngineError(f"a worker has other versions installed: {', '.join(other)}")
    try:
        return function(*args), None
    except Exception as error:
        text = traceback.format_exc()
        error.add_note(f"in a worker:\n{text}")
        try:
            pickle.loads(pickle.dumps(error))
        except Exception:  # not every exception crosses process borders
            return None, RuntimeError(f"in a worker:\n{text}")
        return None, error


def value_of(given: Any) -> Any:
    """What `answer` returned: the result, or what was raised, raised again."""
    value, error = given
    if error is not None:
        raise error
    return value

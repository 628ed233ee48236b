"""What is shown on the standard error beside results: progress bars and notes, and how to have
neither.

Bars are for people: a log that is no terminal gets none. `PIEC_QUIET=1` (`piec --quiet`) also
leaves out notes; workers inherit it. Errors are always shown.
"""

from __future__ import annotations

import os
import sys

__all__ = ["VARIABLE", "no_bar", "note", "quiet"]

VARIABLE = "PIEC_QUIET"


def quiet() -> bool:
    """Whether notes and bars are unwanted."""
    return os.environ.get(VARIABLE, "0") not in ("", "0")


def no_bar(progress: bool = True) -> bool | None:
    """What `tqdm` takes as `disable`.

    Args:
        progress: whether the caller wants a bar.

    Returns:
        True for no bar; None leaves it to `tqdm`, which shows one if the standard error is a
        terminal.
    """
    return None if progress and not quiet() else True


def note(text: str) -> None:
    """Say something on the standard error, in one line, unless that is unwanted."""
    if not quiet():
        print(f"piec_envs: {text}", file=sys.stderr, flush=True)

"""What a public docstring holds: one sentence, Args with shapes, Returns and Raises."""

from __future__ import annotations

from pathlib import Path

import pytest
from docstrings import faults, methods_with_args

ROOT = Path(__file__).resolve().parents[1]
PACKAGES = ("piec_envs", "planners", "evaluation")
PATHS = [path for package in PACKAGES for path in sorted((ROOT / package).rglob("*.py"))]
TEXTS = {path.relative_to(ROOT).as_posix(): path.read_text(encoding="utf-8") for path in PATHS}

DOCUMENTED = methods_with_args(list(TEXTS.values()))


@pytest.mark.parametrize("name", TEXTS)
def test_public_functions_say_what_they_take_and_give(name):
    found = faults(TEXTS[name], DOCUMENTED)
    assert not found, "\n".join([name, *found])


GOOD = '''
@batch_kernel
def scale(lo, hi, x):
    """Scale rows lo to hi - 1.

    Args:
        lo, hi: row range.
        x: shape (B, n), m.

    Returns:
        How many rows there are.

    Raises:
        ValueError: if there are none.
    """
    if hi <= lo:
        raise ValueError
    x[lo:hi] *= 2
    return hi - lo
'''
PAIR = "class Pair(NamedTuple):\n    'Two numbers.'\n    a: float{}\n    b: float  # m\n"
SEEN = '''
class Base:
    def f(self, a, b):
        """Do it.

        Args:
            a, b: numbers.
        """
class Child(Base):
    def f(self, a, b):
        "Do it well; see `{}.f`."
'''


@pytest.mark.parametrize(
    ("source", "wanted"),
    [
        (GOOD, ""),
        (GOOD.replace("hi - 1.", "hi - 1"), "does not end a sentence"),
        (GOOD.replace("hi - 1.", "hi - 1. In place."), "more than one sentence"),
        (GOOD.replace("lo, hi:", "lo:"), "does not name hi"),
        (GOOD.replace("shape (B, n)", "rows"), "x is an array without a shape"),
        (GOOD.replace("Returns:", "Result:"), "no Returns section"),
        (GOOD.replace("        ValueError:", "        KeyError:"), "does not name ValueError"),
        (PAIR.format("  # s"), ""),
        (PAIR.format("").replace("    a:", "    # s\n    a:"), ""),
        (PAIR.format(""), "does not name a"),
        (SEEN.format("Base"), ""),
        (SEEN.format("Other"), "does not name a"),
    ],
)
def test_the_law_finds_what_is_missing(source, wanted):
    found = faults(source)
    assert any(wanted in fault for fault in found) if wanted else not found

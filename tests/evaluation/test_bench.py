"""The table of speeds says which of its targets are met."""

from __future__ import annotations

import math

import pytest

from evaluation.bench import demo
from evaluation.bench.base import QUICK, row, verdict
from piec_envs.errors import EngineError, InvalidParameterError


@pytest.mark.parametrize(
    ("result", "wanted", "met"),
    [
        (63.6, "at most 60", "miss"),
        (60.0, "at most 60", "pass"),
        (0.3, "at least 0.99", "miss"),
        (0.99, "at least 0.99", "pass"),
        (5.0, "", ""),
        (math.nan, "at most 3", ""),
    ],
)
def test_every_target_is_marked_as_met_or_missed(result, wanted, met):
    assert verdict(result, wanted) == row("a", result, "s", wanted)["met"] == met


@pytest.mark.parametrize("wanted", ["about 3", "3", "most 3"])
def test_a_target_that_says_nothing_is_refused(wanted):
    with pytest.raises(InvalidParameterError, match="at most 3"):
        verdict(1.0, wanted)


def test_a_demo_that_fails_is_no_result(tmp_path):
    with pytest.raises(EngineError, match=r"code 2: usage: .*\n.*unrecognized"):
        demo._run_demo(tmp_path, {}, ("--luck",))


def test_the_quick_sizes_compile_nothing():
    assert "cold" not in QUICK.demo

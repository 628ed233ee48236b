from __future__ import annotations

import numpy as np
import pytest

from evaluation.metrics import bootstrap_interval, coverage, max_deviation, wilson_interval
from piec_envs.errors import InvalidParameterError


# Known values: Newcombe (1998), Statistics in Medicine 17, table I, method 3; and 0 or all of n.
@pytest.mark.parametrize(
    ("successes", "n", "low", "high"),
    [
        (81, 263, 0.2553, 0.3662),
        (15, 148, 0.0624, 0.1605),
        (0, 20, 0.0, 0.1611),
        (1, 29, 0.0061, 0.1718),
        (20, 20, 0.8389, 1.0),
    ],
)
def test_wilson_agrees_with_known_values(successes, n, low, high):
    interval = wilson_interval(successes, n)
    assert interval.value == successes / n
    assert interval.low == pytest.approx(low, abs=6e-5)
    assert interval.high == pytest.approx(high, abs=6e-5)


def test_wilson_narrows_with_n_and_widens_with_confidence():
    def width(interval):
        return interval.high - interval.low

    assert width(wilson_interval(90, 100)) < width(wilson_interval(9, 10))
    assert width(wilson_interval(9, 10, 0.99)) > width(wilson_interval(9, 10))


@pytest.mark.parametrize(("successes", "n"), [(3, 2), (-1, 2), (0, 0)])
def test_wilson_refuses_what_is_no_count(successes, n):
    with pytest.raises(InvalidParameterError, match="successes"):
        wilson_interval(successes, n)


def test_bootstrap():
    rates = [1.0, 0.9, 0.95, 0.97, 0.93]
    interval = bootstrap_interval(rates)
    assert interval.value == pytest.approx(0.95)
    assert min(rates) <= interval.low < interval.value < interval.high <= max(rates)
    assert interval == bootstrap_interval(rates)
    assert bootstrap_interval([0.4]) == (0.4, 0.4, 0.4)
    with pytest.raises(InvalidParameterError):
        bootstrap_interval([])


def test_max_deviation_is_the_largest_distance_at_equal_times():
    nominal = np.column_stack([np.linspace(0, 1, 11), np.zeros(11), np.zeros(11)])
    pose = np.stack([nominal, nominal + np.array([0.0, 0.3, 2.0]), nominal])
    pose[2, 5, 1] = -0.1
    assert max_deviation(pose, nominal) == pytest.approx([0.0, 0.3, 0.1])


def test_coverage_is_the_share_of_points_approached():
    reference = np.column_stack([np.linspace(0, 1, 101), np.zeros(101)])
    half = np.column_stack([np.linspace(0, 0.5, 51), np.full(51, 0.0299)])
    away = half + np.array([0.0, 1.0])
    assert coverage(np.stack([half, away]), reference) == pytest.approx([51 / 101, 0.0])

"""Checks of what users give."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from piec_envs.errors import FEW, all_finite


@given(st.sampled_from([1, 2, 7, FEW, FEW + 1, 3 * FEW]), st.floats(), st.integers(0, 10**6))
def test_an_array_is_finite_if_all_its_numbers_are(size, odd, place):
    array = np.ones(size)
    array[place % size] = odd
    assert all_finite(array) == bool(np.isfinite(array).all())
    assert all_finite(array[None, :, None]) == all_finite(array)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("size", [4, FEW, 2 * FEW])
def test_numbers_whose_sum_is_too_large_are_finite(size):
    huge = np.full(size, 1e308)
    assert all_finite(huge)
    huge[:2] = np.inf, -np.inf
    assert not all_finite(huge)

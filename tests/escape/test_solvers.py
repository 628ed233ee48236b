"""The two eikonal solvers on scenes without a robot: references, exact solutions and laws."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import maximum_filter, minimum_filter

from piec_envs.errors import InvalidParameterError
from piec_envs.escape.marching import fast_march, march_reference, sort_by_time
from piec_envs.escape.sweeping import sweep, sweep_reference

SOLVERS = {"sweeping": sweep, "marching": fast_march}


def smooth_scene(seed, n=22, m=26):
    """Smooth random slowness with a wall, T given on the upper and right border."""
    rng = np.random.default_rng(seed)
    y, x = np.indices((n, m))
    a, b, c = rng.uniform(0.1, 0.5, 3)
    slow = 1.6 + np.sin(a * x + 9 * c) * np.cos(b * y)
    slow[8:11, 5 : 5 + rng.integers(3, 14)] = np.inf
    boundary = np.full((n, m), np.inf)
    boundary[0] = 0
    boundary[:, -1] = 0
    return np.where(np.isfinite(boundary), 1.0, slow), boundary


def disc_scene(n, radius=1.0):
    """Unit speed in a disc; exact T = radius - |p|, given outside."""
    axis = np.linspace(-1.2 * radius, 1.2 * radius, n)
    exact = radius - np.hypot(axis[None], axis[:, None])
    return np.ones((n, n)), np.where(exact > 0, np.inf, exact), axis[1] - axis[0], exact


def annulus_scene(closed, n=61):
    """The paper's toy: a square annulus of wall in a disc of radius 1, with or without a gap."""
    slow, boundary, h, _ = disc_scene(n)
    axis = np.linspace(-1.2, 1.2, n)
    ring = np.maximum(abs(axis[None]), abs(axis[:, None]))
    slow[(ring > 0.3) & (ring < 0.5)] = np.inf
    if not closed:
        slow[np.ix_(axis > 0, abs(axis) < 0.1)] = 1.0
    return slow, boundary, h


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_sweeping_equals_its_reference(seed):
    slow, boundary = smooth_scene(seed)
    time = sweep(slow, boundary, 0.1)
    reference = sweep_reference(slow, boundary, 0.1)
    inner = np.isinf(boundary) & np.isfinite(slow)
    error = np.abs(time[inner] - reference[inner])
    assert np.percentile(error / reference[inner], 90) < 1e-12
    # On crests, where two neighbours tie, the order of the sweeps decides which edge's cost is
    # kept; the two edges differ by half the neighbours' difference in slowness.
    range_near = maximum_filter(np.where(np.isinf(slow), 0.0, slow), 3) - minimum_filter(slow, 3)
    assert (error <= 0.5 * 0.1 * range_near[inner] + 1e-12).all()


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 10**6))
def test_marching_equals_the_heap_reference(seed):
    """The order of arrival comes from the first-order solution; that changes little of what second
    order brings.
    """
    slow, boundary = smooth_scene(seed)
    inner = np.isinf(boundary) & np.isfinite(slow)
    time = fast_march(slow, boundary, 0.1)[inner]
    first = sweep(slow, boundary, 0.1)[inner]
    reference = march_reference(slow, boundary, 0.1)[inner]
    assert np.abs(time - reference).mean() < 0.2 * np.abs(first - reference).mean()


@pytest.mark.parametrize("method", SOLVERS)
def test_the_numbers_do_not_depend_on_a_mirror_image(method):
    slow, boundary = smooth_scene(3)
    time = SOLVERS[method](slow, boundary, 0.1)
    mirrored = SOLVERS[method](slow[::-1], boundary[::-1], 0.1)[::-1]
    np.testing.assert_allclose(mirrored, time, rtol=1e-3)


def test_order_of_convergence_on_the_disc():
    errors = {name: [] for name in SOLVERS}
    for n in (61, 121):
        slow, boundary, h, exact = disc_scene(n)
        for name, solve in SOLVERS.items():
            error = np.abs(solve(slow, boundary, h, least=-9.0) - exact)
            errors[name].append(error[exact > 0.0].mean())
    assert 1.7 < errors["sweeping"][0] / errors["sweeping"][1] < 2.6  # first order
    # second order, less the kink at the centre
    assert errors["marching"][0] / errors["marching"][1] > 3.0


@pytest.mark.parametrize("method", SOLVERS)
def test_a_lower_bound_that_is_the_solution_makes_it_exact(method):
    slow, boundary, h, exact = disc_scene(61)
    time = SOLVERS[method](slow, boundary, h, least=exact)
    np.testing.assert_allclose(time[exact > 0], exact[exact > 0], rtol=1e-12)


@pytest.mark.parametrize("method", SOLVERS)
def test_a_closed_annulus_is_a_cage_and_an_open_one_is_not(method):
    centre = (30, 30)
    assert SOLVERS[method](*annulus_scene(closed=True))[centre] == np.inf
    assert SOLVERS[method](*annulus_scene(closed=False))[centre] == pytest.approx(1.0, abs=0.01)


def test_both_solvers_agree_on_the_annulus():
    slow, boundary, h = annulus_scene(closed=False, n=121)
    first = sweep(slow, boundary, h)
    second = fast_march(slow, boundary, h)
    assert (np.isfinite(first) == np.isfinite(second)).all()
    inner = np.isfinite(first) & (second > 0.1)
    assert np.median(np.abs(first[inner] - second[inner]) / second[inner]) < 0.01


@settings(max_examples=30, deadline=None)
@given(st.lists(st.floats(0, 2.0**100, width=32), min_size=1, max_size=200))
def test_sort_by_time_sorts(times):
    time = np.array(times)
    order, spare = np.empty((2, len(time)), dtype=np.uint32)
    sort_by_time(time, np.empty(len(time), dtype=np.float32), order, spare)
    assert (order == np.argsort(time, kind="stable")).all()


@pytest.mark.parametrize("method", SOLVERS)
def test_scenes_that_make_no_sense_are_refused(method):
    slow, boundary = smooth_scene(0)
    with pytest.raises(InvalidParameterError, match="one shape"):
        SOLVERS[method](slow[1:], boundary, 0.1)
    with pytest.raises(InvalidParameterError, match="positive"):
        SOLVERS[method](-slow, boundary, 0.1)

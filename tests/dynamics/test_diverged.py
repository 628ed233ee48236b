"""Rows that are not finite any more rest in their last good state, and say so."""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.dynamics.base import blank_motion
from piec_envs.dynamics.quasi_dynamic import _hold_diverged

STEPS = 8


def moving(rows):
    """A motion in which every number is another one."""
    rng = np.random.default_rng(0)
    motion = blank_motion(*(rng.normal(size=(rows, k)) for k in (4, 4, 3)), STEPS, 4)
    for array in (motion.q_r, motion.q_cmd, motion.pose, motion.actions, motion.link_distance):
        array[:] = rng.normal(size=array.shape)
    motion.contact[:], motion.active[:] = True, 2
    return motion


@pytest.mark.parametrize("k", [1, 3, STEPS])
@pytest.mark.parametrize("bad", [np.nan, np.inf])
@pytest.mark.parametrize("name", ["pose", "q_r"])
def test_a_row_is_held_from_the_step_before(name, bad, k):
    motion, before = moving(3), moving(3)
    getattr(motion, name)[1, k:, 1] = bad
    _hold_diverged(motion)
    for field in ("q_r", "q_cmd", "pose", "link_distance", "contact"):
        found, true = getattr(motion, field), getattr(before, field)
        np.testing.assert_array_equal(found[1, :k], true[1, :k])
        np.testing.assert_array_equal(found[1, k:], np.repeat(true[1, k - 1 : k], STEPS + 1 - k, axis=0))
        np.testing.assert_array_equal(found[[0, 2]], true[[0, 2]])  # the others are as they were
    assert motion.diverged[1].tolist() == [t >= k for t in range(STEPS + 1)]
    assert not motion.diverged[[0, 2]].any()
    assert (motion.active[1, k:] == 0).all() and (motion.actions[1, k - 1 :] == 0).all()
    np.testing.assert_array_equal(motion.actions[1, : k - 1], before.actions[1, : k - 1])


def test_a_sound_motion_stays_as_it_is():
    motion, before = moving(2), moving(2)
    _hold_diverged(motion)
    for name, value in vars(before).items():
        np.testing.assert_array_equal(getattr(motion, name), value)

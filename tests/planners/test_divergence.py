"""A simulation that ends early must not look cheap to a planner, because what is left of it
rests.
"""

from __future__ import annotations

import numpy as np
import pytest

import piec_envs  # noqa: F401  registers the environments
from piec_envs.env.makers import make_model
from planners.objectives import DIVERGENCE_WEIGHT, PathCost

INSIDE = [0.6, 0.02, 0.1]  # of three discs on the arm's axis: links on both sides, no way out
PAPER = {"object": "three_discs", "preset": "paper", "escape_field": None, "prior": "contact"}


@pytest.fixture(scope="module")
def stuck():
    """The cost from a start that no step leads out of, and from one that all do."""
    model = make_model("piec_envs/PlanarArmPush-v0", **PAPER)
    free = model.reset(0)
    caught = model.reset(0)
    caught.q_r[:] = 0.0
    caught.q_cmd[:] = 0.0
    caught.pose[:] = INSIDE
    return PathCost(model, free), PathCost(model, caught)


def test_what_diverges_at_once_costs_more_than_anything_else(stuck):
    free, caught = stuck
    path = np.zeros((2, 1000, 4))
    assert (free.nominal(path) < DIVERGENCE_WEIGHT).all()
    assert (caught.nominal(path) >= 1000 * DIVERGENCE_WEIGHT).all()


def test_so_does_what_diverges_when_disturbed_alone(stuck):
    free, caught = stuck
    path = np.zeros((1, 1000, 4))
    both = caught.start.take([0, 0])
    both.pose[1] = free.start.pose[0]
    both.q_r[1] = free.start.q_r[0]
    both.q_cmd[1] = free.start.q_cmd[0]
    cost = free.disturbed(path, both)[0]
    alone = free.disturbed(path, free.start)[0]
    assert cost - alone > 0.49 * 1000 * DIVERGENCE_WEIGHT

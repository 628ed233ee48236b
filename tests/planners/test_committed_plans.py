"""Every committed plan: its joints move no faster than the arm can, but for what a pressed joint springs back."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from piec_envs.dynamics.base import CONTROL_PERIOD
from piec_envs.episodes.tasks import PAPER_PRESETS
from piec_envs.world.robots import get_robot
from planners import Plan
from planners.base import nominal_start

RESULTS = Path(__file__).resolve().parents[2] / "results"
SPRING = 2.1  # largest joint step over the limit of speed: a command leads its joint by twice that at most
PLANS = sorted(RESULTS.glob("*/plans/*.npz"))
NAMES = [path.relative_to(RESULTS).with_suffix("").as_posix() for path in PLANS]


def executed(plan):
    """The joints (N + 1, n) where the plan is carried out under its own model, and whether that ends well."""
    free = {**plan.env_kwargs, "escape_field": None, "prior": None, "adversary": 0.0}
    model, start, _ = nominal_start(plan.env_id, free, plan.seed)
    motion = model.rollout(start, plan.path[None, 1:], absolute=True).motion
    return motion.q_r[0], not motion.diverged.any()


@pytest.mark.parametrize("path", PLANS, ids=NAMES)
def test_no_joint_leaps(path):
    plan = Plan.load(path)
    limit = CONTROL_PERIOD * get_robot(plan.robot).speed_limit  # (n,)
    joints = plan.path
    if plan.preset in PAPER_PRESETS:
        # Without a limit of the lead a pressed joint of the planned path springs back by up to 0.3 rad; executed,
        # the path is followed at the speed of the drives.
        joints, good = executed(plan)
        assert good
    assert (np.abs(np.diff(joints, axis=0)) / limit).max() <= SPRING

"""Every committed plan: its joints move no faster than the arm can, but for what a pressed joint
springs back.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from piec_envs.dynamics.protocol import CONTROL_PERIOD
from piec_envs.model.task import PAPER_PRESETS
from piec_envs.world.robots import get_robot
from planners import Plan
from planners.base import nominal_start

RESULTS = Path(__file__).resolve().parents[2] / "results"
# largest joint step over the limit of speed: a command leads its joint by twice that at most
SPRING = 2.1
PLANS = sorted(RESULTS.glob("*/plans/*.npz"))
NAMES = [path.relative_to(RESULTS).with_suffix("").as_posix() for path in PLANS]


def executed(plan):
    """Steps of the joints where the plan is carried out under its own model, how far they were
    pressed, (N, n).
    """
    free = {**plan.env_kwargs, "escape_field": None, "prior": None, "adversary": 0.0}
    model, start, _ = nominal_start(plan.env_id, free, plan.seed)
    motion = model.rollout(start, plan.path[None, 1:], absolute=True).motion
    assert not motion.diverged.any()
    return np.abs(np.diff(motion.q_r[0], axis=0)), np.abs(motion.q_cmd[0, 1:] - motion.q_r[0, :-1])


@pytest.mark.parametrize("path", PLANS, ids=NAMES)
def test_no_joint_leaps(path):
    plan = Plan.load(path)
    limit = CONTROL_PERIOD * get_robot(plan.robot).speed_limit  # (n,)
    # no limit of the lead: a joint springs back by as much as it was pressed
    if plan.preset in PAPER_PRESETS:
        steps, lead = executed(plan)
        assert (steps <= SPRING * limit + lead).all()
    else:
        assert (np.abs(np.diff(plan.path, axis=0)) / limit).max() <= SPRING

"""Random held actions from touching and squeezed states: nothing breaks, and how much contact there
was.

`pytest -m slow -s tests/dynamics/test_stress.py` prints the figures of a million steps.
"""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.world.objects import OBJECTS
from piec_envs.world.robots import get_robot

ROBOT = get_robot("planar_arm")


def stress(random_motion, steps: int, sigma: float) -> dict[str, float]:
    """Worst figures over at least `steps` steps, all objects in turn."""
    names = [name for name, item in OBJECTS.items() if not item.loose]
    done = 0
    seed = 0
    figures = {"penetration": 0.0, "joint step": 0.0, "contact": 0.0, "three": 0.0}
    while done < steps:
        motion = random_motion(names[seed % len(names)], rows=60, steps=200, seed=seed, sigma=sigma)
        for array in (motion.q_r, motion.q_cmd, motion.pose, motion.link_distance):
            assert np.isfinite(array).all()
        active = motion.active[:, 1:]
        if sigma == 0:
            still = (motion.pose[:, 1:] == motion.pose[:, :-1]).all(axis=2)
            assert still[active == 0].all()
        figures["penetration"] = max(figures["penetration"], float(-motion.link_distance.min()))
        figures["joint step"] = max(figures["joint step"], largest_step(motion, lawful=sigma == 0))
        figures["contact"] += float((active > 0).sum())
        figures["three"] += float((active >= 3).sum())
        done = done + active.size
        seed = seed + 1
    figures["contact"] /= done
    figures["three"] /= done
    figures["steps"] = done
    return figures


def largest_step(motion, lawful: bool) -> float:
    """Largest step of a joint over max_lead, where the command leads by no more than that.

    A joint that was pressed beyond its limit is called back to the limit at once, however far that
    is: the arm springs back, and a joint that the object links to it can be swung by more than its
    own lead (1.022 max_lead in the fourth joint, with the second one 2.37 beyond its limit). What
    bounds all steps is the QP: standing still keeps the constraints of links that do not overlap,
    so that the step is no longer, weighted by the stiffness, than the lead.
    """
    limits = [ROBOT.joint_array(name) for name in ("lower", "upper")]
    stiffness = ROBOT.joint_array("stiffness")
    most = ROBOT.joint_array("max_lead")
    # (B, N, n)
    before = motion.q_r[:, :-1]
    step = np.diff(motion.q_r, axis=1)
    lead = motion.q_cmd[:, 1:] - before
    far = np.abs(lead) > most + 1e-12
    assert ((before < limits[0]) | (before > limits[1]))[far].all()
    if lawful:  # a displacement is free motion, too
        lengths = [np.sqrt((stiffness * each**2).sum(axis=2)) for each in (step, lead)]
        apart = motion.link_distance[:, :-1].min(axis=2) >= 0
        assert (lengths[0] <= lengths[1] * (1 + 1e-9) + 1e-12)[apart].all()
    return float((np.abs(step) / most)[~far.any(axis=2)].max())


def check(figures: dict[str, float]) -> None:
    print(
        f"\n{figures['steps']} steps, in contact {figures['contact']:.1%}, three or more active "
        f"multipliers "
        f"{figures['three']:.1%}, penetration at most {1e3 * figures['penetration']:.3f} mm, "
        f"largest joint step {figures['joint step']:.3f} max_lead"
    )
    assert figures["contact"] >= 0.3
    assert figures["three"] >= 0.02
    assert figures["penetration"] < 1e-3
    assert figures["joint step"] <= 1.0 + 1e-12  # q_r + (q_cmd - q_r) rounds


@pytest.mark.parametrize("sigma", [0.0, 0.005])
def test_random_actions(random_motion, sigma):
    check(stress(random_motion, 60_000, sigma))


@pytest.mark.slow
@pytest.mark.parametrize("sigma", [0.0, 0.005])
def test_a_million_random_actions(random_motion, sigma):
    check(stress(random_motion, 1_000_000, sigma))

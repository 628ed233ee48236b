"""Random held actions from touching and squeezed states: nothing breaks, and how much contact there was.

`pytest -m slow -s tests/dynamics/test_stress.py` prints the figures of a million steps.
"""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.world.objects import OBJECTS
from piec_envs.world.robots import get_robot


def stress(random_motion, steps: int, sigma: float) -> dict[str, float]:
    """Worst figures over at least `steps` steps, all objects in turn."""
    robot = get_robot("planar_arm")
    names, done, seed = [name for name, item in OBJECTS.items() if not item.loose], 0, 0
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
        step = np.abs(np.diff(motion.q_r, axis=1)) / robot.joint_array("max_lead")
        figures["joint step"] = max(figures["joint step"], float(step.max()))
        figures["contact"] += float((active > 0).sum())
        figures["three"] += float((active >= 3).sum())
        done, seed = done + active.size, seed + 1
    figures["contact"] /= done
    figures["three"] /= done
    figures["steps"] = done
    return figures


def check(figures: dict[str, float]) -> None:
    print(
        f"\n{figures['steps']} steps, in contact {figures['contact']:.1%}, three or more active multipliers "
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

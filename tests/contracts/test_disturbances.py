"""What displaces the object: noise of the stated size, and an adversary."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest


def test_noise_pairs_with_the_same_start():
    """Runs with and without disturbance begin at the same drawn start."""
    starts = [
        gym.make("piec_envs/PlanarArmPush-v0", start_noise=(0.01, 0.05), disturbance=sigma).reset(
            seed=4
        )[0]
        for sigma in (0.0, 0.005)
    ]
    np.testing.assert_array_equal(*starts)


@pytest.mark.parametrize("kind", ["gaussian", "direction"])
def test_disturbance_has_the_stated_size(kind):
    """A free object moves by exactly its disturbance."""
    env = gym.make(
        "piec_envs/PlanarArmPush-v0", escape_field=None, disturbance=0.004, disturbance_kind=kind
    ).unwrapped
    env.reset(seed=0, options={"state": {"pose": [-0.7, -0.7, 0.0]}})
    motion = env.rollout(env.get_state(), controls=np.zeros((1, 1000, 4))).motion
    steps = np.diff(motion.pose[0, :, :2], axis=0)
    if kind == "direction":
        np.testing.assert_allclose(np.linalg.norm(steps, axis=1), 0.004, rtol=1e-9)
    else:
        np.testing.assert_allclose(steps.std(axis=0), 0.004, rtol=0.08)


def test_adversary_flees_down_the_escape_time():
    env = gym.make("piec_envs/PlanarArmPush-v0", adversary=1.0, escape_every=1).unwrapped
    _, info = env.reset(
        seed=0, options={"state": {"q_r": [2.5, 0.5, 0.5, 0.5], "pose": [0.5, -0.3, 0.0]}}
    )
    times = [info["escape_time"]]
    before = env.get_state().pose[0]
    for _ in range(60):
        times.append(env.step(np.zeros(4))[4]["escape_time"])
    moved = np.linalg.norm(env.get_state().pose[0, :2] - before[:2])
    assert moved == pytest.approx(60 * 0.1 * 0.05, rel=1e-2)
    np.testing.assert_allclose(np.diff(times), -0.1, atol=0.03)  # a second each second


@pytest.mark.parametrize("every", [1, 5])
def test_an_object_that_flees_later_rests_until_then(every):
    made = {"escape_every": every, "start_noise": (0.02, 0.1)}
    calm, late, soon = (
        gym.make("piec_envs/PlanarArmPush-v0", **made, **flees).unwrapped
        for flees in ({}, {"adversary": 1.0, "adversary_after": 2.0}, {"adversary": 1.0})
    )
    paths = []
    for env in (calm, late, soon):
        env.reset(seed=3)
        controls = np.zeros((1, 40, 4))
        paths.append(env.rollout(env.get_state(), controls=controls).motion.pose[0, :, :2])
    assert np.array_equal(paths[0][:21], paths[1][:21])
    travelled = np.linalg.norm(paths[1][20:] - paths[1][20], axis=1)
    early = np.linalg.norm(paths[2][:21] - paths[2][0], axis=1)
    np.testing.assert_allclose(travelled, early, atol=1e-3)
    assert travelled[-1] == pytest.approx(20 * 0.1 * 0.05, rel=0.05)

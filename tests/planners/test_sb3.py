"""The adapter between the native VectorEnvs and Stable-Baselines3."""

from __future__ import annotations

import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.env.registry import ENVS, MOTIONS
from piec_envs.errors import InvalidParameterError, UnknownNameError

pytest.importorskip("stable_baselines3")

from stable_baselines3 import SAC, HerReplayBuffer
from stable_baselines3.common.env_checker import check_env
from stable_baselines3.common.vec_env import DummyVecEnv, VecMonitor, VecNormalize

from planners.sb3.vec_env import NativeVecEnv

ROOT = Path(__file__).resolve().parents[2]
PUSH = "piec_envs/PlanarArmPush-v0"
SHORT = {"escape_field": None, "max_episode_steps": 6, "threads": 1}
NOISY = {"disturbance": 0.005, "start_noise": (0.01, 0.05)}
STATIC = {"escape_field": "network"}
CHOICES = [
    (env_id, {**SHORT, **NOISY} if env_id in MOTIONS else {**STATIC, "object": "square"})
    for env_id in ENVS
]
CHOICES += [(PUSH, {**SHORT, **NOISY, "goal_conditioned": mode}) for mode in (True, "dense")]
CHOICES += [(PUSH, {"escape_field": None, "action_repeat": 250, **NOISY})]
TINY = {"policy_kwargs": {"net_arch": [8]}, "device": "cpu", "seed": 0}


def dummy(env_id, rows, **kwargs):
    return DummyVecEnv([lambda: gym.make(env_id, dtype="float32", **kwargs) for _ in range(rows)])


def assert_same(a, b):
    """Equal to the last bit, type and shape included, through dicts."""
    if isinstance(a, dict):
        assert a.keys() == b.keys()
        for name in a:
            assert_same(a[name], b[name])
        return
    assert np.asarray(a).dtype == np.asarray(b).dtype
    np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize(("env_id", "choice"), CHOICES, ids=str)
def test_it_equals_a_dummy_vec_env_across_the_ends_of_episodes(env_id, choice):
    native = NativeVecEnv(env_id, 3, **choice)
    plain = dummy(env_id, 3, **choice)
    assert native.observation_space == plain.observation_space
    assert native.seed(7) == plain.seed(7)
    assert_same(native.reset(), plain.reset())
    rng = np.random.default_rng(0)
    ends = 0
    for t in range(20):
        if t == 15:  # in the middle of an episode, and without a seed
            assert_same(native.reset(), plain.reset())
        actions = rng.uniform(-1, 1, (3, *native.action_space.shape)).astype(np.float32)
        a = native.step(actions)
        b = plain.step(actions)
        for x, y in zip(a[:3], b[:3], strict=True):
            assert_same(x, y)
        for row, ended in enumerate(a[2]):
            assert_same(a[3][row], b[3][row] if ended else {})
        ends += int(a[2].sum())
    assert ends >= 6


def test_vec_monitor_and_vec_normalize_work_on_it():
    wrapped = [
        VecNormalize(VecMonitor(make(PUSH, 2, **SHORT, **NOISY))) for make in (NativeVecEnv, dummy)
    ]
    for venv in wrapped:
        venv.seed(3)
    assert_same(*[venv.reset() for venv in wrapped])
    rng = np.random.default_rng(0)
    episodes = []
    for _ in range(13):
        actions = rng.uniform(-1, 1, (2, 4))
        a, b = (venv.step(actions) for venv in wrapped)
        for x, y in zip(a[:3], b[:3], strict=True):
            assert_same(x, y)
        for one, other in zip(np.array(a[3])[a[2]], np.array(b[3])[b[2]], strict=True):
            assert_same(one["terminal_observation"], other["terminal_observation"])
            assert (
                one["episode"]["r"] == other["episode"]["r"]
                and one["episode"]["l"] == other["episode"]["l"]
            )
            episodes.append(one["episode"]["l"])
    assert episodes == [6, 6, 6, 6]
    assert_same(*[venv.obs_rms.mean for venv in wrapped])


def test_the_rest_of_the_interface():
    venv = NativeVecEnv(PUSH, 2, **SHORT, render_mode="rgb_array")
    assert (
        venv.get_attr("render_mode") == ["rgb_array"] * 2
        and venv.get_attr("spec", [1])[0].id == PUSH
    )
    assert venv.has_attr("max_episode_steps") and not venv.has_attr("luck")
    assert venv.env_is_wrapped(gym.Wrapper, 0) == [False]
    venv.env_method("set_params", {"friction": 0.25})
    venv.set_options({"params": {"disturbance": 0.01}})
    venv.reset()
    assert [params.friction for params in venv.native.get_state().params] == [0.25, 0.25]
    assert [params.disturbance for params in venv.native.get_state().params] == [0.01, 0.01]
    venv.reset()  # options count once
    assert venv.native.get_state().params[0].disturbance == 0.0
    venv.set_attr("max_episode_steps", 2)
    assert not venv.step(np.zeros((2, 4)))[2].any() and venv.step(np.zeros((2, 4)))[2].all()
    assert len(venv.get_images()) == 2 and venv.render().shape[2] == 3
    venv.close()
    blind = NativeVecEnv(PUSH, 2, **SHORT)
    blind.reset()
    assert blind.get_images() == [None, None]


def test_what_it_cannot_do_is_refused():
    for name, value in {"dtype": "float64", "autoreset_mode": "Disabled"}.items():
        with pytest.raises(InvalidParameterError, match=name):
            NativeVecEnv(PUSH, 2, **{name: value})
    with pytest.raises(UnknownNameError, match="PlanarArmPush"):
        NativeVecEnv("piec_envs/PlanarArmPusch-v0")
    with pytest.raises(InvalidParameterError, match="num_envs"):
        NativeVecEnv(PUSH, 0)
    venv = NativeVecEnv(PUSH, 2, **SHORT)
    with pytest.raises(InvalidParameterError, match="share 'set_params'"):
        venv.env_method("set_params", {"friction": 0.2}, indices=[0])
    with pytest.raises(InvalidParameterError, match="share 'render_mode'"):
        venv.set_attr("render_mode", None, indices=1)
    venv.set_options([{"params": {"friction": 0.2}}, {}])
    with pytest.raises(InvalidParameterError, match="share their options"):
        venv.reset()


@pytest.mark.parametrize(
    ("env_id", "choice"),
    [(env_id, {"escape_field": None} if env_id in MOTIONS else STATIC) for env_id in ENVS]
    + [(env_id, {"escape_field": None, "goal_conditioned": True}) for env_id in MOTIONS],
    ids=str,
)
def test_stable_baselines3_checks_every_environment(env_id, choice):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # Double precision is meant, so that plans replay to the last bit; float32 actions are taken
        # as well.
        warnings.filterwarnings("ignore", message="Your action space has dtype float64")
        env = gym.make(env_id, **choice).unwrapped
        check_env(env)
    # by which SB3 tells which is which
    assert hasattr(env, "compute_reward") == ("goal_conditioned" in choice)


@pytest.mark.parametrize("mode", [True, "dense"])
def test_hindsight_replay(mode):
    venv = NativeVecEnv(PUSH, 4, **SHORT, **NOISY, goal_conditioned=mode)
    rng = np.random.default_rng(0)
    achieved, desired = rng.normal(size=(2, 9, 2)).astype(np.float32)
    (rewards,) = venv.env_method("compute_reward", achieved, desired, [{}] * 9, indices=[0])
    single = gym.make(PUSH, escape_field=None, goal_conditioned=mode).unwrapped
    assert rewards.tolist() == [
        single.compute_reward(a, d) for a, d in zip(achieved, desired, strict=True)
    ]
    model = SAC(
        "MultiInputPolicy",
        venv,
        replay_buffer_class=HerReplayBuffer,
        learning_starts=100,
        batch_size=16,
        **TINY,
    )
    model.learn(300)
    assert model.num_timesteps == 300 and model._n_updates > 0
    sample = model.replay_buffer.sample(64)
    pairs = (
        sample.next_observations["achieved_goal"].numpy(),
        sample.observations["desired_goal"].numpy(),
    )
    (expected,) = venv.env_method("compute_reward", *pairs, None, indices=[0])
    np.testing.assert_allclose(sample.rewards.numpy()[:, 0], expected, rtol=1e-6)


def test_planners_import_neither_torch_nor_stable_baselines3():
    code = "import sys, planners, planners.sb3, evaluation; "
    code += "print({'torch', 'stable_baselines3', 'sb3_contrib'} & set(sys.modules))"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert done.stdout.strip() == "set()"

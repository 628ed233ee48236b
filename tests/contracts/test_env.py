"""Contracts of every registered environment, single and vector."""

from __future__ import annotations

import warnings

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

from piec_envs.env.registry import ENVS, MOTIONS
from piec_envs.world.objects import OBJECTS

CHOICES = [
    {},
    {"escape_field": None},
    {"escape_field": None, "prior": "contact"},
    {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}, "escape_every": 7},
    {"solver": "osqp", "escape_field": None},
    {"prior": "proximity", "preset": "paper"},
    {"prior": None, "dtype": "float32"},
    {"disturbance": 0.005, "start_noise": (0.01, 0.05)},
    {"disturbance": 0.003, "disturbance_kind": "direction", "noise_entry": "state"},
    {"adversary": 1.0},
    {"goal_conditioned": True},
    {"goal_conditioned": "dense", "dtype": "float32"},
    {"goal": (-0.2, 0.45), "weights": {"task": 500.0}, "action_repeat": 10},
    {"friction": 0.0, "threads": 1, "inertia": "own"},
    {
        "randomize": {
            "friction": [0.2, 0.8],
            "object": ["circle", "square"],
            "disturbance": [0.0, 0.005],
        }
    },
    *({"object": name, "escape_every": 50} for name, item in OBJECTS.items() if not item.loose),
    *({"dynamics": "mujoco", "object": name, "escape_field": None} for name in OBJECTS),
    {
        "dynamics": "mujoco",
        "disturbance": 0.005,
        "adversary": 0.5,
        "start_noise": (0.01, 0.05),
        "friction": 0.0,
    },
    {
        "randomize": {"dynamics": ["quasi_dynamic", "mujoco"], "friction": [0.2, 0.8]},
        "goal_conditioned": True,
    },
    {"dynamics": "mujoco", "randomize": {"mass": [0.5, 2.0], "delay": [0.0, 0.1]}},
]
# What every id has: the planar arm takes every choice and every object, the others a set in which
# each keyword argument that could depend on the robot and, under each dynamics, some object of each
# kind has its turn.
REPRESENTATIVE = [
    {},
    {"escape_field": None, "prior": "contact"},
    {"solver": "osqp", "escape_field": None},
    {"disturbance": 0.003, "disturbance_kind": "direction", "noise_entry": "state"},
    {"adversary": 1.0},
    {"goal_conditioned": "dense", "dtype": "float32"},
    {"goal": (-0.2, 0.45), "weights": {"task": 500.0}, "action_repeat": 10},
    {
        "randomize": {
            "friction": [0.2, 0.8],
            "object": ["circle", "square"],
            "disturbance": [0.0, 0.005],
        }
    },
    {"object": "a4_box", "escape_every": 50},
    {"object": "paper_pack", "escape_every": 50, "inertia": "own"},
    {"dynamics": "mujoco", "object": "a4_box_roll_1", "start": "home", "escape_field": None},
    {
        "dynamics": "mujoco",
        "disturbance": 0.005,
        "adversary": 0.5,
        "start_noise": (0.01, 0.05),
        "friction": 0.0,
    },
    {
        "randomize": {"dynamics": ["quasi_dynamic", "mujoco"], "friction": [0.2, 0.8]},
        "goal_conditioned": True,
    },
]
FULL = "piec_envs/PlanarArmPush-v0"
NOISY = {"disturbance": 0.005, "adversary": 0.3, "start_noise": (0.01, 0.05), "object": "square"}
STATIC = tuple(env_id for env_id in ENVS if env_id not in MOTIONS)  # one step, no plant
STATIC_CHOICES = [
    {},
    {"pose": (0.2, -0.2, 1.0), "dtype": "float32"},
    {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}, "threads": 1},
    {"reduce": "max"},
    *({"object": name} for name in OBJECTS),
]
EVERY_CHOICE = [
    (env_id, choice)
    for env_id in MOTIONS
    for choice in (CHOICES if env_id == FULL else REPRESENTATIVE)
] + [(env_id, choice) for env_id in STATIC for choice in STATIC_CHOICES]
MIXED = {
    "dynamics": ["quasi_dynamic", "mujoco"],
    "object": ["circle", "square"],
    "friction": [0.1, 0.9],
}
ROW_CHOICES = [
    {},
    NOISY,
    {"goal_conditioned": True, **NOISY},
    {"randomize": {"friction": [0.1, 0.9]}},
    {"dynamics": "mujoco", **NOISY},
    {"randomize": MIXED},
    {
        "dynamics": "mujoco",
        "start": "home",
        "randomize": {
            "object": ["a4_box", "a4_box_roll_1"],
            "mass": [0.5, 2.0],
            "delay": [0.0, 0.1],
        },
    },
]
EVERY_ROW = [(env_id, choice) for env_id in MOTIONS for choice in ROW_CHOICES] + [
    (env_id, choice)
    for env_id in STATIC
    for choice in ({}, {"object": "square", "dtype": "float32"})
]


def drawn(env_id):
    """Keyword arguments with which every episode is another."""
    return NOISY if env_id in MOTIONS else {"object": "square"}


def same(a, b) -> bool:
    """Equal to the last bit, through dicts."""
    if isinstance(a, dict):
        return a.keys() == b.keys() and all(same(a[k], b[k]) for k in a)
    return np.array_equal(a, b)


def row_of(value, i):
    return (
        {k: row_of(v, i) for k, v in value.items() if not k.startswith("_")}
        if isinstance(value, dict)
        else value[i]
    )


@pytest.mark.parametrize(("env_id", "choice"), EVERY_CHOICE, ids=str)
def test_check_env(env_id, choice):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.filterwarnings("ignore", category=PendingDeprecationWarning, module="osqp")
        check_env(gym.make(env_id, **choice).unwrapped, skip_render_check=True)


@pytest.mark.parametrize("env_id", ENVS)
def test_check_env_renders(env_id):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(env_id, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize(("env_id", "choice"), EVERY_ROW, ids=str)
def test_vector_row_equals_single_env(env_id, choice):
    envs = gym.make_vec(env_id, num_envs=3, **choice)
    singles = [gym.make(env_id, **choice) for _ in range(3)]
    observation, info = envs.reset(seed=5)
    for i, env in enumerate(singles):
        one, one_info = env.reset(seed=5 + i)
        assert same(row_of(observation, i), one) and same(row_of(info, i), one_info)
    rng = np.random.default_rng(0)
    ended = np.zeros(3, dtype=bool)
    for t in range(45):
        actions = rng.uniform(-1, 1, envs.action_space.shape)
        observation, reward, terminated, truncated, info = envs.step(actions)
        for i, env in enumerate(singles):
            if ended[i]:  # the row begins anew in this step
                one, one_info = env.reset()
                one_reward, one_terminated, one_truncated = 0.0, False, False
            else:
                one, one_reward, one_terminated, one_truncated, one_info = env.step(actions[i])
            assert same(row_of(observation, i), one) and same(row_of(info, i), one_info), t
            assert (reward[i], terminated[i], truncated[i]) == (
                one_reward,
                one_terminated,
                one_truncated,
            )
        ended = terminated | truncated
    assert ended.any() == (env_id in STATIC)


@pytest.mark.parametrize("env_id", ["piec_envs/PlanarArmPush-v0", *STATIC])
@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_autoreset_equals_sync_vector_env(env_id, mode):
    """The native VectorEnv against Gymnasium's own, episodes of 12 steps or one, infos included."""
    choice = {**NOISY, "escape_every": 5, "max_episode_steps": 12} if env_id in MOTIONS else {}
    native = gym.make_vec(env_id, num_envs=2, autoreset_mode=mode, **choice)
    plain = gym.make_vec(
        env_id,
        num_envs=2,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **choice,
    )
    assert native.metadata["autoreset_mode"] == mode
    a, b = native.reset(seed=3), plain.reset(seed=3)
    assert same(a[0], b[0]) and same(a[1], b[1])
    rng = np.random.default_rng(1)
    for _ in range(30):
        actions = rng.uniform(-1, 1, native.action_space.shape)
        a, b = native.step(actions), plain.step(actions)
        for x, y in zip(a[:4], b[:4], strict=True):
            np.testing.assert_array_equal(x, y)
        assert a[4].keys() == b[4].keys()
        for key in a[4]:
            if key == "final_obs":
                assert all(
                    same(x, y) for x, y in zip(a[4][key], b[4][key], strict=True) if x is not None
                )
            else:
                assert same(a[4][key], b[4][key]), key
        ended = a[2] | a[3]
        if mode == AutoresetMode.DISABLED and ended.any():
            a, b = (
                native.reset(options={"reset_mask": ended}),
                plain.reset(options={"reset_mask": ended.copy()}),
            )
            assert same(a[0], b[0]) and same(a[1], b[1])


EVERY_PLANT = [(env_id, drawn(env_id)) for env_id in ENVS] + [
    (env_id, {"dynamics": "mujoco", **NOISY}) for env_id in MOTIONS
]


@pytest.mark.parametrize(("env_id", "choice"), EVERY_PLANT, ids=str)
def test_reset_is_reproducible(env_id, choice):
    def episode(env, seed):
        observation, _ = env.reset(seed=seed)
        steps = [env.step(action) for action in actions]
        return [observation, *(step[0] for step in steps)], [step[1] for step in steps]

    env = gym.make(env_id, **choice)
    shape = (20 if env_id in MOTIONS else 1, *env.action_space.shape)
    actions = np.random.default_rng(0).uniform(-1, 1, shape)
    first, unseeded = episode(env, 7), episode(env, None)
    again, unseeded_again = episode(env, 7), episode(env, None)
    for one, other in ((first, again), (unseeded, unseeded_again)):
        np.testing.assert_array_equal(one[0], other[0])
        assert one[1] == other[1]
    assert not np.array_equal(first[0], unseeded[0])


@pytest.mark.parametrize("env_id", ENVS)
def test_spec_round_trip(env_id):
    given = {"goal": (-0.2, 0.4)} if env_id in MOTIONS else {"pose": (0.2, 0.1, 0.5)}
    env = gym.make(env_id, **drawn(env_id), **given)
    spec = gym.envs.registration.EnvSpec.from_json(env.spec.to_json())
    again = gym.make(spec)
    assert same(env.reset(seed=0)[0], again.reset(seed=0)[0])
    assert again.unwrapped.config == env.unwrapped.config


@pytest.mark.parametrize(("dynamics", "rows"), [("quasi_dynamic", 256), ("mujoco", 8)])
def test_async_vector_env_works_after_a_batched_call(dynamics, rows):
    """A forked child must not wait for the threads of its parent."""
    env_id, choice = "piec_envs/PlanarArmPush-v0", {"dynamics": dynamics}
    native = gym.make_vec(env_id, num_envs=rows, **choice)
    native.reset(seed=0)
    native.step(native.action_space.sample())
    how = {"context": "fork", "shared_memory": False}
    forked = gym.make_vec(
        env_id, num_envs=2, vectorization_mode="async", vector_kwargs=how, **choice
    )
    observation, _ = forked.reset(seed=0)
    assert observation.shape == (2, 23)
    stepped = forked.step(np.ones((2, 4)))[0]
    forked.close()
    here = gym.make_vec(env_id, num_envs=2, **choice)
    here.reset(seed=0)
    np.testing.assert_array_equal(stepped, here.step(np.ones((2, 4)))[0])


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
    times, before = [info["escape_time"]], env.get_state().pose[0]
    for _ in range(60):
        times.append(env.step(np.zeros(4))[4]["escape_time"])
    moved = np.linalg.norm(env.get_state().pose[0, :2] - before[:2])
    assert moved == pytest.approx(60 * 0.1 * 0.05, rel=1e-2)
    np.testing.assert_allclose(np.diff(times), -0.1, atol=0.03)  # a second each second


def test_compute_reward_is_vectorised_and_equals_the_step():
    for mode in (True, "dense"):
        env = gym.make(
            "piec_envs/PlanarArmPush-v0", goal_conditioned=mode, escape_field=None
        ).unwrapped
        env.reset(seed=0)
        observation, reward, *_ = env.step(np.ones(4))
        achieved, desired = observation["achieved_goal"], observation["desired_goal"]
        assert env.compute_reward(achieved, desired, {}) == reward
        many = env.compute_reward(np.stack([achieved, desired]), np.stack([desired, desired]), None)
        np.testing.assert_array_equal(many, [reward, 0.0])


def test_tracking_success_needs_the_path_and_its_end():
    env = gym.make("piec_envs/PlanarArmTrack-v0", escape_field=None).unwrapped
    goal = [*env.model.task.goal, 0.0]
    env.reset(seed=0, options={"state": {"q_r": [-1.0, 0, 0, 0], "pose": goal}})
    info = env.step(np.zeros(4))[4]
    assert info["d2g"] == 0 and not info["is_success"]  # it waits at the end instead of following
    assert info["tracking_error"] > 0.5

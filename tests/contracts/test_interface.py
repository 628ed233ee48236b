"""What other libraries ask of an environment: errors, calls before a reset, infos, generators,
specs and lengths.
"""

from __future__ import annotations

import pickle

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.error import ResetNeeded
from gymnasium.vector import AutoresetMode

from piec_envs.env.makers import PlanarArmPush
from piec_envs.env.registry import ENVS, MOTIONS
from piec_envs.errors import InvalidActionError, PiecError, ResetNeededError, UnknownArgumentError

PUSH = "piec_envs/PlanarArmPush-v0"
CAGE = "piec_envs/PlanarArmCage-v0"
WITHOUT_FIELD = {"escape_field": None}
COARSE = {"escape_field": {"name": "grid", "resolution": 48, "method": "marching"}}


def quick(env_id):
    """Keyword arguments with which an environment is made at once."""
    return dict(WITHOUT_FIELD if env_id in MOTIONS else COARSE)


def native(env_id, rows=2, **choice):
    return gym.make_vec(env_id, num_envs=rows, **quick(env_id), **choice)


def synchronous(env_id, rows=2, mode=AutoresetMode.NEXT_STEP, **choice):
    return gym.make_vec(
        env_id,
        num_envs=rows,
        vectorization_mode="sync",
        vector_kwargs={"autoreset_mode": mode},
        **quick(env_id),
        **choice,
    )


# --- unknown keyword arguments -----------------------------------------------------------------


@pytest.mark.parametrize("env_id", ENVS)
@pytest.mark.parametrize("make", [gym.make, native, synchronous])
def test_an_unknown_argument_is_also_what_python_would_say(env_id, make):
    with pytest.raises(
        TypeError, match=r"got an unexpected keyword argument 'frameskip'; known: .*object"
    ) as caught:
        make(env_id, frameskip=1)
    assert isinstance(caught.value, UnknownArgumentError) and isinstance(caught.value, ValueError)


def test_an_unknown_argument_says_what_may_have_been_meant_and_crosses_processes():
    with pytest.raises(
        UnknownArgumentError, match=r"'fiction'; known: .*Did you mean 'friction'"
    ) as caught:
        PlanarArmPush(fiction=0.5)
    for error in (caught.value, UnknownArgumentError("a text alone, as Gymnasium makes it again")):
        assert str(pickle.loads(pickle.dumps(error))) == str(error)


def test_an_argument_of_one_environment_alone_is_listed_there():
    with pytest.raises(UnknownArgumentError, match="geometry"):
        gym.make("piec_envs/FrankaCage-v0", luck=1)
    with pytest.raises(UnknownArgumentError, match=r"contact, .*reference"):
        gym.make("piec_envs/MobileFrankaTrack-v0", luck=1)


# --- before an episode has begun ---------------------------------------------------------------


def calls(env, motion):
    """What needs an episode."""
    actions = np.zeros(env.action_space.shape)
    named = {"step": lambda: env.step(actions), "render": env.render}
    return {**named, "get_state": env.get_state, "get_params": env.get_params} if motion else named


@pytest.mark.parametrize("env_id", ENVS)
def test_a_vector_env_names_the_rows_that_have_not_begun(env_id):
    envs = native(env_id, 3, render_mode="rgb_array").unwrapped
    for name, call in calls(envs, env_id in MOTIONS).items():
        with pytest.raises(ResetNeeded, match=rf"{name} .*rows \[0, 1, 2\]") as caught:
            call()
        assert isinstance(caught.value, PiecError)
    envs.reset(options={"reset_mask": np.array([False, True, False])})
    for call in calls(envs, env_id in MOTIONS).values():
        with pytest.raises(ResetNeededError, match=r"rows \[0, 2\]"):
            call()
    envs.reset(options={"reset_mask": np.array([True, False, True])})
    for call in calls(envs, env_id in MOTIONS).values():
        call()


@pytest.mark.parametrize("env_id", ENVS)
def test_a_single_env_needs_a_reset_without_gymnasiums_own_check_too(env_id):
    env = gym.make(env_id, render_mode="rgb_array", **quick(env_id)).unwrapped
    for name, call in calls(env, env_id in MOTIONS).items():
        with pytest.raises(ResetNeeded, match=name):
            call()
    env.reset(seed=0)
    for call in calls(env, env_id in MOTIONS).values():
        call()


def test_a_refused_reset_begins_nothing():
    env = gym.make(PUSH, **WITHOUT_FIELD).unwrapped
    envs = native(PUSH)
    for each in (env, envs):
        with pytest.raises(PiecError):
            each.reset(options={"state": {"pose": [0.5, 0.0, 0.0]}})
        with pytest.raises(ResetNeeded):
            each.step(np.zeros(each.action_space.shape))


def test_a_state_begins_the_episodes_too():
    first = native(PUSH, max_episode_steps=3)
    second = native(PUSH, max_episode_steps=3)
    first.reset(seed=0)
    second.unwrapped.set_state(first.unwrapped.get_state())
    for _ in range(5):  # and rows without a seed of their own begin anew
        second.step(np.zeros((2, 4)))
    env = gym.make(PUSH, **WITHOUT_FIELD).unwrapped
    env.set_state(first.unwrapped.get_state().take([0]))
    env.step(np.zeros(4))


def test_the_adapter_of_stable_baselines3_needs_a_reset():
    pytest.importorskip("stable_baselines3")
    from planners.sb3.vec_env import NativeVecEnv

    venv = NativeVecEnv(PUSH, 2, render_mode="rgb_array", **WITHOUT_FIELD)
    for call in (
        lambda: venv.step(np.zeros((2, 4))),
        venv.get_images,
        lambda: venv.env_method("get_state"),
    ):
        with pytest.raises(ResetNeeded, match=r"rows \[0, 1\]"):
            call()


# --- infos ------------------------------------------------------------------------------------


def check_entries(info, shape):
    """Nothing but flat arrays and NumPy's numbers, in the order of rows."""
    for name, entry in info.items():
        assert isinstance(entry, np.ndarray | np.number), name
        assert entry.dtype.kind in "fb" and entry.shape[: len(shape)] == shape, name


@pytest.mark.parametrize("env_id", ENVS)
def test_infos_are_numbers_in_flat_arrays(env_id):
    env = gym.make(env_id, **quick(env_id))
    info = env.reset(seed=0)[1]
    stepped = env.step(env.action_space.sample())[4]
    assert info.keys() == stepped.keys()
    check_entries(info, ())
    check_entries(stepped, ())
    for make in (native, synchronous):
        envs = make(env_id)
        several = envs.reset(seed=0)[1]
        later = envs.step(envs.action_space.sample())[4]
        assert (
            set(info) == {name for name in several if not name.startswith("_")}
            and several.keys() == later.keys()
        )
        check_entries(several, (2,))
        check_entries(later, (2,))


@pytest.mark.parametrize("env_id", ENVS)
def test_gymnasiums_converter_to_torch_takes_every_environment(env_id):
    torch = pytest.importorskip("torch")
    pytest.importorskip("array_api_compat")  # which the converter is made of
    from gymnasium.wrappers import NumpyToTorch
    from gymnasium.wrappers.vector import NumpyToTorch as VectorNumpyToTorch

    limit = {"max_episode_steps": 3} if env_id in MOTIONS else {}
    env = NumpyToTorch(gym.make(env_id, **quick(env_id), **limit))
    for info in (env.reset(seed=0)[1], env.step(torch.zeros(env.action_space.shape))[4]):
        assert all(isinstance(entry, torch.Tensor) for entry in info.values())
        assert info["is_success"].dtype == torch.bool
    for make in (native, synchronous):
        envs = VectorNumpyToTorch(make(env_id, **limit))
        infos = [envs.reset(seed=0)[1]]
        # through an autoreset
        infos += [envs.step(torch.zeros(envs.action_space.shape))[4] for _ in range(5)]
        for info in infos:
            assert all(isinstance(entry, torch.Tensor) for entry in info.values())
            assert info["penetration"].shape == (2,)


def test_what_stays_the_same_is_told_on_request():
    envs = native(PUSH, friction=0.3)
    plain = synchronous(PUSH, friction=0.3)
    envs.reset(seed=4)
    plain.reset(seed=4)
    told = envs.unwrapped.get_params()
    singles = plain.call("get_params")
    assert told["object"].tolist() == ["circle", "circle"] and told["friction"].tolist() == [
        0.3,
        0.3,
    ]
    for name, values in told.items():
        for row in range(2):
            np.testing.assert_array_equal(values[row], singles[row][name])
    envs.unwrapped.set_params({"friction": 0.7})  # of the episodes to come
    assert envs.unwrapped.get_params()["friction"].tolist() == [0.3, 0.3]


# --- messages ---------------------------------------------------------------------------------


@pytest.mark.parametrize("env_id", ENVS)
def test_a_single_env_speaks_of_one_action(env_id):
    env = gym.make(env_id, disable_env_checker=True, **quick(env_id))
    env.reset(seed=0)
    (n,) = env.action_space.shape
    for action, words in (
        (np.zeros(n + 1), rf"the action must have shape \({n},\), got \({n + 1},\)"),
        (np.zeros((1, n)), rf"the action must have shape \({n},\), got \(1, {n}\)"),
        ("left", rf"the action must be numbers of shape \({n},\), got 'left'"),
        (np.full(n, np.nan), r"the action must be finite, got \[nan"),
    ):
        with pytest.raises(InvalidActionError, match=words):
            env.step(action)


def test_a_refused_pose_is_told_as_it_was_given():
    env = gym.make(CAGE)
    with pytest.raises(PiecError, match=r"at pose \[1.39, 0.0, 0.0\]"):
        env.reset(options={"pose": (1.39, 0.0, 0.0)})

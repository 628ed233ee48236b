"""Trainings that cannot be are refused before anything is written."""

from __future__ import annotations

import dataclasses

import pytest

from piec_envs.errors import InvalidParameterError, UnknownNameError

pytest.importorskip("stable_baselines3")

from planners.sb3 import TrainSpec, train

ENV = {"escape_field": None, "action_repeat": 100, "threads": 1}
SPEC = TrainSpec(
    "piec_envs/PlanarArmPush-v0",
    "ppo",
    200,
    n_envs=2,
    env_kwargs=ENV,
    evaluations=5,
    eval_episodes=2,
)


@pytest.mark.parametrize(
    ("changes", "error", "message"),
    [
        ({"env_id": "piec_envs/PlanarArmCage-v0"}, UnknownNameError, "PlanarArmPush"),
        ({"algo": "ppp"}, UnknownNameError, "Did you mean 'ppo'"),
        ({"timesteps": 0}, InvalidParameterError, "timesteps"),
        ({"seed": -1}, InvalidParameterError, "seed"),
        ({"seed": 2**31 - 1}, InvalidParameterError, "seed"),
        (
            {"hyper": {"batch_size": "many"}},
            InvalidParameterError,
            "Stable-Baselines3 refuses the hyper-parameters",
        ),
        ({"hyper": {"normalize": {"luck": 1}}}, InvalidParameterError, "refuses normalize: .*luck"),
        ({"env_kwargs": {"object": object}}, InvalidParameterError, "JSON"),
        ({"env_kwargs": {"luck": 1}}, UnknownNameError, "luck"),
        ({"hyper": {"n_stepps": 3}}, UnknownNameError, "Did you mean 'n_steps'"),
        ({"hyper": {"learning_rate": "fast"}}, InvalidParameterError, "lin_3e-4"),
        (
            {"hyper": {"policy_kwargs": "dict(net_arch=__import__('os'))"}},
            InvalidParameterError,
            "literals",
        ),
        (
            {"hyper": {"policy_kwargs": "dict(activation_fn=nn.functional)"}},
            InvalidParameterError,
            "literals",
        ),
        ({"hyper": {"normalize": 3}}, InvalidParameterError, "normalize"),
        (
            {
                "hyper": {"normalize": {"norm_obs_keys": ["desired_goal"]}},
                "env_kwargs": {"goal_conditioned": True},
            },
            InvalidParameterError,
            "norm_obs_keys may be .'observation'. alone",
        ),
    ],
    ids=str,
)
def test_bad_specs_are_refused(changes, error, message, tmp_path):
    with pytest.raises(error, match=message):
        train(dataclasses.replace(SPEC, **changes), tmp_path, progress=False)
    assert not list(tmp_path.iterdir())  # the same folder takes the corrected spec

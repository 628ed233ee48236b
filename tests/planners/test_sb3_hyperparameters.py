from __future__ import annotations

from importlib import resources

import pytest

from piec_envs.env.registry import MOTIONS
from piec_envs.errors import InvalidParameterError, UnknownNameError

pytest.importorskip("stable_baselines3")

from torch import nn

from planners.sb3 import ALGORITHMS, TrainSpec, default_spec
from planners.sb3.hyperparameters import (
    model_arguments,
    normalisation_arguments,
    parse,
    read_hyperparameters,
)

PUSH = "piec_envs/PlanarArmPush-v0"


def arguments_of(hyper, algo="ppo"):
    return model_arguments(TrainSpec(PUSH, algo, 1, hyper=hyper))


@pytest.mark.parametrize("algo", ALGORITHMS)
@pytest.mark.parametrize("env_id", MOTIONS)
def test_every_pair_has_a_file_that_its_algorithm_takes(env_id, algo):
    spec = default_spec(env_id, algo)
    arguments = model_arguments(spec)
    assert (
        spec.timesteps >= 100_000
        and spec.n_envs >= 16
        and spec.env_kwargs["start_noise"] == [0.01, 0.05]
    )
    assert (
        arguments["policy"] == "MlpPolicy"
        and not {"n_envs", "n_timesteps", "env_kwargs"} & arguments.keys()
    )
    if algo == "ppo":
        assert spec.n_envs * arguments["n_steps"] % arguments["batch_size"] == 0


def test_files_are_in_the_format_of_rl_zoo():
    import yaml

    folder = resources.files("planners.sb3") / "hyperparameters"
    files = [file for file in folder.iterdir() if file.name.endswith(".yml")]
    assert len(files) == len(MOTIONS) * len(ALGORITHMS)
    for file in files:
        (env_id,) = yaml.safe_load(file.read_text(encoding="utf-8"))
        assert file.name.rpartition(".")[0].rpartition(".")[0] == env_id.removeprefix("piec_envs/")


def test_what_is_given_goes_before_the_file():
    spec = default_spec(PUSH, "ppo", 3, 500, {"object": "square"}, {"n_envs": 8, "gamma": 0.9})
    assert (spec.seed, spec.timesteps, spec.n_envs) == (3, 500, 8)
    assert spec.env_kwargs["object"] == "square" and spec.env_kwargs["start_noise"] == [0.01, 0.05]
    assert normalisation_arguments(spec) == {"gamma": 0.9, "norm_obs": False, "norm_reward": True}
    assert default_spec(PUSH, "sac", hyper={"n_timesteps": "5e4"}).timesteps == 50_000


def test_unknown_pairs_are_refused_with_what_is_there():
    with pytest.raises(
        UnknownNameError, match=r"'ppo on piec_envs/PlanarArmCage-v0'; known: .*tqc on piec_envs/"
    ):
        read_hyperparameters("piec_envs/PlanarArmCage-v0", "ppo")
    with pytest.raises(UnknownNameError, match="Did you mean 'sac on piec_envs/PlanarArmPush-v0'"):
        default_spec(PUSH, "sacc")
    with pytest.raises(InvalidParameterError, match="n_envs"):
        default_spec(PUSH, "sac", hyper={"n_envs": "many"})
    with pytest.raises(InvalidParameterError, match=r"timesteps .* got 2\.5"):
        default_spec(PUSH, "sac", steps=2.5)


def test_values_become_what_the_algorithm_takes():
    arguments = arguments_of({"learning_rate": "lin_3e-4", "clip_range": "2e-1", "normalize": True})
    assert arguments["learning_rate"](0.5) == 1.5e-4 and arguments["clip_range"] == 0.2
    assert "normalize" not in arguments and arguments["device"] == "cpu"
    assert arguments_of({"train_freq": [1, "step"]}, "sac")["train_freq"] == (1, "step")
    text = (
        "dict(net_arch=dict(pi=[64, 32], vf=[8]), activation_fn=nn.ELU, log_std_init=-1.5, "
        "ortho_init=False)"
    )
    assert parse("policy_kwargs", text) == {
        "net_arch": {"pi": [64, 32], "vf": [8]},
        "activation_fn": nn.ELU,
        "log_std_init": -1.5,
        "ortho_init": False,
    }
    assert parse("policy_kwargs", "{'net_arch': [4]}") == {"net_arch": [4]}
    assert normalisation_arguments(TrainSpec(PUSH, "sac", 1)) is None
    assert normalisation_arguments(TrainSpec(PUSH, "sac", 1, hyper={"normalize": True})) == {
        "gamma": 0.99
    }


@pytest.mark.parametrize(
    "text",
    ["print(1)", "dict(**{})", "dict([1])", "nn.Parameter", "nn.Nothing", "torch.nn.ELU", "(", "a"],
)
def test_text_is_not_run_as_code(text):
    with pytest.raises(InvalidParameterError, match="policy_kwargs may hold literals"):
        parse("policy_kwargs", text)

from __future__ import annotations

import gymnasium as gym
import pytest

import piec_envs  # noqa: F401  registers the environments
from evaluation.protocols import PROTOCOLS, get_protocol, is_random
from piec_envs.episodes.config import EnvConfig
from piec_envs.episodes.state import PlantParams
from piec_envs.errors import UnknownNameError

PLAIN = [name for name in PROTOCOLS if not name.endswith("-start")]
LEVELS = [f"disturbance-{mm}mm{kind}" for kind in ("", "-direction") for mm in (1, 3, 5)]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_rows_are_valid(name):
    protocol = get_protocol(name)
    assert protocol.name == name and protocol.description
    PlantParams().replace(protocol.params)
    EnvConfig("planar_arm_push", **protocol.env_kwargs({"object": "square"}))
    drawn = name.endswith("-start") or name in LEVELS or name == "combined"
    assert is_random(protocol.env_kwargs()) == drawn


@pytest.mark.parametrize("name", PROTOCOLS)
def test_rows_make_an_env(name):
    env = gym.make("piec_envs/PlanarArmPush-v0", **get_protocol(name).env_kwargs())
    _, info = env.reset(seed=0)
    for key, value in get_protocol(name).params.items():
        assert info["params"][key] == value
    env.close()


def test_the_issues_protocols_are_there():
    frictions = [f"friction-{mu}" for mu in ("0.00", "0.20", "0.25", "0.50", "0.75", "0.80", "1.00")]
    shapes = [f"shape-{name}" for name in ("octagon", "hexagon", "square", "box_212")]
    assert set(PLAIN) == {"nominal", *frictions, *shapes, "dynamics-mujoco", *LEVELS, "adversary", "combined"}
    assert get_protocol("disturbance-3mm-direction").params == {
        "disturbance": 0.003,
        "disturbance_kind": "direction",
    }
    assert get_protocol("friction-0.25").params == {"friction": 0.25}
    assert get_protocol("shape-hexagon").params == {"object": "hexagon"}


@pytest.mark.parametrize("name", PLAIN)
def test_twins_differ_by_the_drawn_start_alone(name):
    plain, twin = get_protocol(name), get_protocol(f"{name}-start")
    assert plain.start_noise is None and twin.start_noise == (0.01, 0.05)
    assert plain.params == twin.params
    assert twin.env_kwargs() == {**plain.env_kwargs(), "start_noise": [0.01, 0.05]}
    assert plain.unperturbed == "nominal"
    assert twin.unperturbed == ("nominal" if name == "nominal" else "nominal-start")


@pytest.mark.parametrize("name", PLAIN[1:])
def test_twins_of_one_seed_start_at_the_same_pose(name):
    poses = []
    for protocol in ("nominal-start", f"{name}-start"):
        env = gym.make("piec_envs/PlanarArmPush-v0", **get_protocol(protocol).env_kwargs())
        poses.append([env.reset(seed=seed)[1]["params"]["start"].tolist() for seed in range(5)])
        env.close()
    assert poses[0] == poses[1]
    assert len({tuple(pose) for pose in poses[0]}) == 5


def test_a_protocol_overrides_the_users_arguments_and_keeps_the_others():
    base = {"disturbance": 0.1, "object": "square"}
    assert get_protocol("disturbance-1mm").env_kwargs(base)["disturbance"] == 0.001
    assert get_protocol("nominal").env_kwargs(base) == base


def test_an_unknown_name_lists_the_known_ones():
    with pytest.raises(UnknownNameError, match=r"disturbance-5mm.*nominal"):
        get_protocol("disturbance-7mm")

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest

import piec_envs  # noqa: F401  registers the environments
from evaluation.axes import AXES
from evaluation.plants import check_suits
from evaluation.protocol import family, is_random
from evaluation.protocols import PROTOCOLS, get_protocol
from piec_envs.dynamics.plant import PlantParams
from piec_envs.env.config import EnvConfig
from piec_envs.errors import InvalidParameterError, UnknownNameError
from piec_envs.model.task import TASKS
from piec_envs.world.objects import OBJECTS

PUSH = "piec_envs/PlanarArmPush-v0"
# these have starts of their own, and no twin
REAL = [name for name in PROTOCOLS if name.startswith("sim-to-real-")]
PLAIN = [name for name in PROTOCOLS if not name.endswith("-start") and name not in REAL]
LEVELS = [f"disturbance-{mm}mm{kind}" for kind in ("", "-direction") for mm in (1, 3, 5)]


@pytest.mark.parametrize("name", PROTOCOLS)
def test_rows_are_valid(name):
    protocol = get_protocol(name)
    assert protocol.name == name and protocol.description
    PlantParams().replace(protocol.params)
    EnvConfig(task="planar_arm_push", **protocol.env_kwargs({"object": "square"}))
    drawn = name.endswith("-start") or name in [*LEVELS, *REAL, "combined"]
    assert is_random(protocol.env_kwargs()) == drawn


def drawn_params(env, seed):
    """Plant parameters in force after a reset."""
    env.reset(seed=seed)
    return env.unwrapped.get_params()


@pytest.mark.parametrize("name", PROTOCOLS)
def test_rows_make_an_env(name):
    env = gym.make("piec_envs/PlanarArmPush-v0", **get_protocol(name).env_kwargs())
    params = drawn_params(env, 0)
    for key, value in get_protocol(name).params.items():
        assert params[key] == value
    env.close()


@pytest.mark.parametrize("name", REAL)
def test_what_a_protocol_draws_reaches_the_env(name):
    protocol = get_protocol(name)
    assert {"friction", "mass", "delay"} <= set(protocol.randomize) and not set(
        protocol.randomize
    ) & set(protocol.params)
    assert is_random(protocol.env_kwargs()) and not is_random(protocol.params)
    # no start has to give way
    away = {"geometry": "capsules", "escape_field": None, "start": [-2.0, -0.47, 2.95]}
    env = gym.make("piec_envs/FrankaPush-v0", **away, **protocol.env_kwargs())
    drawn = [drawn_params(env, seed) for seed in range(12)]
    env.close()
    for key, choices in protocol.randomize.items():
        values = [params[key] for params in drawn]
        if key == "object":
            assert len(set(values)) > 1 and set(values) <= set(choices)
        else:
            assert len(set(values)) == 12 and choices[0] <= min(values) <= max(values) <= choices[1]
    assert all(params["dynamics"] == "mujoco" for params in drawn)
    task = env.unwrapped.model.task
    starts = np.array([params["start"] for params in drawn]) - task.start
    assert 0 < np.hypot(*starts[:, :2].T).max() <= np.hypot(*[protocol.start_noise[0]] * 2)
    assert 0 < np.abs(starts[:, 2]).max() <= protocol.start_noise[1]


def test_the_issues_protocols_are_there():
    frictions = [
        f"friction-{mu}" for mu in ("0.00", "0.20", "0.25", "0.50", "0.75", "0.80", "1.00")
    ]
    shapes = [
        f"shape-{name}"
        for name in ("octagon", "hexagon", "square", "box_212", "paper_pack_wrapped", "a4_box")
    ]
    assert REAL == ["sim-to-real-sm1", "sim-to-real-sm2", "sim-to-real-sm3"]
    assert set(PLAIN) == {
        "nominal",
        *frictions,
        *shapes,
        "dynamics-mujoco",
        *LEVELS,
        "adversary",
        "combined",
    }
    assert get_protocol("disturbance-3mm-direction").params == {
        "disturbance": 0.003,
        "disturbance_kind": "direction",
    }
    assert get_protocol("friction-0.25").params == {"friction": 0.25}
    assert get_protocol("shape-hexagon").params == {"object": "hexagon"}


@pytest.mark.parametrize("name", PLAIN)
def test_twins_differ_by_the_drawn_start_alone(name):
    plain = get_protocol(name)
    twin = get_protocol(f"{name}-start")
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
        poses.append([drawn_params(env, seed)["start"].tolist() for seed in range(5)])
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


@pytest.mark.parametrize("name", [name for name, row in PROTOCOLS.items() if row.randomize])
def test_what_a_protocol_draws_is_laid_over_what_was_drawn(name):
    drawn = get_protocol(name).env_kwargs(
        {"randomize": {"inertia": ["own", "paper"], "friction": [0.0, 1.0]}}
    )
    assert drawn["randomize"] == {"inertia": ["own", "paper"], **get_protocol(name).randomize}


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
@pytest.mark.parametrize("name", [name for name, row in PROTOCOLS.items() if row.objects])
def test_protocols_are_about_the_objects_of_their_own_task(task, name):
    """Each is taken by the tasks whose object it stands around, and by no others, and says which
    there are.
    """
    env_ids = {
        "planar_arm": PUSH,
        "mobile_franka": "piec_envs/MobileFrankaPush-v0",
        "franka": "piec_envs/FrankaPush-v0",
    }
    env_id = env_ids[task.robot]
    bare = {} if env_id == PUSH else {"geometry": "capsules", "start": "home"}
    protocol = get_protocol(name)
    if {family(item) for item in protocol.objects} == {task.object}:
        check_suits(protocol, env_id, bare)
        return
    with pytest.raises(
        InvalidParameterError, match=f"'{name}' puts .*but the object of '{env_id}'"
    ) as caught:
        check_suits(protocol, env_id, bare)
    listed = (
        str(caught.value).partition("objects for it: ")[2].partition(", and all")[0].split(", ")
    )
    assert listed and name not in listed
    for other in listed:
        check_suits(get_protocol(other), env_id, bare)


def test_objects_of_protocols_stand_around_others_of_the_table():
    named = {item for row in PROTOCOLS.values() for item in row.objects}
    assert named and named <= set(OBJECTS)
    for name in named:
        planned_as = OBJECTS[family(name)]
        true = OBJECTS[name]
        assert planned_as.name != name
        assert np.isin(np.round(planned_as.key_points, 9), np.round(true.key_points, 9)).all()


@pytest.mark.parametrize("axis", AXES.values(), ids=lambda axis: axis.name)
def test_every_value_of_an_axis_is_a_protocol_that_makes_an_environment(axis):
    assert list(axis.values) == sorted(axis.values) and axis.nominal in axis.values
    for value in axis.values:
        protocol = get_protocol(f"{axis.name}={value:g}")
        assert protocol == axis.at(value) and protocol.name == f"{axis.name}={value:g}"
        field = {} if "adversary" in protocol.params else {"escape_field": None}
        gym.make(PUSH, disable_env_checker=True, **protocol.env_kwargs(field)).close()


def test_a_value_between_those_of_an_axis_is_a_protocol_too():
    assert get_protocol("sigma=0.0123").params["disturbance"] == 0.0123
    assert get_protocol("start=0.03").start_noise == (0.03, 0.0)


@pytest.mark.parametrize("name", ["sigma=", "sigma=much", "=0.1"])
def test_a_protocol_that_is_no_point_of_an_axis_is_refused(name):
    with pytest.raises((InvalidParameterError, UnknownNameError), match=r"number|unknown axis"):
        get_protocol(name)

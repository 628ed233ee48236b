"""Values that mean nothing are refused wherever they may be given, and whatever is recorded stays
valid.
"""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from evaluation.protocols import PROTOCOLS
from piec_envs.dynamics.plant import PlantParams
from piec_envs.env.config import EnvConfig
from piec_envs.env.registry import MOTIONS
from piec_envs.errors import InvalidParameterError, InvalidStateError
from piec_envs.geometry.body import scene_distances
from piec_envs.model.reach import goal_ring
from piec_envs.model.task import GOAL_RADIUS, TASKS
from piec_envs.world.objects import OBJECTS
from piec_envs.world.packed import pack_scene
from piec_envs.world.robots import ROBOTS, get_robot
from piec_envs.wrappers import Mismatch, VectorMismatch

PUSH = "piec_envs/PlanarArmPush-v0"
ROOT = Path(__file__).resolve().parents[2]
WITHOUT_FIELD = {"escape_field": None}
# A value out of range, what is said of it, and what it needs beside it.
BAD = [
    ("disturbance", 5, r"disturbance must be from 0 to 0\.05 m, got 5", {}),
    ("disturbance", "0.004", r"disturbance must be from 0 to 0\.05 m, got '0\.004'", {}),
    ("friction", 50, "friction must be from 0 to 5, got 50", {}),
    ("friction", "0.5", r"friction must be from 0 to 5, got '0\.5'", {}),
    ("friction", True, "friction must be from 0 to 5, got True", {}),
    ("friction", None, "friction must be from 0 to 5, got None", {}),
    ("adversary", 100.0, r"adversary must be from 0 to 10, got 100\.0", {}),
    ("mass", 1000.0, r"mass must be from 0\.01 to 100, got 1000\.0", {"dynamics": "mujoco"}),
    ("mass", 1.5, r"mass must be 1 under dynamics='quasi_dynamic'.*got 1\.5 .*mujoco", {}),
    ("delay", 3, r"delay must be from 0 to 0\.1 s, got 3", {"dynamics": "mujoco"}),
]
IDS = [f"{name}={value!r}" for name, value, *_ in BAD]


def every_way(name, value, beside):
    """All ways in which a plant parameter may be given, each as a function without arguments."""
    params = {name: value, **beside}
    single = gym.make(PUSH, **WITHOUT_FIELD)
    several = gym.make_vec(PUSH, num_envs=2, **WITHOUT_FIELD)
    yield "argument", lambda: gym.make(PUSH, **WITHOUT_FIELD, **params)
    yield (
        "argument of a VectorEnv",
        lambda: gym.make_vec(PUSH, num_envs=2, **WITHOUT_FIELD, **params),
    )
    for env, wrapper in ((single, Mismatch), (several, VectorMismatch)):
        yield "set_params", lambda env=env: env.unwrapped.set_params(params)
        yield "option of reset", lambda env=env: env.reset(options={"params": params})
        yield "wrapper", lambda env=env, wrapper=wrapper: wrapper(env, **params)
    if isinstance(value, int | float) and not isinstance(value, bool):
        nominal = getattr(PlantParams(), name)
        drawn = {name: [nominal, value], **{key: [item] for key, item in beside.items()}}
        yield "randomize", lambda: gym.make(PUSH, **WITHOUT_FIELD, randomize=drawn)


@pytest.mark.parametrize(("name", "value", "message", "beside"), BAD, ids=IDS)
def test_a_plant_parameter_out_of_range_is_refused_in_every_way(name, value, message, beside):
    for way, give in every_way(name, value, beside):
        with pytest.raises(InvalidParameterError, match=message):
            give()
            pytest.fail(f"taken as {way}")


def test_a_mass_that_is_drawn_or_injected_needs_its_dynamics():
    """As with a delay: together they are judged, wherever each of the two comes from."""
    drawn = gym.make(PUSH, **WITHOUT_FIELD, dynamics="mujoco", randomize={"mass": [0.7, 1.3]})
    drawn.reset(seed=0)
    with pytest.raises(InvalidParameterError, match="mass must be 1"):
        drawn.reset(options={"params": {"dynamics": "quasi_dynamic"}})
    with pytest.raises(InvalidParameterError, match="mass must be 1"):
        gym.make(
            PUSH,
            **WITHOUT_FIELD,
            randomize={"mass": [0.7, 1.3], "dynamics": ["mujoco", "quasi_dynamic"]},
        )
    assert PlantParams().replace({"mass": 2.0}, {"dynamics": "mujoco"}).mass == 2.0


@pytest.mark.parametrize(
    ("choice", "message"),
    [
        ({"start_noise": (5.0, 0.0)}, "start_noise must be at least 0 and at most 1 m and pi rad"),
        ({"start_noise": (0.0, 7.0)}, "start_noise must be at least 0 and at most 1 m and pi rad"),
        ({"weights": {"task": np.inf}}, r"weights\['task'\] must be a finite number"),
        ({"weights": {"miss": True}}, r"weights\['miss'\] must be a finite number"),
        ({"weights": {"shortest": "no"}}, r"weights\['shortest'\] must be True or False, got 'no'"),
    ],
    ids=str,
)
def test_other_arguments_out_of_range_are_refused(choice, message):
    for make in (gym.make, gym.make_vec):
        with pytest.raises(InvalidParameterError, match=message):
            make(PUSH, **WITHOUT_FIELD, **choice)


# --- goals ------------------------------------------------------------------------------------


def straight_reach(robot):
    """Farthest distance of the robot's surface from its first turning joint, of random
    postures, m.
    """
    rng = np.random.default_rng(0)
    far = 0.0
    scene = pack_scene(robot.name, "circle")
    distances = np.empty(scene.robot.links)
    radius = OBJECTS["circle"].bounding_radius
    for q in rng.uniform(scene.robot.lower, scene.robot.upper, (300, robot.dof)):
        # so far away that distances tell how far the arm comes towards it
        place = np.array([50.0, 0.0, 0.0])
        scene_distances(scene, q, place, distances)
        far = max(far, 50.0 - radius - float(distances.min()))
    return far


@pytest.mark.parametrize("robot_name", [name for name in ROBOTS if not get_robot(name).base_dof])
def test_what_no_arm_can_do_is_no_goal(robot_name):
    robot = get_robot(robot_name)
    for name in OBJECTS:
        least, most = goal_ring(robot_name, name)
        assert 0 <= least < most <= robot.workspace_radius
        assert most >= min(robot.workspace_radius, 0.9 * straight_reach(robot)) - 1e-9
        # there the object would stand in the arm by more than the goal region makes up for
        if least:
            scene = pack_scene(robot_name, name)
            distances = np.empty(scene.robot.links)
            rng = np.random.default_rng(1)
            for q in rng.uniform(scene.robot.lower, scene.robot.upper, (50, robot.dof)):
                bearing, turn = rng.uniform(-np.pi, np.pi, 2)
                at = (least + GOAL_RADIUS) * np.array([np.cos(bearing), np.sin(bearing)])
                scene_distances(scene, q, np.array([0.999 * at[0], 0.999 * at[1], turn]), distances)
                assert distances.min() < 0


@pytest.mark.parametrize("task", TASKS.values(), ids=TASKS)
def test_goals_of_tasks_lie_in_the_ring_and_others_are_refused(task):
    least, most = goal_ring(task.robot, task.object)
    assert least <= np.hypot(*task.goal) <= most
    about = {"escape_field": None, "robot": task.robot}
    inside = (least + most) / 2
    assert EnvConfig(task=task.name, goal=(0.0, inside), **about).goal == (0.0, inside)
    for distance in (most + 1e-6, least - 1e-6):
        if distance > 0:
            with pytest.raises(
                InvalidParameterError, match=rf"within {most:g} m .*can bring '{task.object}'"
            ):
                EnvConfig(task=task.name, goal=(0.0, distance), **about)


# --- states -----------------------------------------------------------------------------------


@pytest.mark.parametrize("env_id", MOTIONS)
def test_states_beyond_what_is_observed_are_refused(env_id):
    """As fields and as a whole, single and vector; the episode before them stays."""
    env = gym.make(env_id, **WITHOUT_FIELD).unwrapped
    envs = gym.make_vec(env_id, num_envs=2, **WITHOUT_FIELD)
    env.reset(seed=0)
    envs.reset(seed=0)
    far = r"'pose' must lie within 10 m of the origin along x and y, got \[13\.0, 0\.0\]"
    for each, rows in ((env, 1), (envs.unwrapped, 2)):
        good = each.get_state()
        with pytest.raises(InvalidStateError, match=far):
            each.reset(options={"state": {"pose": [13.0, 0.0, 0.0]}})
        with pytest.raises(InvalidStateError, match="'step' must be below 1000"):
            each.reset(options={"state": {"step": 1000}})
        thrown = np.array(good.pose)
        thrown[-1] = [13.0, 0.0, 0.0]
        bent = np.array(good.q_r)
        bent[-1] += 50.0
        for change, message in (
            ({"pose": thrown}, far),
            ({"q_r": bent}, "'q_r' must stay near the joint limits"),
        ):
            bad = dataclasses.replace(good, **change)
            for take in (
                each.set_state,
                lambda bad=bad, each=each: each.reset(options={"state": bad}),
            ):
                with pytest.raises(InvalidStateError, match=message):
                    take(bad) if take == each.set_state else take()
            with pytest.raises(InvalidStateError, match=message):
                each.rollout(bad, controls=np.zeros((rows, 1, env.action_space.shape[0])))
        np.testing.assert_array_equal(each.get_state().pose, good.pose)


# --- what is recorded -------------------------------------------------------------------------


def recorded_arguments():
    """Distinct keyword arguments of the environments of all committed records, with their ids."""
    found = set()

    def look(value):
        if isinstance(value, dict):
            if isinstance(value.get("env_kwargs"), dict) and value.get("env_id"):
                found.add((value["env_id"], json.dumps(value["env_kwargs"], sort_keys=True)))
            for item in value.values():
                look(item)

    for path in sorted((ROOT / "results").glob("*/records.jsonl")):
        for line in path.read_text().splitlines():
            look(json.loads(line)["spec"])
    return sorted(found)


def test_every_recorded_argument_and_every_protocol_is_valid():
    recorded = recorded_arguments()
    assert len(recorded) > 20
    for env_id, text in recorded:
        choice = {**json.loads(text), "escape_field": None}
        if choice.get("prior") == "caging" or choice.get("adversary"):
            choice["escape_field"] = {"name": "grid", "resolution": 16}
        for protocol in ("nominal", "combined"):
            arguments = PROTOCOLS[protocol].env_kwargs(choice)
            if protocol != "nominal" and not env_id.startswith("piec_envs/PlanarArm"):
                continue
            gym.make(env_id, disable_env_checker=True, **arguments)
    for protocol in PROTOCOLS.values():
        gym.make(PUSH, disable_env_checker=True, **protocol.env_kwargs())

"""A plan is judged and drawn by what it was made for, unless told otherwise, and what is in force
is said.
"""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation import evaluate
from evaluation.cli import main
from evaluation.plants import PLANTS, plant_in_force, plant_line
from evaluation.protocol import laid_over
from evaluation.records import read_records, work_key
from piec_envs.env.registry import MOTIONS
from piec_envs.errors import InvalidParameterError, PlanError, UnknownNameError
from piec_envs.model.task import TASKS
from planners import CmaEsPlanner, OpenLoopPolicy, Plan, RigidCarry
from planners.objectives import OBJECTIVES

ROOT = Path(__file__).resolve().parents[2]
PUSH = "piec_envs/PlanarArmPush-v0"
TRACK = "piec_envs/PlanarArmTrack-v0"
TINY = {"iterations": 2, "population": 4, "restarts": 1, "start": "rest", "robust_iterations": 0}
GOAL = [0.2, 0.5]
OTHER = {"goal": GOAL, "object": "square", "friction": 0.1, "inertia": "own", "preset": "paper"}
DRAWN = {
    "start_noise": [0.02, 0.1],
    "randomize": {"friction": [0.1, 0.9], "object": ["circle", "hexagon"]},
}


def planned(objective: str = "contact", env_id: str = PUSH, **env_kwargs) -> Plan:
    preset = env_kwargs.get("preset", "default")
    planner = CmaEsPlanner(objective=objective, preset=preset, **TINY)
    return planner.plan(env_id, seed=0, progress=False, **env_kwargs)


@pytest.fixture(scope="module")
def other_plan() -> Plan:
    """A plan whose goal, object and everything else are not the environment's own."""
    return planned(**OTHER)


@pytest.fixture(scope="module")
def drawn_plan() -> Plan:
    """A plan that was made with drawn starts, frictions and objects."""
    return planned(goal=GOAL, **DRAWN)


def offsets(evaluation, goal) -> np.ndarray:
    return np.hypot(*(evaluation.pose[:, :, :2] - goal).T).T


@pytest.mark.parametrize("objective", OBJECTIVES)
def test_nominal_is_the_model_that_it_was_planned_with(objective):
    """Executed under `nominal`, a plan does what it says it does, whatever it was planned for."""
    plan = planned(objective, **OTHER)
    seen = evaluate(plan)
    np.testing.assert_allclose(seen.goal_distance, offsets(seen, GOAL), atol=1e-12)
    # which is how it searches: what flees is a matter of the protocol
    if OBJECTIVES[objective].adversary:
        assert "adversary" not in seen.spec["env_kwargs"]
        seen = evaluate(plan, plant="disturbed")
        assert seen.spec["env_kwargs"]["adversary"] == 1.0
    assert {name: seen.spec["env_kwargs"][name] for name in OTHER} == {**OTHER}
    assert abs(seen.goal_distance[0, -1] - plan.nominal["goal_distance"]) < 1e-12
    assert abs(seen.d2g[0] - plan.nominal["d2g"]) < 1e-12


def test_the_square_is_moved_and_not_the_circle(other_plan):
    """The distance to the arm at the start tells the shapes apart."""
    own = evaluate(other_plan)
    gap = {}
    for name in ("square", "circle"):
        gap[name] = gym.make(PUSH, object=name, escape_field=None).reset(seed=0)[1]["min_distance"]
    assert own.min_distance[0, 0] == gap["square"] != gap["circle"]


def test_a_plan_its_policy_and_its_id_say_the_same(other_plan):
    first, *others = (
        evaluate(*given) for given in ((other_plan,), (OpenLoopPolicy(other_plan), PUSH))
    )
    for evaluation in others:
        assert evaluation.spec == first.spec
        np.testing.assert_array_equal(evaluation.pose, first.pose)


def test_what_is_given_overrides_the_plan_and_protocols_override_both(other_plan):
    given = evaluate(
        other_plan, protocol="friction-0.80", env_kwargs={"friction": 0.3, "goal": [0.1, 0.4]}
    )
    assert given.spec["env_kwargs"] == {**OTHER, "friction": 0.8, "goal": [0.1, 0.4]}
    np.testing.assert_allclose(given.goal_distance, offsets(given, [0.1, 0.4]), atol=1e-12)


def test_the_default_plant_is_a_choice(other_plan):
    """The task stays the plan's own; `given` takes nothing of it."""
    default = evaluate(other_plan, plant="default")
    assert default.spec["env_kwargs"] == {"goal": GOAL}
    np.testing.assert_allclose(default.goal_distance, offsets(default, GOAL), atol=1e-12)
    nothing = evaluate(other_plan, plant="given")
    assert nothing.spec["env_kwargs"] == {}
    np.testing.assert_allclose(nothing.goal_distance, offsets(nothing, [-0.3, 0.4]), atol=1e-12)
    with pytest.raises(
        UnknownNameError, match=f"unknown plant 'mine'; known: {', '.join(sorted(PLANTS))}"
    ):
        evaluate(other_plan, plant="mine")


def test_a_reference_comes_from_the_plan():
    """The mobile Franka's two references share everything else."""
    kwargs = {"reference": "left", "geometry": "capsules", "start": "home"}
    plan = RigidCarry().plan("piec_envs/MobileFrankaTrack-v0", **kwargs)
    seen = evaluate(plan, env_kwargs={"escape_field": None})
    assert {name: seen.spec["env_kwargs"][name] for name in kwargs} == kwargs
    expected = np.hypot(*(seen.pose[0, :, :2] - TASKS["mobile_franka_track_left"].reference).T)
    np.testing.assert_allclose(seen.tracking_error[0], expected, atol=1e-12)


def test_what_was_drawn_in_planning_is_drawn_only_where_asked_for(drawn_plan):
    nominal = evaluate(drawn_plan)
    assert nominal.episodes == 1 and not set(DRAWN) & set(nominal.spec["env_kwargs"])
    assert abs(nominal.goal_distance[0, -1] - drawn_plan.nominal["goal_distance"]) < 1e-12
    drawn = evaluate(drawn_plan, plant="disturbed", episodes=12)
    assert {name: drawn.spec["env_kwargs"][name] for name in DRAWN} == DRAWN
    assert len(drawn.distinct) == 12 and len(set(drawn.min_distance[:, 0])) == 12
    again = evaluate(drawn_plan, plant="disturbed", episodes=3, seed=5)
    np.testing.assert_array_equal(
        again.pose, evaluate(drawn_plan, PUSH, "nominal", 8, 0, None, False, "disturbed").pose[5:]
    )


def test_what_a_protocol_fixes_is_no_longer_drawn(drawn_plan):
    """Drawn values would have won over the protocol's, and a table would have named another
    friction.
    """
    fixed = evaluate(drawn_plan, protocol="friction-0.20", plant="disturbed", episodes=2).spec[
        "env_kwargs"
    ]
    assert fixed["friction"] == 0.2 and fixed["randomize"] == {"object": ["circle", "hexagon"]}
    both = evaluate(
        drawn_plan,
        protocol="shape-square",
        plant="disturbed",
        episodes=2,
        env_kwargs={"friction": 0.3},
    )
    assert (
        "randomize" not in both.spec["env_kwargs"] and both.spec["env_kwargs"]["object"] == "square"
    )
    env = gym.make(PUSH, **both.spec["env_kwargs"])
    for seed in range(4):
        env.reset(seed=seed)
        params = env.unwrapped.get_params()
        assert (params["object"], params["friction"]) == ("square", 0.3)
    twin = evaluate(drawn_plan, protocol="nominal-start", plant="disturbed", episodes=2).spec[
        "env_kwargs"
    ]
    assert twin["start_noise"] == [0.01, 0.05]


NUMBERS = st.dictionaries(st.sampled_from(["friction", "mass", "disturbance"]), st.floats(0.1, 1.0))
RANGES = st.dictionaries(st.sampled_from(["friction", "mass", "disturbance"]), st.just([0.1, 0.2]))


@given(base=NUMBERS, drawn=RANGES, changes=NUMBERS)
def test_laying_over_keeps_the_changes_and_draws_nothing_of_them(base, drawn, changes):
    whole = {**base, "randomize": drawn} if drawn else dict(base)
    before = json.dumps(whole)
    merged = laid_over(whole, changes)
    assert json.dumps(whole) == before  # nothing is written into what is given
    left = merged.pop("randomize", {})
    assert merged == {**base, **changes}
    assert left == {name: choices for name, choices in drawn.items() if name not in changes}
    assert laid_over(whole, {"randomize": None})["randomize"] is None


def test_a_protocol_of_another_robot_is_refused_before_anything_runs(other_plan, tmp_path, capsys):
    with pytest.raises(InvalidParameterError, match=r"a4_box.*paper_pack.*shape-square"):
        evaluate(other_plan, protocol="shape-a4_box")
    file = other_plan.save(tmp_path / "p.npz")
    for command in (
        ["evaluate", str(file), "--out", str(tmp_path / "out")],
        ["render", str(file)],
        ["render"],
    ):
        assert main([*command, "--protocol", "sim-to-real-sm3"]) == 2
        assert "shape-octagon" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["p.npz"]
    # whoever moves packs
    own = evaluate(other_plan, protocol="shape-a4_box", env_kwargs={"object": "paper_pack"})
    assert own.spec["env_kwargs"]["object"] == "a4_box"


COMMITTED = sorted((ROOT / "results" / "planar-adversary" / "plans").glob("*seed0-*.npz"))


@pytest.mark.parametrize("file", COMMITTED, ids=lambda file: file.stem)
def test_committed_plans_are_judged_as_in_their_study(file):
    """A study gives every keyword argument; what a plan says of itself comes to the same."""
    plan = Plan.load(file)
    key = file.stem.rpartition("-")[2]
    for record in read_records(ROOT / "results" / "planar-adversary" / "records.jsonl"):
        spec = record["spec"]
        assert record["key"] == work_key(spec, record["seed"])
        nominal = spec["work"] == "evaluate" and spec["protocol"] == "nominal"
        if nominal and work_key(spec["plan"], record["seed"]).startswith(key):
            break
    seen = evaluate(plan, env_kwargs={"escape_field": None})
    assert abs(float(seen.d2g[0]) - record["result"]["d2g_mean"]) < 1e-6


@pytest.mark.parametrize("env_id", MOTIONS)
def test_every_default_of_the_plant_in_force_is_filled_in(env_id):
    bare = {} if "Planar" in env_id else {"geometry": "capsules", "start": "home"}
    plant = plant_in_force(env_id, bare)
    env = gym.make(env_id, escape_field=None, **bare)
    env.reset(seed=0)
    params = env.unwrapped.get_params()
    assert {name: plant[name] for name in params if name != "start"} == {
        n: v for n, v in params.items() if n != "start"
    }
    assert (
        plant["goal"] == env.unwrapped.model.task.goal.tolist()
        and plant["robot"] == env.unwrapped.model.robot.name
    )
    assert json.loads(json.dumps(plant)) == plant and plant["task"] in plant_line(plant)


@pytest.mark.parametrize(
    ("policy", "env_id", "message"),
    [
        (3, PUSH, "or a plan, or an agent; got 3"),
        ("plan.npz", PUSH, r"load it first, by Plan\.load"),
        (OpenLoopPolicy, PUSH, "a policy has"),
        (lambda observation: observation, None, "env_id is needed.*PlanarArmPush"),
        (lambda observation: observation, "env", f"'{PUSH}' and its keyword arguments"),
        (lambda observation: observation, "envs", "an environment object was given: VectorEnv"),
        ("env", PUSH, "the policy comes first"),
    ],
)
def test_what_is_no_policy_or_no_id(policy, env_id, message):
    made = {
        "env": gym.make(PUSH, escape_field=None),
        "envs": gym.make_vec(PUSH, num_envs=2, escape_field=None),
    }
    policy, env_id = (
        made.get(given, given) if isinstance(given, str) else given for given in (policy, env_id)
    )
    with pytest.raises(InvalidParameterError, match=message):
        evaluate(policy, env_id)


def test_static_caging_and_environments_are_named_for_what_they_are(other_plan):
    cage = "piec_envs/PlanarArmCage-v0"
    env = gym.make(PUSH, escape_field=None)
    makers = (
        CmaEsPlanner(**TINY).plan,
        RigidCarry().plan,
        lambda env_id: evaluate(np.zeros_like, env_id),
    )
    for make in makers:
        with pytest.raises(
            UnknownNameError, match=r"static caging: .*no motion.*CmaEsConfiguration"
        ):
            make(cage)
        with pytest.raises(InvalidParameterError, match=f"named by its id.*pass '{PUSH}'"):
            make(env)
        with pytest.raises(UnknownNameError, match=f"Did you mean '{PUSH}'"):
            make("planararmpush-v0")
    with pytest.raises(PlanError, match=f"for '{PUSH}', not for '{TRACK}'"):
        evaluate(other_plan, TRACK)

"""Training of agents, their files, and the policies that execute them."""

from __future__ import annotations

import json
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from evaluation import evaluate
from piec_envs.errors import AgentError, InvalidObservationError

pytest.importorskip("stable_baselines3")

from small_trainings import ENV, OFF, PUSH, SPECS, TRACK

from planners import Plan
from planners.sb3 import Agent, AgentPolicy, NativeVecEnv, TrainSpec, open_loop, train
from planners.sb3.normalisation import normalise

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """One tiny agent for each algorithm, with its folder."""
    folders = {name: tmp_path_factory.mktemp(name) for name in SPECS}
    return {
        name: (train(SPECS[name], folder, progress=False), folder)
        for name, folder in folders.items()
    }


def history(folder):
    return [json.loads(line) for line in (folder / "evaluations.jsonl").read_text().splitlines()]


@pytest.mark.parametrize("algo", SPECS)
def test_a_training_leaves_agents_a_curve_and_logs(algo, trained):
    agent, folder = trained[algo]
    names = {path.name for path in folder.iterdir()}
    files = {
        "agent.zip",
        "agent.json",
        "best_model.zip",
        "best_model.json",
        "evaluations.jsonl",
        "spec.json",
    }
    assert names == files | {"tensorboard"}
    assert list((folder / "tensorboard").glob("events.out.tfevents*"))
    curve = history(folder)
    assert [record["steps"] for record in curve] == {"ppo": [40, 80, 120, 160, 200]}.get(
        algo, [26, 50, 76, 100]
    )
    assert {"success_rate", "return", "d2g", "seconds"} <= curve[-1].keys()
    assert agent.steps == agent.model.num_timesteps == SPECS[algo].timesteps and agent.seconds > 0
    again = Agent.load(folder / "agent.zip")
    assert again.spec == agent.spec == SPECS[algo] and "stable-baselines3" in again.versions
    best = Agent.load(folder / "best_model.zip").evaluation
    assert (best["success_rate"], best["return"]) == max(
        (r["success_rate"], r["return"]) for r in curve
    )
    before = (folder / "agent.zip").stat().st_mtime_ns
    train(SPECS[algo], folder, progress=False)  # has ended
    assert (folder / "agent.zip").stat().st_mtime_ns == before


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_the_policy_holds_its_action_and_sees_what_it_saw_in_training(algo, trained):
    """Step by step in an environment without repeats, an agent does what it did in one with
    them.
    """
    agent, folder = trained[algo]
    agent = Agent.load(folder / "agent.zip")
    rows = evaluate(
        AgentPolicy(agent), PUSH, "nominal-start", 2, seed=5, env_kwargs={"escape_field": None}
    )
    venv = NativeVecEnv(PUSH, 2, **ENV)
    venv.seed(5)
    observation = venv.reset()
    for t in range(1, 10):
        action, _ = agent.model.predict(
            normalise(observation, agent.normalisation), deterministic=True
        )
        observation, *_ = venv.step(action)
        np.testing.assert_allclose(venv.native.get_state().q_r, rows.q_r[:, 100 * t], atol=1e-12)
    assert np.abs(np.diff(rows.q_r, axis=1)).max() > 0


def test_the_policy_decides_for_each_row_by_its_own_clock(trained):
    policy = AgentPolicy(trained["ppo"][0])
    rng = np.random.default_rng(0)
    observation = rng.uniform(-1, 1, (3, 23))
    observation[:, -1] = [0.1, 0.101, 0.101]
    held = rng.uniform(-1, 1, (3, 4))
    action, state = policy.predict(
        observation, state=held, episode_start=np.array([False, False, True])
    )
    alone = policy.predict(observation)[0]
    np.testing.assert_allclose(action, [alone[0], held[1], alone[2]], atol=1e-6)
    assert state is action
    observation[:, -1] = 0.05 + 1e-9
    assert policy.predict(observation, state=held)[0] is held
    assert policy.predict(observation[0])[0].shape == (4,)
    with pytest.raises(InvalidObservationError, match="23 entries, got 25"):
        policy.predict(np.zeros((2, 25)))
    wide = np.concatenate([observation, observation[:, -1:]], axis=1)  # as TimeAwareObservation's
    for broken in (
        wide,
        observation * np.nan,
        observation.astype(int),
        "observation",
        {"observation": observation},
    ):
        with pytest.raises(InvalidObservationError):
            policy.predict(broken)
    with pytest.raises(AgentError, match=r"Agent\.load"):
        AgentPolicy(trained["ppo"][0].model)


def test_open_loop_is_a_plan_like_any_other(trained, tmp_path):
    agent, _ = trained["sac"]
    policy = open_loop(agent)
    plan = Plan.load(policy.plan.save(tmp_path / "sac.npz"))
    assert plan.env_kwargs == {"escape_field": None} and (plan.objective, plan.horizon) == (
        "sac",
        1000,
    )
    closed = evaluate(AgentPolicy(agent), PUSH, env_kwargs={"escape_field": None})
    np.testing.assert_allclose(plan.path, closed.q_r[0], atol=1e-9)
    rows = evaluate(policy, PUSH, "disturbance-5mm-start", 2, env_kwargs={"escape_field": None})
    # blind to the object, which differs
    assert np.abs(rows.q_r[:, -1] - plan.path[-1]).max() < 0.01
    assert not np.array_equal(rows.pose[0], rows.pose[1])


def test_a_training_leaves_its_spec_as_it_was(tmp_path):
    """SB3 writes into nested arguments, and with another spec no training would go on."""
    hyper = {**OFF, "policy_kwargs": {"net_arch": [8]}}
    spec = TrainSpec(
        PUSH, "sac", 10, n_envs=2, env_kwargs=ENV, hyper=hyper, evaluations=1, eval_episodes=1
    )
    train(spec, tmp_path, progress=False)
    assert (
        spec.hyper == hyper and json.loads((tmp_path / "spec.json").read_text())["hyper"] == hyper
    )


def test_agents_that_are_broken_or_foreign_are_refused(trained, tmp_path):
    agent, _ = trained["ppo"]
    file = agent.save(tmp_path / "a.zip")
    with pytest.raises(AgentError, match=r"missing.zip"):
        Agent.load(tmp_path / "missing.zip")
    with pytest.raises(AgentError, match=r"\.zip, got"):
        agent.save(tmp_path / "a.npz")
    data = file.read_bytes()
    about = file.with_suffix(".json").read_text()
    file.write_bytes(data[:-100])
    with pytest.raises(AgentError, match="SHA-256"):
        Agent.load(file)
    file.write_bytes(data)
    for broken in (about[:-20], "[]", about.replace("piec-agent-1", "piec-agent-0")):
        file.with_suffix(".json").write_text(broken)
        with pytest.raises(AgentError, match=r"broken|format"):
            Agent.load(file)
    with pytest.raises(AgentError, match=f"{PUSH}', not on '{TRACK}"):
        evaluate(AgentPolicy(agent), TRACK, env_kwargs={"escape_field": None})
    with pytest.raises(AgentError, match="goal_conditioned"):
        evaluate(
            AgentPolicy(agent), PUSH, env_kwargs={"escape_field": None, "goal_conditioned": True}
        )
    one = gym.make(PUSH, escape_field=None)
    with pytest.raises(
        AgentError, match=r"has actions of 4 entries .*, but the environment of 5 entries"
    ):
        agent.check_fits(PUSH, one.observation_space, gym.spaces.Box(-1, 1, (5,)))


@pytest.mark.parametrize("algo", SPECS)
def test_policies_carry_nothing_compiled(algo, trained, carried):
    agent = Agent.load(trained[algo][1] / "agent.zip")
    for policy in (AgentPolicy(agent), open_loop(agent)):
        assert not carried(policy)[0]

"""Training of agents, their files, and the policies that execute them."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys
import time
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from evaluation import evaluate
from piec_envs.errors import AgentError, InvalidObservationError

pytest.importorskip("stable_baselines3")

from planners import Plan
from planners.sb3 import Agent, AgentPolicy, NativeVecEnv, TrainSpec, open_loop, train
from planners.sb3 import training as trainings
from planners.sb3.checkpoint import read_checkpoint, write_checkpoint
from planners.sb3.hyperparameters import model_arguments

ROOT = Path(__file__).resolve().parents[2]
PUSH, TRACK = "piec_envs/PlanarArmPush-v0", "piec_envs/PlanarArmTrack-v0"
ENV = {"escape_field": None, "start_noise": [0.01, 0.05], "action_repeat": 100, "threads": 1}
NETWORK = {"policy_kwargs": "dict(net_arch=[8], activation_fn=nn.Tanh)"}
PPO = {**NETWORK, "n_steps": 10, "batch_size": 20, "n_epochs": 1, "learning_rate": "lin_1e-3"}
PPO["normalize"] = "dict(norm_obs=True, norm_reward=True)"
OFF = {**NETWORK, "learning_starts": 20, "batch_size": 8, "buffer_size": 400}
SPECS = {
    "ppo": TrainSpec(
        PUSH, "ppo", 200, n_envs=2, env_kwargs=ENV, hyper=PPO, evaluations=5, eval_episodes=2
    ),
    "sac": TrainSpec(
        PUSH, "sac", 100, n_envs=2, env_kwargs=ENV, hyper=OFF, evaluations=4, eval_episodes=2
    ),
    "tqc": TrainSpec(
        PUSH, "tqc", 100, n_envs=2, env_kwargs=ENV, hyper=OFF, evaluations=4, eval_episodes=2
    ),
}
KILLED = """
import sys, json
from planners.sb3 import TrainSpec, train
train(TrainSpec(**json.loads(sys.argv[1])), sys.argv[2], progress=False)
"""


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """One tiny agent for each algorithm, with its folder."""
    folders = {name: tmp_path_factory.mktemp(name) for name in SPECS}
    return {
        name: (train(SPECS[name], folder, progress=False), folder)
        for name, folder in folders.items()
    }


@pytest.fixture
def interrupt(monkeypatch):
    """Interrupt trainings at the n-th evaluation."""

    def at(n):
        original, calls = trainings.score, []

        def score(*arguments):
            calls.append(1)
            if len(calls) == n:
                raise KeyboardInterrupt
            return original(*arguments)

        monkeypatch.setattr(trainings, "score", score)

    return at


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
    scale = trainings.normalise
    for t in range(1, 10):
        action, _ = agent.model.predict(scale(observation, agent.normalisation), deterministic=True)
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


@pytest.mark.parametrize("algo", ["ppo", "sac"])
def test_an_interrupted_training_goes_on(algo, interrupt, monkeypatch, tmp_path):
    spec = SPECS[algo]
    with monkeypatch.context():
        interrupt(3)
        with pytest.raises(KeyboardInterrupt):
            train(spec, tmp_path, progress=False)
    _, state = read_checkpoint(tmp_path)
    monkeypatch.undo()
    run = trainings.Training(spec, tmp_path, model_arguments(spec))
    assert run.model.num_timesteps == state["steps"] == {"ppo": 80, "sac": 50}[algo]
    if algo == "ppo":
        assert run.venv.obs_rms.mean.tolist() == state["normalisation"]["observation"][""]["mean"]
        assert run.venv.ret_rms.count == state["normalisation"]["return"]["count"] > 80
    else:
        assert run.model.replay_buffer.pos == 25
    (tmp_path / ".checkpoint-000000000099.1.tmp").mkdir()  # what a kill leaves
    agent = train(spec, tmp_path, progress=False)
    assert (
        agent.steps == spec.timesteps
        and history(tmp_path)[: len(state["history"])] == state["history"]
    )
    steps = [record["steps"] for record in history(tmp_path)]
    assert steps == sorted(set(steps)) and not list(tmp_path.glob("*checkpoint*"))
    if algo == "ppo":  # the schedule went by the whole training
        assert (
            agent.model._total_timesteps == 200
            and agent.model.policy.optimizer.param_groups[0]["lr"] == 0.0
        )


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


def test_a_killed_process_goes_on(tmp_path):
    spec = dataclasses.replace(SPECS["ppo"], timesteps=2000, evaluations=20)
    command = [sys.executable, "-c", KILLED, json.dumps(spec.as_json()), str(tmp_path)]
    process = subprocess.Popen(command, cwd=ROOT)
    deadline = time.monotonic() + 60
    while not list(tmp_path.glob("checkpoint-*")) and time.monotonic() < deadline:
        time.sleep(0.005)
    process.kill()  # SIGKILL
    assert process.wait() == -9
    path, state = read_checkpoint(tmp_path)
    assert 100 <= state["steps"] < 2000 and path.name == f"checkpoint-{state['steps']:012d}"
    agent = train(spec, tmp_path, progress=False)
    assert agent.steps == agent.model.num_timesteps == 2000
    assert [record["steps"] for record in history(tmp_path)] == list(range(100, 2001, 100))
    assert not list(tmp_path.glob("*checkpoint*")) and not list(tmp_path.glob(".*"))


def test_a_torn_write_leaves_the_checkpoint_before(interrupt, tmp_path, monkeypatch):
    interrupt(2)
    with pytest.raises(KeyboardInterrupt):
        train(SPECS["ppo"], tmp_path, progress=False)
    _, state = read_checkpoint(tmp_path)

    class Torn:
        def save(self, path):
            Path(path).write_bytes(b"half")
            raise OSError("disk full")

    with pytest.raises(OSError, match="disk full"):
        write_checkpoint(tmp_path, Torn(), {**state, "steps": 999})
    assert read_checkpoint(tmp_path)[1] == state


def test_checkpoints_that_do_not_belong_are_refused(interrupt, tmp_path):
    interrupt(2)
    spec = SPECS["ppo"]
    with pytest.raises(KeyboardInterrupt):
        train(spec, tmp_path, progress=False)
    with pytest.raises(AgentError, match=r"timesteps: 200 there, 300 here"):
        train(dataclasses.replace(spec, timesteps=300), tmp_path, progress=False)
    path, state = read_checkpoint(tmp_path)

    def expect(message, **changes):
        (path / "state.json").write_text(json.dumps({**state, **changes}))
        with pytest.raises(AgentError, match=message):
            train(spec, tmp_path, progress=False)

    expect(f"trained on '{TRACK}', not on '{PUSH}'", env_id=TRACK)
    narrow = {"": {"low": [-1.0] * 25, "high": [1.0] * 25}}
    expect(
        "of 25 entries from -1 to 1, .*of 23 entries from -20",
        spaces={**state["spaces"], "observation": narrow},
    )
    expect("has actions of 25 entries", spaces={**state["spaces"], "action": narrow})
    expect("seed: 1 there, 0 here", spec={**state["spec"], "seed": 1})
    expect("format", format="tar")
    expect("model.zip is broken", sha256={"model.zip": "0" * 64})
    (path / "state.json").write_text("{")
    with pytest.raises(AgentError, match="broken"):
        train(spec, tmp_path, progress=False)
    (tmp_path / "spec.json").write_text("[]")
    with pytest.raises(AgentError, match=r"another training|broken"):
        train(spec, tmp_path, progress=False)


def test_agents_that_are_broken_or_foreign_are_refused(trained, tmp_path):
    agent, _ = trained["ppo"]
    file = agent.save(tmp_path / "a.zip")
    with pytest.raises(AgentError, match=r"missing.zip"):
        Agent.load(tmp_path / "missing.zip")
    with pytest.raises(AgentError, match=r"\.zip, got"):
        agent.save(tmp_path / "a.npz")
    data, about = file.read_bytes(), file.with_suffix(".json").read_text()
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

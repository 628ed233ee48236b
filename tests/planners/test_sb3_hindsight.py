"""Goal-conditioned agents, which learn from hindsight."""

from __future__ import annotations

import numpy as np
import pytest

from evaluation import evaluate

pytest.importorskip("stable_baselines3")

from planners.sb3 import Agent, AgentPolicy, TrainSpec, open_loop, train
from planners.sb3 import training as trainings
from planners.sb3.hyperparameters import model_arguments
from planners.sb3.normalisation import normalise, statistics_of

PUSH = "piec_envs/PlanarArmPush-v0"
ENV = {"escape_field": None, "start_noise": [0.01, 0.05], "action_repeat": 100, "threads": 1}
OFF = {
    "policy_kwargs": "dict(net_arch=[8], activation_fn=nn.Tanh)",
    "learning_starts": 20,
    "batch_size": 8,
    "buffer_size": 400,
}


def test_goal_conditioned_agents_learn_from_hindsight(tmp_path):
    hyper = {
        **OFF,
        "replay_buffer_class": "HerReplayBuffer",
        "replay_buffer_kwargs": {"n_sampled_goal": 2},
    }
    env = {**ENV, "goal_conditioned": True}
    agent = train(
        TrainSpec(PUSH, "sac", 60, 1, 2, env, hyper, evaluations=2, eval_episodes=2),
        tmp_path,
        False,
    )
    assert agent.task_kwargs == {"goal_conditioned": True}
    agent = Agent.load(tmp_path / "agent.zip")
    rows = evaluate(AgentPolicy(agent), PUSH, env_kwargs={"escape_field": None})
    np.testing.assert_allclose(open_loop(agent).plan.path, rows.q_r[0], atol=1e-9)


@pytest.mark.parametrize(
    "normalize", [True, "dict(norm_reward=False)", {"norm_obs_keys": ["observation"]}], ids=str
)
def test_normalising_leaves_the_goals_of_hindsight_as_they_are(normalize, tmp_path):
    hyper = {**OFF, "replay_buffer_class": "HerReplayBuffer", "normalize": normalize}
    env = {**ENV, "goal_conditioned": True, "object": "circle"}
    spec = TrainSpec(PUSH, "sac", 60, 1, 2, env, hyper, evaluations=2, eval_episodes=2)
    model = trainings.Training(spec, tmp_path, model_arguments(spec)).model
    model.learn(60)
    normalised = model.get_vec_normalize_env()
    batches = []
    for venv in (None, normalised):
        model.set_random_seed(0)  # of NumPy too, from which SB3's buffer draws
        batches.append(model.replay_buffer.sample(200, env=venv))
    plain, scaled = batches
    for name in ("achieved_goal", "desired_goal"):
        assert (plain.observations[name] == scaled.observations[name]).all()
    assert len(np.unique(scaled.observations["desired_goal"].numpy(), axis=0)) > 10
    assert (plain.observations["observation"] != scaled.observations["observation"]).any()
    raw = {name: np.ones((1, *space.shape)) for name, space in normalised.observation_space.items()}
    seen = normalise(raw, statistics_of(normalised))
    expected = normalised.normalize_obs(raw)
    for name in raw:
        np.testing.assert_allclose(seen[name], expected[name], rtol=1e-6)

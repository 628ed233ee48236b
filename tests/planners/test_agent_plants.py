"""An agent is judged and drawn by what it was trained for."""

from __future__ import annotations

import json

import numpy as np
import pytest

from evaluation import evaluate
from evaluation.cli import main

pytest.importorskip("stable_baselines3")

from planners.sb3 import AgentPolicy, TrainSpec, train

PUSH = "piec_envs/PlanarArmPush-v0"
HYPER = {
    "policy_kwargs": "dict(net_arch=[8])",
    "learning_starts": 20,
    "batch_size": 8,
    "buffer_size": 400,
}


def test_an_agent_is_judged_by_what_it_was_trained_for(tmp_path):
    """Its goal, object and friction; what only its training drew is drawn where that is
    asked for.
    """
    own = {"goal": [0.2, 0.5], "object": "square", "friction": 0.2}
    drawn = {
        "start_noise": [0.01, 0.05],
        "randomize": {"friction": [0.1, 0.3]},
        "action_repeat": 100,
    }
    env = {"escape_field": None, **own, **drawn, "threads": 1}
    spec = TrainSpec(
        PUSH, "sac", 30, n_envs=2, env_kwargs=env, hyper=HYPER, evaluations=1, eval_episodes=1
    )
    agent = train(spec, tmp_path, progress=False)
    without = {"env_kwargs": {"escape_field": None}}
    (seen,) = {
        json.dumps(evaluate(judged, **without).spec["env_kwargs"])
        for judged in (agent, AgentPolicy(agent))
    }
    assert json.loads(seen) == {**own, "escape_field": None}
    single = evaluate(agent, **without)
    np.testing.assert_allclose(
        single.goal_distance[0], np.hypot(*(single.pose[0, :, :2] - [0.2, 0.5]).T), atol=1e-12
    )
    again = evaluate(agent, plant="disturbed", episodes=2, **without)
    assert (
        again.spec["env_kwargs"]["randomize"] == {"friction": [0.1, 0.3]}
        and len(again.distinct) == 2
    )
    default = evaluate(agent, plant="default", **without).spec["env_kwargs"]
    assert default == {"goal": [0.2, 0.5], "escape_field": None}
    arguments = [str(tmp_path / "agent.zip"), "--set", "escape_field=null", "--json"]
    assert main(["evaluate", *arguments, "--out", str(tmp_path / "out")]) == 0
    table = (tmp_path / "out" / "table.md").read_text()
    assert (
        "goal (0.2, 0.5) m, object square, friction 0.2" in table
        and "made with randomize friction of (0.1, 0.3), start_noise (0.01, 0.05)" in table
    )
    assert main(["render", *arguments, "--frames", "1", "--out", str(tmp_path / "a.gif")]) == 0

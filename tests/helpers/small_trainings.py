"""Trainings of a few steps, one for each algorithm."""

from __future__ import annotations

from planners.sb3 import TrainSpec

PUSH = "piec_envs/PlanarArmPush-v0"
TRACK = "piec_envs/PlanarArmTrack-v0"
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

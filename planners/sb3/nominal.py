"""An agent's nominal episode as a plan: what it does when it cannot see."""

from __future__ import annotations

from typing import Any

import gymnasium as gym
import numpy as np

from planners.base import OpenLoopPolicy, realised_plan
from planners.sb3.agent import Agent, AgentPolicy

# What the nominal model has not: noise, and what only the interface of the training saw.
NOT_NOMINAL = (
    "start_noise",
    "disturbance",
    "disturbance_kind",
    "adversary",
    "adversary_after",
    "randomize",
    "action_repeat",
    "goal_conditioned",
    "threads",
    "max_episode_steps",
)


def open_loop(agent: Agent) -> OpenLoopPolicy:
    """The agent's nominal episode, executed blindly: the same for every row and seed.

    The agent acts once on the nominal model, from the task's own start and without noise. The joint
    path that this episode realises becomes a plan, exactly as the path that CMA-ES finds does, and
    is executed by the same policy: open loop in the object, absolute in the joints. What is left to
    compare is which motion was found, and not who could see.

    Args:
        agent: the agent.

    Returns:
        The policy; its `plan` may be saved.

    Raises:
        AgentError: if the environment is no longer the one that the agent was trained on.
    """
    trained = agent.spec.env_kwargs
    nominal = {name: value for name, value in trained.items() if name not in NOT_NOMINAL}
    seen = {name: trained[name] for name in ("goal_conditioned",) if name in trained}
    env: Any = gym.make(agent.env_id, disable_env_checker=True, **nominal, **seen).unwrapped
    agent.check_fits(agent.env_id, env.observation_space, env.action_space)
    observation, _ = env.reset(seed=0)
    start = env.get_state()
    policy = AgentPolicy(agent)
    held = None
    commands = []
    for _ in range(agent.horizon):
        action, held = policy.predict(observation, state=held)
        observation, *_ = env.step(action)
        commands.append(env.get_state().q_cmd[0])
    path = np.array(commands)
    plan = realised_plan(
        env.model,
        start,
        path,
        env_id=agent.env_id,
        env_kwargs=nominal,
        via_points=path[-1:],
        objective=agent.spec.algo,
        preset=env.config.preset,
        seed=agent.spec.seed,
    )
    return OpenLoopPolicy(plan)

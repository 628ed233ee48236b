"""`evaluate`: many episodes of one policy under one protocol, in batches of rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

from evaluation.outcome import Evaluation
from evaluation.plants import NOT_IN_SPEC, as_policy, base_kwargs, check_suits, chosen_id, source_of
from evaluation.protocol import is_random
from evaluation.protocols import get_protocol
from piec_envs import InvalidParameterError, as_count, console

MAX_ROWS = 256  # rows of one batch: bounds the memory and changes no result
_MEASURED = ("goal_distance", "d2g", "min_distance", "mean_distance", "tracking_error")

Predict = Callable[..., tuple[Any, Any]]


def evaluate(
    policy: Any,
    env_id: str | None = None,
    protocol: str = "nominal",
    episodes: int = 100,
    seed: int = 0,
    env_kwargs: Mapping[str, Any] | None = None,
    progress: bool = False,
    plant: str = "own",
) -> Evaluation:
    """Run a policy for a number of episodes under a protocol.

    A plan or an agent is judged by what it was made for: its goal, object, start and nominal model.
    On that lie `env_kwargs`, and on these the protocol. `spec["env_kwargs"]` of the result says
    what was in force.

    Episode i has seed + i and does not depend on the others. Where neither the protocol nor the
    env draws anything, a policy with `predict` does the same in every episode, so one is run.
    An episode whose simulation becomes unstable has failed, and stays where it was last stable.

    Args:
        policy: a `Plan` or an `Agent`, or anything with Stable-Baselines3's `predict` (an
            `OpenLoopPolicy`, an `AgentPolicy`, an SB3 model), or a function from a batch of
            observations to a batch of actions.
        env_id: id of the environment; None takes that of the plan or the agent.
        protocol: name of the protocol.
        episodes: how many episodes.
        seed: seed of the first.
        env_kwargs: keyword arguments of the environment, which the protocol overrides.
        progress: whether to show a progress bar.
        plant: what `env_kwargs` override: "own" (the task and the nominal model that the plan or
            the agent was made for), "disturbed" (these, with what was drawn, displaced or fled
            while it was made), "default" (its task, and the env's default plant) or "given"
            (nothing of it).

    Returns:
        Arrays over episodes and time.

    Raises:
        UnknownNameError: for an unknown id, protocol, plant or keyword argument.
        InvalidParameterError: for a bad number of episodes, a policy that is none, an environment
            object instead of its id, or a protocol about an object of another robot.
        PlanError: if the policy executes a plan for another id, robot or joints.
        AgentError: if it executes an agent trained on another id, or on other observations.
    """
    policy = as_policy(policy)
    source = source_of(policy)
    env_id = chosen_id(source, env_id)
    episodes = as_count("episodes", episodes)
    seed = as_count("seed", seed, least=0)
    for name in ("num_envs", "max_episode_steps", "autoreset_mode", "action_repeat"):
        if name in (env_kwargs or {}):
            raise InvalidParameterError(
                f"{name!r} is decided by evaluate: one whole episode in each row, an action in "
                f"each control step"
            )
    base = base_kwargs(source, plant, env_kwargs)
    check_suits(get_protocol(protocol), env_id, base)
    kwargs = get_protocol(protocol).env_kwargs(base)
    if hasattr(policy, "predict") and not is_random(kwargs):
        episodes = 1
    spec = {
        "env_id": env_id,
        "env_kwargs": {name: value for name, value in kwargs.items() if name not in NOT_IN_SPEC},
        "protocol": protocol,
        "episodes": episodes,
        "seed": seed,
    }
    return Evaluation(spec=spec, **_run(policy, spec, kwargs, progress))


def _run(
    policy: Any, spec: Mapping[str, Any], kwargs: Mapping[str, Any], progress: bool
) -> dict[str, Any]:
    """The episodes of a spec, batch by batch; the arrays of an `Evaluation`."""
    predict = _predict_of(policy)
    episodes = spec["episodes"]
    pieces = []
    for lo in range(0, episodes, MAX_ROWS):
        seeds = list(range(spec["seed"] + lo, spec["seed"] + min(lo + MAX_ROWS, episodes)))
        envs = gym.make_vec(spec["env_id"], num_envs=len(seeds), **kwargs)
        check_fit(policy, spec["env_id"], envs)
        label = f"{spec['protocol']}, episodes {lo + 1} to {lo + len(seeds)} of {episodes}"
        pieces.append(_run_rows(envs, predict, seeds, label if progress else ""))
    joined: dict[str, Any] = {
        name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]
    }
    return {"caging": None} | joined


def _predict_of(policy: Any) -> Predict:
    """The policy's `predict`, or a function dressed up as one."""
    if hasattr(policy, "predict"):
        return policy.predict
    return lambda observation, state, episode_start, deterministic: (policy(observation), state)


def check_fit(policy: Any, env_id: str, env: Any) -> None:
    """Let a policy that was made for one kind of environment look at this one.

    Args:
        policy: the policy.
        env_id: id of the environment.
        env: the environment, single or vector.

    Raises:
        PlanError: if it executes a plan that is for another.
        AgentError: if it executes an agent that is for another.
    """
    plan: Any = getattr(policy, "plan", None)
    agent: Any = getattr(policy, "agent", None)
    if hasattr(plan, "check_fits"):
        setup = env.unwrapped.model.setup
        plan.check_fits(env_id, setup.robot, setup.posture)
    if hasattr(agent, "check_fits"):
        prefix = "single_" if isinstance(env, gym.vector.VectorEnv) else ""
        spaces = (getattr(env, f"{prefix}{kind}_space") for kind in ("observation", "action"))
        agent.check_fits(env_id, *spaces)


def _run_rows(envs: Any, predict: Predict, seeds: list[int], label: str) -> dict[str, np.ndarray]:
    """One batch of episodes from start to end.

    Args:
        envs: a native VectorEnv with one row for each seed.
        predict: the policy.
        seeds: one for each row.
        label: what the progress bar says; "" for none.

    Returns:
        The arrays of an `Evaluation`.
    """
    steps = envs.unwrapped.model.task.horizon
    observation, info = envs.reset(seed=seeds)
    arrays = _blank(envs, info, steps)
    _write(arrays, envs, info, 0)
    state = None
    first = np.ones(len(seeds), dtype=bool)
    diverged = np.zeros(len(seeds), dtype=bool)
    for t in tqdm(
        range(1, steps + 1),
        desc=label,
        unit="step",
        disable=console.no_bar(bool(label)),
        delay=1.0,
        leave=False,
    ):
        action, state = predict(observation, state=state, episode_start=first, deterministic=True)
        observation, _, _, _, info = envs.step(np.asarray(action))
        _write(arrays, envs, info, t)
        diverged |= info["diverged"]
        _hold(arrays, diverged, t)
        first = np.zeros(len(seeds), dtype=bool)
    success = info["is_success"] & ~diverged
    return {**arrays, "success": success, "d2g": arrays["d2g"][:, -1], "diverged": diverged}


def _blank(envs: Any, info: Mapping[str, np.ndarray], steps: int) -> dict[str, np.ndarray]:
    """Arrays for the start and each step, by name."""
    rows = envs.num_envs
    times = steps + 1
    arrays = {name: np.empty((rows, times)) for name in _MEASURED}
    if "caging" in info:
        arrays["caging"] = np.empty((rows, times))
    arrays["contact"] = np.empty((rows, times, info["contact_links"].shape[1]), dtype=bool)
    arrays["pose"] = np.empty((rows, times, 3))
    arrays["q_r"] = np.empty((rows, times, envs.unwrapped.model.robot.dof))
    return arrays


def _write(
    arrays: dict[str, np.ndarray], envs: Any, info: Mapping[str, np.ndarray], t: int
) -> None:
    """Note down the present of all rows at time index t."""
    for name in _MEASURED:
        arrays[name][:, t] = info.get(name, 0.0)  # without a reference there is no tracking error
    if "caging" in arrays:
        arrays["caging"][:, t] = info["caging"]
    state = envs.unwrapped.get_state()
    arrays["contact"][:, t] = info["contact_links"]
    arrays["pose"][:, t] = state.pose
    arrays["q_r"][:, t] = state.q_r


def _hold(arrays: dict[str, np.ndarray], rows: np.ndarray, t: int) -> None:
    """Keep the last good entry of rows that diverged: what follows in them is a new episode."""
    for values in arrays.values():
        values[rows, t] = values[rows, t - 1]

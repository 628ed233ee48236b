"""`evaluate`: many episodes of one policy under one protocol, in batches of rows."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

import piec_envs  # noqa: F401  registers the environments
from evaluation.outcome import Evaluation
from evaluation.protocols import get_protocol, is_random
from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.episodes.info import batch_info
from piec_envs.episodes.tasks import MEASURES
from piec_envs.errors import InvalidParameterError, check_name
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.registration import MOTIONS

MAX_ROWS = 256  # rows of one batch: bounds the memory and changes no result
NOT_IN_SPEC = ("threads", "render_mode", "renderer")  # keyword arguments that change no result
_MEASURED = ("goal_distance", "d2g", "min_distance", "mean_distance", "tracking_error")

Predict = Callable[..., tuple[Any, Any]]


def evaluate(
    policy: Any,
    env_id: str,
    protocol: str = "nominal",
    episodes: int = 100,
    seed: int = 0,
    env_kwargs: Mapping[str, Any] | None = None,
    progress: bool = False,
) -> Evaluation:
    """Run a policy for a number of episodes under a protocol.

    Episode i has seed + i and does not depend on the others. Where neither the protocol nor the
    env draws anything, a policy with `predict` does the same in every episode, so one is run.
    An episode whose simulation becomes unstable has failed, and stays where it was last stable.

    Args:
        policy: anything with Stable-Baselines3's `predict` (a plan's `OpenLoopPolicy`, an agent's
            `AgentPolicy`, an SB3 model), or a function from a batch of observations to a batch of actions.
        env_id: id of the environment.
        protocol: name of the protocol.
        episodes: how many episodes.
        seed: seed of the first.
        env_kwargs: keyword arguments of the environment, which the protocol overrides.
        progress: whether to show a progress bar.

    Returns:
        Arrays over episodes and time.

    Raises:
        UnknownNameError: for an unknown id, protocol or keyword argument.
        InvalidParameterError: for a bad number of episodes, or a policy that is none.
        PlanError: if the policy executes a plan for another id, robot or joints.
        AgentError: if it executes an agent trained on another id, or on other observations.
    """
    check_name("environment", env_id, MOTIONS)
    if not (isinstance(episodes, int | np.integer) and episodes >= 1):
        raise InvalidParameterError(f"episodes must be a whole number of at least 1, got {episodes!r}")
    for name in ("num_envs", "max_episode_steps", "autoreset_mode", "action_repeat"):
        if name in (env_kwargs or {}):
            raise InvalidParameterError(
                f"{name!r} is decided by evaluate: one whole episode in each row, an action in each control step"
            )
    predict = _predict_of(policy)
    plant = get_protocol(protocol).env_kwargs(env_kwargs)
    if hasattr(policy, "predict") and not is_random(plant):
        episodes = 1
    spec = {
        "env_id": env_id,
        "env_kwargs": {name: value for name, value in plant.items() if name not in NOT_IN_SPEC},
        "protocol": protocol,
        "episodes": int(episodes),
        "seed": int(seed),
    }
    pieces = []
    for lo in range(0, episodes, MAX_ROWS):
        seeds = list(range(seed + lo, seed + min(lo + MAX_ROWS, episodes)))
        envs = gym.make_vec(env_id, num_envs=len(seeds), **plant)
        _check_fit(policy, env_id, envs)
        label = f"{protocol}, episodes {lo + 1} to {lo + len(seeds)} of {episodes}"
        pieces.append(_run_rows(envs, predict, seeds, label if progress else ""))
    joined: dict[str, Any] = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
    return Evaluation(spec=spec, **({"caging": None} | joined))


def _predict_of(policy: Any) -> Predict:
    """The policy's `predict`, or a function dressed up as one."""
    if hasattr(policy, "predict"):
        return policy.predict
    if not callable(policy):
        raise InvalidParameterError(
            f"a policy has a method `predict` or is a function from observations to actions, got {policy!r}"
        )
    return lambda observation, state, episode_start, deterministic: (policy(observation), state)


def _check_fit(policy: Any, env_id: str, envs: Any) -> None:
    """Let a policy that was made for one kind of environment look at this one."""
    plan: Any = getattr(policy, "plan", None)
    agent: Any = getattr(policy, "agent", None)
    if hasattr(plan, "check_fits"):
        batch: EpisodeBatch = envs.unwrapped.batch
        plan.check_fits(env_id, batch.robot.name, batch.config.posture)
    if hasattr(agent, "check_fits"):
        agent.check_fits(env_id, envs.single_observation_space, envs.single_action_space)


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
    batch: EpisodeBatch = envs.unwrapped.batch
    steps = batch.task.horizon
    observation, _ = envs.reset(seed=seeds)
    arrays = _blank(batch, steps)
    _write(arrays, batch, 0)
    state, first = None, np.ones(len(seeds), dtype=bool)
    diverged = np.zeros(len(seeds), dtype=bool)
    for t in tqdm(range(1, steps + 1), desc=label, unit="step", disable=not label, delay=1.0, leave=False):
        action, state = predict(observation, state=state, episode_start=first, deterministic=True)
        observation, *_ = envs.step(np.asarray(action))
        _write(arrays, batch, t)
        diverged |= batch.state.diverged
        _hold(arrays, diverged, t)
        first = np.zeros(len(seeds), dtype=bool)
    success = batch_info(batch)["is_success"] & ~diverged
    return {**arrays, "success": success, "d2g": arrays["d2g"][:, -1], "diverged": diverged}


def _blank(batch: EpisodeBatch, steps: int) -> dict[str, np.ndarray]:
    """Arrays for the start and each step, by name."""
    rows, dof, links = batch.state.rows, batch.robot.dof, batch.scene.links
    arrays = {name: np.empty((rows, steps + 1)) for name in _MEASURED}
    if batch.field is not None:
        arrays["caging"] = np.empty((rows, steps + 1))
    arrays["contact"] = np.empty((rows, steps + 1, links), dtype=bool)
    arrays["pose"] = np.empty((rows, steps + 1, 3))
    arrays["q_r"] = np.empty((rows, steps + 1, dof))
    return arrays


def _write(arrays: dict[str, np.ndarray], batch: EpisodeBatch, t: int) -> None:
    """Note down the batch's present at time index t."""
    for name in _MEASURED:
        arrays[name][:, t] = batch.measures[:, MEASURES.index(name)]
    if batch.field is not None:
        arrays["caging"][:, t] = CAGING_SCALE * batch.state.escape_time
    arrays["contact"][:, t] = batch.contact
    arrays["pose"][:, t] = batch.state.pose
    arrays["q_r"][:, t] = batch.state.q_r


def _hold(arrays: dict[str, np.ndarray], rows: np.ndarray, t: int) -> None:
    """Keep the last good entry of rows that diverged: what follows in them is a new episode."""
    for values in arrays.values():
        values[rows, t] = values[rows, t - 1]

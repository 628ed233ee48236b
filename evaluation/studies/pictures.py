"""From what a study evaluated to what figures draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.figures import Trajectory
from evaluation.outcome import Evaluation
from evaluation.protocols import get_protocol
from evaluation.studies.common import Case, StudyRun
from piec_envs.dynamics.free_bodies import places_of
from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.world.objects import get_object
from planners import OpenLoopPolicy, Plan


def trajectory(case: Case, nominal: Evaluation, disturbed: Evaluation | None = None) -> Trajectory:
    """One plan's executions as figures take them.

    Args:
        case: how the plan came about.
        nominal: its undisturbed execution.
        disturbed: its disturbed executions, or None.
    """
    env = trajectory_env(case)
    return Trajectory(
        mode=case.label,
        robot_name=env.batch.robot.name,
        object_name=env.config.object,
        goal=env.batch.task.goal,
        q_r=nominal.q_r[0],
        pose=nominal.pose[0],
        contact=nominal.contact[0],
        disturbed=None if disturbed is None else disturbed.pose,
        reference=env.batch.task.reference if env.batch.tracking else None,
    )


def trajectory_env(case: Case) -> Any:
    """The environment of a case, which says what robot, object, goal and reference there are."""
    bare = {**case.env_kwargs, "escape_field": None}
    return gym.make(case.env_id, disable_env_checker=True, **bare).unwrapped


def watched(plan: Plan, label: str, env_kwargs: Mapping[str, Any], seed: int = 0) -> Trajectory:
    """One execution of a plan with the places of loose bodies, which evaluations do not keep.

    Args:
        plan: the plan.
        label: what figures call the execution.
        env_kwargs: keyword arguments of the plant.
        seed: of the episode.
    """
    env: Any = gym.make(plan.env_id, disable_env_checker=True, **{"escape_field": None, **env_kwargs}).unwrapped
    batch, policy = env.batch, OpenLoopPolicy(plan)
    observation, _ = env.reset(seed=seed)
    rows = [_seen(batch)]
    for _ in range(batch.task.horizon):
        observation, *_ = env.step(policy.predict(observation)[0])
        rows.append(_seen(batch))
    item = batch.state.params[0].object  # which may have been drawn
    env.close()
    q_r, pose, contact, loose = (np.stack(entries) for entries in zip(*rows, strict=True))
    return Trajectory(
        mode=label,
        robot_name=batch.robot.name,
        object_name=item,
        goal=batch.task.goal,
        q_r=q_r,
        pose=pose,
        contact=contact,
        reference=batch.task.reference if batch.tracking else None,
        loose=loose if loose.shape[1] else None,
    )


def _seen(batch: EpisodeBatch) -> tuple[np.ndarray, ...]:
    """Joints (n,), object pose (3,), links in contact (links,) and places of loose bodies (k, 7) of the first row."""
    state = batch.state
    q_r, pose, item = state.q_r[0], state.pose[0], get_object(state.params[0].object)
    return q_r.copy(), pose.copy(), batch.contact[0].copy(), places_of(item, q_r, pose, state.memory[0])[1:].copy()


def first_trajectories(study: StudyRun, cases: Sequence[Case], protocol: str | None = None) -> list[Trajectory]:
    """The first seed's plan of each case, with its executions under a protocol, if one is named."""
    seed, drawn = study.seeds[0], []
    for case in cases:
        disturbed = study.load_evaluation(case, seed, protocol) if protocol else None
        drawn.append(trajectory(case, study.load_evaluation(case, seed, "nominal"), disturbed))
    return drawn


def over_plans(study: StudyRun, case: Case, protocol: str, name: str) -> np.ndarray:
    """One quantity over time in all executions of all plans of a case, shape (executions, N + 1)."""
    return np.concatenate([getattr(study.load_evaluation(case, seed, protocol), name) for seed in study.seeds])


def sigma_of(protocol: str) -> float:
    """The disturbance of a protocol, m."""
    return float(get_protocol(protocol).params["disturbance"])

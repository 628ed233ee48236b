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
from piec_envs import Setup, make_setup
from planners import OpenLoopPolicy, Plan


def trajectory(case: Case, nominal: Evaluation, disturbed: Evaluation | None = None) -> Trajectory:
    """One plan's executions as figures take them.

    Args:
        case: how the plan came about.
        nominal: its undisturbed execution.
        disturbed: its disturbed executions, or None.

    Returns:
        The first nominal execution, with the object's paths in all disturbed ones.
    """
    setup = case_setup(case)
    return Trajectory(
        mode=case.label,
        robot_name=setup.robot,
        object_name=setup.plant.object,
        goal=setup.task.goal,
        q_r=nominal.q_r[0],
        pose=nominal.pose[0],
        contact=nominal.contact[0],
        disturbed=None if disturbed is None else disturbed.pose,
        reference=setup.task.reference if setup.task.tracks else None,
    )


def case_setup(case: Case) -> Setup:
    """What a case's model is made of: what robot, object, goal and reference there are."""
    return make_setup(case.env_id, **{**case.env_kwargs, "escape_field": None})


def watched(plan: Plan, label: str, env_kwargs: Mapping[str, Any], seed: int = 0) -> Trajectory:
    """One execution of a plan with the places of loose bodies, which evaluations do not keep.

    Args:
        plan: the plan.
        label: what figures call the execution.
        env_kwargs: keyword arguments of the plant.
        seed: of the episode.

    Returns:
        The execution.
    """
    env: Any = gym.make(
        plan.env_id, disable_env_checker=True, **{"escape_field": None, **env_kwargs}
    ).unwrapped
    policy = OpenLoopPolicy(plan)
    setup = env.model.setup
    observation, info = env.reset(seed=seed)
    rows = [_seen(env, info)]
    for _ in range(setup.task.horizon):
        observation, _, _, _, info = env.step(policy.predict(observation)[0])
        rows.append(_seen(env, info))
    item = env.get_params()["object"]  # which may have been drawn
    env.close()
    q_r, pose, contact, loose = (np.stack(entries) for entries in zip(*rows, strict=True))
    return Trajectory(
        mode=label,
        robot_name=setup.robot,
        object_name=item,
        goal=setup.task.goal,
        q_r=q_r,
        pose=pose,
        contact=contact,
        reference=setup.task.reference if setup.task.tracks else None,
        loose=loose if loose.shape[1] else None,
    )


def _seen(env: Any, info: Mapping[str, Any]) -> tuple[np.ndarray, ...]:
    """Joints (n,), object pose (3,), links in contact (links,) and places of loose bodies
    (k, 7).
    """
    state = env.get_state()
    return state.q_r[0], state.pose[0], info["contact_links"], state.loose_places(0)


def first_trajectories(
    study: StudyRun, cases: Sequence[Case], protocol: str | None = None
) -> list[Trajectory]:
    """The first seed's plan of each case, with its executions under a protocol, if one is named.

    Args:
        study: the run.
        cases: whose plans.
        protocol: its name, or None.

    Returns:
        One for each case.
    """
    seed = study.seeds[0]
    drawn = []
    for case in cases:
        disturbed = study.load_evaluation(case, seed, protocol) if protocol else None
        drawn.append(trajectory(case, study.load_evaluation(case, seed, "nominal"), disturbed))
    return drawn


def over_plans(study: StudyRun, case: Case, protocol: str, name: str) -> np.ndarray:
    """One quantity over time in all executions of all plans of a case.

    Args:
        study: the run.
        case: whose plans.
        protocol: its name.
        name: of the quantity in an `Evaluation`.

    Returns:
        Shape (executions, N + 1), in the quantity's unit.
    """
    return np.concatenate(
        [getattr(study.load_evaluation(case, seed, protocol), name) for seed in study.seeds]
    )


def sigma_of(protocol: str) -> float:
    """The disturbance of a protocol, m."""
    return float(get_protocol(protocol).params["disturbance"])

"""What plans and agents cost and reach, as columns of one table."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evaluation.jobs import run_recorded
from evaluation.metrics import Interval, bootstrap_interval, wilson_interval
from evaluation.studies.agent_work import AgentCase, training_seconds
from evaluation.studies.budget import STUDY_PLANNER
from evaluation.studies.columns import column, executions
from evaluation.studies.common import DO, Case, StudyRun
from piec_envs import get_task
from planners import CmaEsPlanner


def plan_cost(study: StudyRun, case: Case) -> dict[str, Any]:
    """Control steps and minutes that a plan took.

    Args:
        study: the run.
        case: whose plans.

    Returns:
        "million steps", and "minutes" on average over the seeds.
    """
    horizon = get_task("planar_arm_push").horizon
    works = [case.plan_work(seed) for seed in study.seeds]
    records = run_recorded(DO, works, study.out_dir / "records.jsonl", 1, study.context)
    minutes = float(np.mean([record["seconds"] for record in records])) / 60
    return {
        "million steps": CmaEsPlanner(**{**STUDY_PLANNER, **case.planner}).rollouts * horizon / 1e6,
        "minutes": minutes,
    }


def agent_cost(
    study: StudyRun, case: AgentCase, trained: Sequence[Mapping[str, Any]]
) -> dict[str, Any]:
    """Control steps and minutes that the training of an agent took.

    Args:
        study: the run.
        case: the training.
        trained: results of `train_once`, one for each seed.

    Returns:
        "million steps" and "minutes", each on average over the seeds.
    """
    seconds = [
        training_seconds(case.train_work(seed).spec, seed, study.context) for seed in study.seeds
    ]
    steps = case.action_repeat * column(trained, "steps").mean()
    return {"million steps": float(steps / 1e6), "minutes": float(np.mean(seconds) / 60)}


def success(results: Sequence[Mapping[str, Any]]) -> Interval:
    """Success rate with its interval: over plans, or within the only one."""
    if len(results) == 1:
        return wilson_interval(results[0]["successes"], results[0]["n"])
    return bootstrap_interval([result["success_rate"] for result in results])


def means(
    named: Sequence[Mapping[str, Any]],
    results: Mapping[str, Any],
    protocols: Mapping[str, str],
    name: str,
) -> list[dict[str, Any]]:
    """Rows with the mean of one number over all executions under each protocol.

    Args:
        named: the first columns of each row.
        results: by protocol, for each row the results of `evaluate_once`.
        protocols: names, and what the columns are called.
        name: of the number in a result.

    Returns:
        The rows.
    """
    rows = []
    for i, method in enumerate(named):
        columns = {title: results[key][i] for key, title in protocols.items()}
        n = executions(next(iter(columns.values())))
        averages = {
            title: float(np.average(column(found, name), weights=column(found, "n")))
            for title, found in columns.items()
        }
        rows.append({**method, "n": n, **averages})
    return rows

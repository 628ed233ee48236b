"""The pieces of work that studies are made of: plan (or train) once, and evaluate a plan (or an
agent) once.

All are called by name in workers (`evaluation.jobs`). Plans are cached as files whose names end in
the key of what they were planned for, so that studies share them; evaluations leave thinned arrays
for the figures. A file that is missing or broken is made again, with the same result.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.jobs import Context
from evaluation.metrics import max_deviation, summarise
from evaluation.outcome import Evaluation
from evaluation.plants import NOT_IN_SPEC
from evaluation.protocols import get_protocol
from evaluation.records import work_key
from evaluation.rollout import evaluate
from evaluation.studies.agent_work import agent_policy, train_once
from evaluation.studies.budget import STUDY_PLANNER, YOUNGER
from piec_envs import PlanError, RecordError, check_name, make_model
from planners import CmaEsPlanner, OpenLoopPolicy, Plan, RigidCarry
from planners.objectives import crossing

PLANNERS: Mapping[str, Callable[..., Any]] = {"cma-es": CmaEsPlanner, "rigid-carry": RigidCarry}
KEEP_EVERY = 10  # steps between the states kept for figures


def plan_spec(
    env_id: str, env_kwargs: Mapping[str, Any], planner: Mapping[str, Any]
) -> dict[str, Any]:
    """What makes a plan, but for its seed.

    Args:
        env_id: id of the environment.
        env_kwargs: keyword arguments of the nominal model.
        planner: arguments of `CmaEsPlanner`, or of another row of PLANNERS beside its "name"; what
            they leave out is filled in, so that a change of it counts.

    Returns:
        The spec, JSON values.
    """
    name = {"name": planner["name"]} if "name" in planner else {}
    full = dataclasses.asdict(make_planner(planner))
    for setting in YOUNGER:
        if full.get(setting) == STUDY_PLANNER[setting]:
            full.pop(setting, None)
    full = {**name, **full}
    return {"work": "plan", "env_id": env_id, "env_kwargs": dict(env_kwargs), "planner": full}


def make_planner(spec: Mapping[str, Any]) -> CmaEsPlanner | RigidCarry:
    """The planner of a spec's "planner"; CMA-ES has STUDY_PLANNER where the spec says nothing."""
    arguments = dict(spec)
    name = arguments.pop("name", "cma-es")
    check_name("planner", name, PLANNERS)
    filled = STUDY_PLANNER if name == "cma-es" else {}
    return PLANNERS[name](**{**filled, **arguments})


def evaluation_spec(
    plan: Mapping[str, Any], env_kwargs: Mapping[str, Any], protocol: str, episodes: int
) -> dict:
    """What makes an evaluation of a plan, but for its seed, which is the planner's as well.

    Args:
        plan: from `plan_spec`.
        env_kwargs: keyword arguments of the plant.
        protocol: name of the protocol.
        episodes: how many.

    Returns:
        The spec, JSON values.
    """
    return {
        "work": "evaluate",
        "plan": dict(plan),
        "env_kwargs": dict(env_kwargs),
        "protocol": protocol,
        "episodes": episodes,
    }


def plan_file(folder: str | Path, spec: Mapping[str, Any], seed: int) -> Path:
    """Where a plan is cached.

    Args:
        folder: of all studies.
        spec: from `plan_spec`.
        seed: the planner's.

    Returns:
        The path, whether it is there or not.
    """
    planner = spec["planner"]
    words = [planner[word] for word in ("name", "objective", "preset") if word in planner]
    name = "-".join([*words, f"seed{seed}", f"{work_key(spec, seed)[:8]}.npz"])
    return Path(folder) / "plans" / name


def rollout_file(folder: str | Path, spec: Mapping[str, Any], seed: int) -> Path:
    """Where the thinned arrays of an evaluation are kept.

    Args:
        folder: of all studies.
        spec: from `evaluation_spec`.
        seed: the planner's.

    Returns:
        The path, whether it is there or not.
    """
    return Path(folder) / "rollouts" / f"{work_key(spec, seed)}.npz"


def get_plan(spec: Mapping[str, Any], seed: int, context: Context) -> Plan:
    """The cached plan, or a new one.

    Args:
        spec: from `plan_spec`.
        seed: the planner's.
        context: folder of all studies, threads and progress.

    Returns:
        The plan, which is in the cache from then on.
    """
    file = plan_file(context.folder, spec, seed)
    try:
        return Plan.load(file)
    except PlanError:
        planner = make_planner(spec["planner"])
    threads = {} if context.threads is None else {"threads": context.threads}
    plan = planner.plan(
        spec["env_id"], seed=seed, progress=context.progress, **spec["env_kwargs"], **threads
    )
    # What changes no result has no place in the file, or it would differ with the number of
    # workers.
    kept = {name: value for name, value in plan.env_kwargs.items() if name not in NOT_IN_SPEC}
    plan = dataclasses.replace(plan, env_kwargs=kept)
    plan.save(file)
    return plan


def get_policy(spec: Mapping[str, Any], seed: int, context: Context) -> Any:
    """The policy that an evaluation executes: a plan's, or a trained agent's.

    Args:
        spec: of the evaluation.
        seed: of the planner or the training.
        context: folder of all studies, threads and progress.

    Returns:
        The policy.
    """
    if spec["plan"]["work"] == "train":
        return agent_policy(spec, seed, context)
    return OpenLoopPolicy(get_plan(spec["plan"], seed, context))


def get_evaluation(spec: Mapping[str, Any], seed: int, context: Context) -> Evaluation:
    """An evaluation at full time resolution; its thinned arrays are left as a file.

    Episode i has the seed 1000 * seed + i: independent from plan to plan, alike for every
    objective.

    Args:
        spec: of the evaluation.
        seed: of the planner or the training.
        context: folder of all studies, threads and progress.

    Returns:
        The evaluation.
    """
    plant = {**spec["env_kwargs"], "threads": context.threads}
    policy = get_policy(spec, seed, context)
    env_id = spec["plan"]["env_id"]
    evaluation = evaluate(
        policy,
        env_id,
        spec["protocol"],
        spec["episodes"],
        1000 * seed,
        plant,
        context.progress,
        plant="given",
    )
    every = KEEP_EVERY if evaluation.episodes > 1 else 1
    evaluation.save(rollout_file(context.folder, spec, seed), every)
    return evaluation


def drawn_evaluation(spec: Mapping[str, Any], seed: int, context: Context) -> Evaluation:
    """An evaluation for figures, from its thinned file if there is one.

    Args:
        spec: of the evaluation.
        seed: of the planner or the training.
        context: folder of all studies, threads and progress.

    Returns:
        The evaluation; steps that the file leaves out are filled in, as `Evaluation.expanded` does.
    """
    try:
        return Evaluation.load(rollout_file(context.folder, spec, seed)).expanded()
    except RecordError:
        return get_evaluation(spec, seed, context)


def plan_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Plan, or find the cached plan.

    Args:
        spec: from `plan_spec`.
        seed: the planner's.
        context: folder of all studies, threads and progress.

    Returns:
        The plan's file name, cost, nominal measures, and how far the arm overlaps itself along it
        (m, added up over every tenth step).
    """
    plan = get_plan(spec, seed, context)
    bare = {**spec["env_kwargs"], "escape_field": None}
    overlap = float(crossing(make_model(spec["env_id"], **bare), plan.path[None, 1:])[0])
    file = plan_file(context.folder, spec, seed).name
    return {"file": file, "cost": plan.cost, "nominal": plan.nominal, "crossing": overlap}


def evaluate_once(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Evaluate a plan, and compare it with its executions under the protocol's unperturbed twin.

    Row i is compared with the twin's row of the same seed, hence of the same drawn start; a twin
    that draws nothing is one execution, with which all rows are compared.

    Args:
        spec: of the evaluation.
        seed: of the planner or the training.
        context: folder of all studies, threads and progress.

    Returns:
        What `summarise` returns; `deviation`: the object's largest distance from where the twin has
        it at the same time, and `final_deviation`: the distance at the end, both m and means over
        the distinct executions; and of the twin `unperturbed_n`, `unperturbed_success_rate` and
        `unperturbed_d2g`, m.
    """
    evaluation = get_evaluation(spec, seed, context)
    twin = _unperturbed(spec, seed, context)
    kept = evaluation.distinct
    same = kept if twin.episodes > 1 else np.zeros(1, dtype=int)
    pose = evaluation.pose[kept]
    twin_pose = twin.pose[same]
    return {
        **summarise(evaluation),
        "deviation": float(max_deviation(pose, twin_pose).mean()),
        "final_deviation": float(max_deviation(pose[:, -1:], twin_pose[:, -1:]).mean()),
        "unperturbed_n": len(same),
        "unperturbed_success_rate": float(twin.success[same].mean()),
        "unperturbed_d2g": float(twin.d2g[same].mean()),
    }


def _unperturbed(spec: Mapping[str, Any], seed: int, context: Context) -> Evaluation:
    """The twin's executions with the same seeds; without an escape field, which the motion does not
    need.
    """
    plant = {**spec["env_kwargs"], "threads": context.threads, "escape_field": None}
    policy = get_policy(spec, seed, context)
    env_id = spec["plan"]["env_id"]
    protocol = get_protocol(spec["protocol"]).unperturbed
    return evaluate(policy, env_id, protocol, spec["episodes"], 1000 * seed, plant, plant="given")


def do(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Do whichever of the three the spec names.

    Args:
        spec: of a plan, a training or an evaluation.
        seed: its seed.
        context: folder of all studies, threads and progress.

    Returns:
        What `plan_once`, `train_once` or `evaluate_once` returns.
    """
    return {"plan": plan_once, "train": train_once, "evaluate": evaluate_once}[spec["work"]](
        spec, seed, context
    )

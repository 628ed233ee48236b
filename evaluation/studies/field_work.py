"""What the studies of escape fields share: held-out sets, fields, and the scores of one field."""

from __future__ import annotations

import dataclasses
import json
from functools import lru_cache
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from evaluation.field_scores import (
    enclosure_auc,
    errors,
    gradient_cosine,
    query_microseconds,
    rank_over_configurations,
    rank_over_points,
)
from evaluation.field_sets import (
    RESOLUTION,
    PointSet,
    curled_set,
    exact_field,
    least_time,
    plan_set,
    ranking_set,
    thinned,
    uniform_set,
)
from evaluation.jobs import Context
from evaluation.studies import PUSH
from evaluation.studies.work import get_plan, plan_spec
from piec_envs import (
    BatchedField,
    FieldWeights,
    GridField,
    NetworkField,
    SpeedModel,
    TableField,
    WeightsError,
    get_object,
    get_recipe,
    get_robot,
    has_weights,
    make_model,
    shipped_file,
    train_field,
)
from planners import CagingProblem, CmaEsConfiguration

CAGES = {  # static caging: environment and object, by robot
    "planar_arm": ("piec_envs/PlanarArmCage-v0", "three_discs"),
    "franka": ("piec_envs/FrankaCage-v0", "water_jug"),
}
CAGE_SEED = 30_100  # of the poses of these problems, and of their starts
# of the poses that an arm closes on, and its states on the way
CLOSING_SEED = 30_200
CLOSING_STATES = 200
SET_KNOBS = ("robot", "rows", "points", "ranking", "planner", "planner_seeds")
FINE_SETS = ("P", "C")


def do(spec: dict[str, Any], seed: int, context: Context) -> dict[str, Any]:
    """Score one field on the held-out sets, or on points of the finest grid.

    Args:
        spec: the field, what it is asked, and the knobs of the sets.
        seed: of the training, if the field is learned here.
        context: folder of the study, and threads.

    Returns:
        The scores by name.
    """
    knobs = json.dumps({name: spec[name] for name in SET_KNOBS})
    sets = held_out_sets(knobs, context)
    if spec["field"]["kind"] == "bound":
        robot_name = spec["robot"]
        return _errors(lambda points, q: least_time(robot_name, points), sets)
    chosen = load_field(spec["field"], spec, seed, context)
    if spec["work"] == "fine":
        return _fine_errors(chosen, fine_sets(knobs, spec["fine"], spec["fine_points"], context))
    exact = exact_field(spec["robot"], context.threads)
    seconds = chosen.weights.record["seconds"] if isinstance(chosen, NetworkField) else None
    single = load_field(spec["field"], spec, seed, dataclasses.replace(context, threads=1))
    return {
        **_errors(chosen.query, sets),
        "cosine": gradient_cosine(chosen, exact, sets["H"]),
        **_cages(chosen, exact, spec),
        "seconds": seconds,
        "us_5000": query_microseconds(single.query, sets["U"], 5000),
        "us_50": query_microseconds(single.query, sets["U"], 50),
    }


@lru_cache(maxsize=1)
def held_out_sets(knobs: str, context: Context) -> dict[str, PointSet]:
    """The sets H, U, C and P for some knobs of the study.

    Args:
        knobs: by SET_KNOBS, as JSON.
        context: folder of the study, and threads.

    Returns:
        The sets by their letters.
    """
    given = json.loads(knobs)
    robot_name = given["robot"]
    threads = context.threads
    return {
        "H": curled_set(robot_name, given["rows"], given["points"], threads),
        "U": uniform_set(robot_name, given["rows"], given["points"], threads),
        "C": ranking_set(robot_name, given["ranking"], threads),
        "P": plan_set(
            robot_name, STATES[robot_name](given, context), get_object("circle").key_points, threads
        ),
    }


def _plan_states(given: dict[str, Any], context: Context) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses and joint positions along the nominal execution of each caging plan."""
    # plans that studies share
    cache = dataclasses.replace(context, folder=str(Path(context.folder).parent))
    model = make_model(PUSH, escape_field=None)
    start = model.reset(0)
    states = []
    for seed in given["planner_seeds"]:
        plan = get_plan(
            plan_spec(PUSH, {}, {"objective": "caging", **given["planner"]}), seed, cache
        )
        motion = model.rollout(start, plan.path[None, 1:], absolute=True).motion
        states.append((motion.pose[0], motion.q_r[0]))
    return states


def _closing_states(given: dict[str, Any], context: Context) -> list[tuple[np.ndarray, np.ndarray]]:
    """Poses and joint positions while the arm closes on an object, from straight to a posture that
    holds it.
    """
    env, item = _cage_env(given["robot"])
    field = GridField(given["robot"], threads=context.threads)
    optimiser = CmaEsConfiguration(50, iterations=40, sigma=0.3, guesses=200, kind="curled")
    states = []
    for seed in given["planner_seeds"]:
        pose = env.reset(seed=CLOSING_SEED + seed)[1]["pose"]
        found = optimiser.solve(
            CagingProblem(given["robot"], item, pose, field, threads=context.threads), seed
        )
        path = np.linspace(get_robot(given["robot"]).home, found.posture, CLOSING_STATES)
        states.append((np.repeat(pose[None], CLOSING_STATES, axis=0), path))
    return states


STATES = {"planar_arm": _plan_states, "franka": _closing_states}  # of set P, by robot


def _cage_env(robot_name: str) -> tuple[Any, str]:
    """The robot's environment of static caging and its object."""
    env_id, item = CAGES[robot_name]
    return gym.make(
        env_id, object=item, escape_field="grid", disable_env_checker=True
    ).unwrapped, item


def learned_case(robot_name: str, recipe: str) -> dict[str, Any]:
    """What makes a learned field: how it is trained, and the very weights if they ship.

    Args:
        robot_name: a row of the table of robots.
        recipe: a row of the table of recipes, after which weights that ship are named.

    Returns:
        JSON values.
    """
    case = {"kind": "learned", "recipe": recipe, "settings": get_recipe(recipe).described()}
    if has_weights(robot_name, recipe):
        case["weights"] = FieldWeights.load(shipped_file(robot_name, recipe)).digest
    return case


def load_field(
    case: dict[str, Any], spec: dict[str, Any], seed: int, context: Context
) -> BatchedField:
    """The field of a case, trained first if its weights neither ship nor lie in the study's folder.

    Args:
        case: what makes the field.
        spec: gives the robot.
        seed: of the training.
        context: folder of the study, and threads.

    Returns:
        The field.
    """
    robot_name = spec["robot"]
    if case["kind"] == "grid":
        return GridField(robot_name, case["nodes"], case["method"], threads=context.threads)
    if case["kind"] == "table":
        return TableField(robot_name, case["resolution"], case["spacing"], threads=context.threads)
    recipe = case["recipe"]
    if has_weights(robot_name, recipe):
        return NetworkField(robot_name, recipe, context.threads)
    file = Path(context.folder) / "fields" / shipped_file(robot_name, recipe).name
    try:
        weights = FieldWeights.load(file)
    except WeightsError:
        weights = None
    if weights is None or weights.recipe != get_recipe(recipe).described():
        weights = train_field(
            recipe, robot_name, seed, file, threads=context.threads, progress=context.progress
        )
    return NetworkField(robot_name, weights, context.threads)


def _errors(query, sets: dict[str, PointSet]) -> dict[str, Any]:
    return {
        **{name: errors(query, sets[name]) for name in ("H", "U", "P")},
        "hard": errors(query, sets["H"], only_hard=True),
        "rank_points": rank_over_points(query, sets["H"]),
        "rank_c": rank_over_configurations(query, sets["C"]),
        "auc": enclosure_auc(query, sets["C"]),
    }


def _fine_errors(chosen: BatchedField, sets: dict[str, PointSet]) -> dict[str, Any]:
    """Errors against the finest grid, for reachable and enclosed points."""
    found: dict[str, Any] = {}
    for name, few in sets.items():
        error = np.abs(chosen.query(few.points, few.q) - few.T) / few.T
        for label, kept in (("reachable", few.reachable), ("enclosed", ~few.reachable)):
            some = error[kept] if kept.any() else np.array([np.nan])
            found[f"{name} {label}"] = [int(kept.sum()), float(np.median(some)), float(some.mean())]
    return found


@lru_cache(maxsize=1)
def fine_sets(knobs: str, nodes: int, count: int, context: Context) -> dict[str, PointSet]:
    """Some of the held-out sets, thinned, with a finer grid's answers.

    Args:
        knobs: as in `held_out_sets`.
        nodes: a side of the finer grid.
        count: points of each set.
        context: folder of the study, and threads.

    Returns:
        The sets by their letters.
    """
    fine = GridField(json.loads(knobs)["robot"], nodes, "marching", threads=context.threads)
    sets = held_out_sets(knobs, context)
    return {name: thinned(sets[name], count, fine) for name in FINE_SETS}


def _cages(chosen: BatchedField, exact: BatchedField, spec: dict[str, Any]) -> dict[str, Any]:
    """Postures that CMA-ES finds with the field, judged by the exact one."""
    hard = GridField(spec["robot"], RESOLUTION, "marching", SpeedModel(leak=0.0))
    env, item = _cage_env(spec["robot"])
    times = []
    closed = 0
    for start in range(spec["starts"]):
        pose = env.reset(seed=CAGE_SEED + start)[1]["pose"]
        problem = CagingProblem(spec["robot"], item, pose, chosen)
        posture = (
            CmaEsConfiguration(**spec["optimiser"])
            .solve(problem, seed=CAGE_SEED + start)
            .posture[None]
        )
        judge = dataclasses.replace(problem, field=exact)
        times.append(float(judge.measure(posture).escape_time[0]))
        inside = hard.query(problem.key_points[None], posture)
        closed += bool(np.isinf(inside).any() and judge.measure(posture).feasible[0])
    return {"cages": closed, "starts": spec["starts"], "posture_T": float(np.mean(times))}

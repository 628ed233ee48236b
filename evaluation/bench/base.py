"""What benchmarks share: sizes, rows of the table, and the timing of a call."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from evaluation.studies import PUSH
from piec_envs import InvalidParameterError, Model, State, make_model

Row = dict[str, Any]
# one search over all via points, with the paper's numbers
ONE_SEARCH = {"iterations": 100, "moving_points": 5, "restarts": 1, "robust_iterations": 0}


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Args:
        repeats: measurements of which the median is taken.
        motion: steps of a motion in contact.
        rows: rows of a batched motion.
        mujoco_rows: rows of one under MuJoCo.
        states: states whose steps are timed one by one.
        envs: rows of the vector environments.
        env_steps: steps of the native VectorEnv in one measurement, a multiple of ten.
        sync_steps: steps of Gymnasium's SyncVectorEnv, likewise.
        single_steps: steps of a single environment.
        fields: configurations solved in one measurement.
        table: nodes a side and spacing (rad) of a tabulated field.
        planner: arguments of `CmaEsPlanner` for one search.
        default: changes to the planner that users get by default.
        budgets: plans of each of the planner's budgets, and executions of each.
        demo: how `piec demo` is run: "cold" with an empty cache of kernels, then "warm".
        demo_budget: its further arguments.
        plans: how many are ranked with the planner's k and with k = 1.
        action_repeats: control steps of an action, while a learner collects rollouts.
    """

    repeats: int = 5
    motion: int = 1000
    rows: int = 64
    mujoco_rows: int = 100
    states: int = 1000
    envs: int = 256
    env_steps: int = 200
    sync_steps: int = 20
    single_steps: int = 1000
    fields: int = 100
    table: tuple[int, float] = (101, 0.07)
    planner: tuple[tuple[str, Any], ...] = tuple(ONE_SEARCH.items())
    default: tuple[tuple[str, Any], ...] = ()
    budgets: tuple[int, int] = (5, 100)
    demo: tuple[str, ...] = ("cold", "warm")
    demo_budget: tuple[str, ...] = ()
    plans: int = 50
    action_repeats: tuple[int, ...] = (1, 10)


QUICK = Sizes(
    repeats=2,
    motion=200,
    rows=4,
    mujoco_rows=2,
    states=5,
    envs=8,
    env_steps=10,
    sync_steps=10,
    single_steps=50,
    fields=5,
    table=(33, 0.4),
    planner=(
        ("restarts", 1),
        ("robust_iterations", 0),
        ("iterations", 2),
        ("population", 4),
        ("start", "rest"),
    ),
    default=(
        ("restarts", 2),
        ("robust_iterations", 1),
        ("iterations", 2),
        ("population", 4),
        ("start", "rest"),
    ),
    budgets=(1, 2),
    demo=("warm",),
    demo_budget=("--smoke",),
    plans=5,
    action_repeats=(10,),
)


def median_seconds(call: Callable[[], Any], repeats: int) -> float:
    """Median time of a call, after one that is not counted.

    Args:
        call: without arguments.
        repeats: how often it is timed.

    Returns:
        The median, s.
    """
    call()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def row(benchmark: str, result: float, unit: str, wanted: str = "", note: str = "") -> Row:
    """One line of the table.

    Args:
        benchmark: its name.
        result: NaN where nothing was measured.
        unit: of the result.
        wanted: "", or such as "at most 3" or "at least 3", which decides "met".
        note: what else there is to say.

    Returns:
        The line by the names of the columns.

    Raises:
        InvalidParameterError: as `verdict` does.
    """
    met = verdict(float(result), wanted)
    return {
        "benchmark": benchmark,
        "result": float(result),
        "unit": unit,
        "wanted": wanted,
        "met": met,
        "note": note,
    }


def verdict(result: float, wanted: str) -> str:
    """Whether a result is what is wanted of it.

    Args:
        result: NaN where nothing was measured.
        wanted: "", or such as "at most 3" or "at least 3".

    Returns:
        "pass", "miss", or "" where nothing is wanted or measured.

    Raises:
        InvalidParameterError: if `wanted` cannot be understood.
    """
    if not wanted or np.isnan(result):
        return ""
    bound, _, number = wanted.rpartition(" ")
    if bound not in BOUNDS:
        raise InvalidParameterError(
            f"what is wanted is such as 'at most 3' or 'at least 3', got {wanted!r}"
        )
    return "pass" if BOUNDS[bound](result, float(number)) else "miss"


BOUNDS = {"at most": operator.le, "at least": operator.ge}


def make_started(**kwargs: Any) -> tuple[Model, State]:
    """The model of a push with the planar arm, and its start."""
    model = make_model(PUSH, **kwargs)
    return model, model.reset(0)

"""Benchmarks behind `piec bench`: medians of repeated measurements, in one run."""

from __future__ import annotations

import contextlib
import io
import os
import platform
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from functools import partial
from typing import Any

import gymnasium as gym
import numpy as np
from tqdm import tqdm

import piec_envs  # noqa: F401  registers the environments
from evaluation.records import versions
from evaluation.studies import PUSH
from piec_envs.dynamics.base import Commands, Plant
from piec_envs.dynamics.quasi_dynamic import QuasiDynamics
from piec_envs.episodes.batch import EpisodeBatch
from piec_envs.escape.grid import GridField
from piec_envs.parallel import available_threads
from planners import CmaEsPlanner, Plan
from planners.via_points import ViaPointTrajectory

Row = dict[str, Any]


@dataclass(frozen=True)
class Sizes:
    """How much is measured.

    Args:
        repeats: measurements of which the median is taken.
        motion: steps of a motion in contact.
        rows: rows of a batched motion.
        envs: rows of the vector environments.
        env_steps: steps of the native VectorEnv in one measurement, a multiple of ten.
        sync_steps: steps of Gymnasium's SyncVectorEnv, likewise.
        single_steps: steps of a single environment.
        fields: configurations solved in one measurement.
        planner: arguments of `CmaEsPlanner` for a full plan.
        plans: how many are ranked with the planner's k and with k = 1.
    """

    repeats: int = 5
    motion: int = 1000
    rows: int = 64
    envs: int = 256
    env_steps: int = 200
    sync_steps: int = 20
    single_steps: int = 1000
    fields: int = 100
    planner: tuple[tuple[str, Any], ...] = (("restarts", 1), ("robust_iterations", 0))
    plans: int = 50


QUICK = Sizes(
    repeats=2,
    motion=200,
    rows=4,
    envs=8,
    env_steps=10,
    sync_steps=10,
    single_steps=50,
    fields=5,
    planner=(("restarts", 1), ("robust_iterations", 0), ("iterations", 2), ("population", 4), ("start", "rest")),
    plans=5,
)


def run_bench(sizes: Sizes, progress: bool = True) -> dict[str, Any]:
    """Run every benchmark.

    Args:
        sizes: how much is measured.
        progress: whether to show a progress bar.

    Returns:
        "rows" of a table (benchmark, result, unit, wanted, note), "sizes", "machine" and "versions".
    """
    benchmarks: dict[str, Callable[[Sizes], list[Row]]] = {
        "contact step": contact_step,
        "vector steps": vector_steps,
        "single step": single_step,
        "escape fields": escape_fields,
        "full plans": partial(full_plans, progress=progress),
        "rollouts": rollout_threads,
    }
    rows: list[Row] = []
    with tqdm(benchmarks.items(), disable=not progress, desc="bench") as bar:
        for name, benchmark in bar:
            bar.set_postfix_str(name)
            rows += benchmark(sizes)
    machine = {"cores": available_threads(), "system": platform.system(), "architecture": platform.machine()}
    return {"rows": rows, "sizes": asdict(sizes), "machine": machine, "versions": versions()}


def median_seconds(call: Callable[[], Any], repeats: int) -> float:
    """Median time of a call, after one that is not counted."""
    call()
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        call()
        times.append(time.perf_counter() - begin)
    return float(np.median(times))


def row(benchmark: str, result: float, unit: str, wanted: str = "", note: str = "") -> Row:
    """One line of the table."""
    return {"benchmark": benchmark, "result": float(result), "unit": unit, "wanted": wanted, "note": note}


def _make_batch(**kwargs: Any) -> EpisodeBatch:
    """The batch behind a fresh single environment, started."""
    env: Any = gym.make(PUSH, disable_env_checker=True, **kwargs).unwrapped
    env.reset(seed=0)
    return env.batch


def contact_step(sizes: Sizes) -> list[Row]:
    """The quasi-dynamic step on one core, compiled and with an OSQP problem set up in each step.

    The arm curls towards the object and pushes it along; both solvers do the same motion.
    """
    state = _make_batch(escape_field=None).state
    actions = np.random.default_rng(0).uniform(0.4, 0.6, (sizes.rows, sizes.motion, 4))
    found = {}
    for solver, rows, repeats in (("fast", sizes.rows, sizes.repeats), ("osqp", 1, 3)):
        dynamics = QuasiDynamics(solver, threads=1)
        q_r, q_cmd, pose = (np.repeat(value, rows, axis=0) for value in (state.q_r, state.q_cmd, state.pose))
        plant = Plant("planar_arm", ["circle"] * rows, np.full(rows, 0.5))
        call = partial(dynamics.rollout, q_r, q_cmd, pose, Commands(actions[:rows]), plant)
        with contextlib.redirect_stdout(io.StringIO()):  # OSQP has its say about polishing whatever it is told
            share = float(call().contact[:, 1:].any(axis=2).mean())
            found[solver] = median_seconds(call, repeats) / (rows * sizes.motion), share
    (fast, share), (osqp, osqp_share) = found["fast"], found["osqp"]
    return [
        row("contact step, fast", 1e6 * fast, "us", "", f"one core, in contact {100 * share:.0f} % of the steps"),
        row("contact step, osqp", 1e6 * osqp, "us", "", f"one core, in contact {100 * osqp_share:.0f} % of the steps"),
        row("contact step, fast over osqp", osqp / fast, "times", "at least 300", "per core"),
    ]


def vector_steps(sizes: Sizes) -> list[Row]:
    """Steps per second of the native VectorEnv and of single environments stepped in turn."""
    rows = []
    for label, kwargs, wanted in (("no field", {"escape_field": None}, "at least 50"), ("defaults", {}, "")):
        native = gym.make_vec(PUSH, num_envs=sizes.envs, **kwargs)
        turns = gym.make_vec(PUSH, num_envs=sizes.envs, vectorization_mode="sync", **kwargs)
        rates = [
            _env_rate(native, sizes.env_steps, sizes.repeats),
            _env_rate(turns, sizes.sync_steps, min(sizes.repeats, 3)),
        ]
        turns.close()
        rows += [
            row(f"native VectorEnv, {label}", rates[0], "steps/s", "", f"{sizes.envs} rows, all cores"),
            row(f"SyncVectorEnv, {label}", rates[1], "steps/s", "", f"{sizes.envs} rows"),
            row(f"native over Sync, {label}", rates[0] / rates[1], "times", wanted),
        ]
    return rows


def _env_rate(envs: Any, steps: int, repeats: int) -> float:
    """Env steps per second, resets not counted."""
    envs.reset(seed=0)
    actions = np.random.default_rng(0).uniform(-1, 1, (steps, *envs.action_space.shape))

    def run() -> None:
        for action in actions:
            envs.step(action)

    return steps * envs.num_envs / median_seconds(run, repeats)


def single_step(sizes: Sizes) -> list[Row]:
    """One step of a single environment as `gym.make` gives it."""
    rows = []
    for label, kwargs, wanted in (("no field", {"escape_field": None}, "at most 60"), ("defaults", {}, "")):
        env = gym.make(PUSH, **kwargs)
        actions = np.random.default_rng(0).uniform(-1, 1, (sizes.single_steps, 4))
        times = []
        for _ in range(sizes.repeats + 1):
            env.reset(seed=0)
            begin = time.perf_counter()
            for action in actions:
                env.step(action)
            times.append((time.perf_counter() - begin) / len(actions))
        rows.append(row(f"single env step, {label}", 1e6 * float(np.median(times[1:])), "us", wanted))
    return rows


def escape_fields(sizes: Sizes, resolution: int = 100) -> list[Row]:
    """The grid solvers on one core, speed map included, and scikit-fmm on the same grid without it."""
    rng = np.random.default_rng(0)
    q = rng.uniform(-2.6, 2.6, (sizes.fields, 4))
    points = np.tile([[[0.35, 0.1]]], (sizes.fields, 1, 1))
    seconds, rows = {}, []
    for method in ("marching", "sweeping"):
        field = GridField("planar_arm", resolution, method, threads=1)
        seconds[method] = median_seconds(partial(field.query, points, q), sizes.repeats) / sizes.fields
        rows.append(row(f"field, {method}", 1e3 * seconds[method], "ms", "", f"one core, {resolution} x {resolution}"))
    reference = _scikit_fmm(q, resolution, sizes.repeats)
    if reference is None:
        return [*rows, {**row("field, scikit-fmm", np.nan, "ms"), "note": "scikit-fmm is not installed (extra 'dev')"}]
    rows.append(row("field, scikit-fmm", 1e3 * reference, "ms", "", "second order, speed map not counted"))
    for method, wanted in (("marching", "at least 1.2"), ("sweeping", "at least 3")):
        rows.append(row(f"{method} over scikit-fmm", reference / seconds[method], "times", wanted, "per core"))
    return rows


def _scikit_fmm(q: np.ndarray, resolution: int, repeats: int) -> float | None:
    """Seconds of scikit-fmm's second-order march for each configuration, None without it."""
    try:
        import skfmm
    except ImportError:
        return None
    field = GridField("planar_arm", resolution, threads=1)
    maps = [field.solve(configuration) for configuration in q]
    x, y = np.meshgrid(maps[0].x, maps[0].y)  # (N, N)
    inside = 1.4 - np.hypot(x, y)  # zero on the escape set's boundary, m
    ring = np.ma.masked_array(inside, inside < -2 * (x[0, 1] - x[0, 0]))

    def run() -> None:
        for item in maps:
            skfmm.travel_time(ring, item.speed, dx=float(x[0, 1] - x[0, 0]), order=2)

    return median_seconds(run, repeats) / len(q)


def full_plans(sizes: Sizes, progress: bool = False) -> list[Row]:
    """A full plan with two objectives, and what evaluating the field on every k-th step does to its costs."""
    rows, plans = [], {}
    chosen = dict(sizes.planner)
    for objective, wanted in (("contact", "at most 10"), ("caging", "at most 90")):
        planner = CmaEsPlanner(objective=objective, **chosen)
        begin = time.perf_counter()
        plans[objective] = planner.plan(PUSH, seed=0, progress=progress)
        note = f"{planner.iterations} iterations x {planner.population} trajectories x {plans[objective].horizon} steps"
        rows.append(row(f"plan, {objective}", time.perf_counter() - begin, "s", wanted, note))
    k = planner.escape_every
    rank = rank_correlation(plans["caging"], k, sizes.plans)
    note = f"Spearman, k = {k} against k = 1, {sizes.plans} plans around the caging plan"
    return [*rows, row("rank of plan costs", rank, "", "at least 0.99", note)]


def rank_correlation(plan: Plan, k: int, count: int) -> float:
    """Rank correlation of costs with the field on every k-th step and on every step.

    Args:
        plan: with objective "caging".
        k: steps between two evaluations of the field.
        count: plans drawn around this one, from 0.02 to 0.3 rad away at each via point.
    """
    from scipy.stats import spearmanr

    spread = np.geomspace(0.02, 0.3, count)[:, None, None]
    shift = spread * np.random.default_rng(0).standard_normal((count, *plan.via_points.shape))
    costs = []
    for every in (k, 1):
        batch = _make_batch(**{**plan.env_kwargs, "escape_every": every})
        lower, upper = batch.robot.joint_array("lower"), batch.robot.joint_array("upper")
        via = np.clip(plan.via_points + shift, lower, upper)
        path = ViaPointTrajectory(len(plan.via_points), plan.horizon).path(batch.robot.home, via)
        costs.append(batch.rollout(batch.state, np.clip(path, lower, upper), absolute=True).cost)
    return float(spearmanr(costs[0], costs[1]).statistic)


def rollout_threads(sizes: Sizes) -> list[Row]:
    """Steps per second of the batched rollout on one thread and on two."""
    rows: list[Row] = []
    controls = np.random.default_rng(0).uniform(0.4, 0.6, (sizes.envs, sizes.env_steps, 4))
    for label, kwargs in (("no field", {"escape_field": None}), ("defaults", {})):
        for threads in _thread_counts():
            batch = _make_batch(threads=threads, **kwargs)
            call = partial(batch.rollout, batch.state, controls, absolute=False)
            rate = sizes.envs * sizes.env_steps / median_seconds(call, sizes.repeats)
            rows.append(row(f"rollout, {label}, threads: {threads}", rate, "steps/s", "", f"{sizes.envs} rows"))
    return rows


def _thread_counts() -> Iterator[int]:
    """One thread, and two where there are as many cores."""
    yield 1
    if (os.cpu_count() or 1) > 1:
        yield 2

"""Benchmarks behind `piec bench`: medians of repeated measurements, in one run."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from typing import Any

from tqdm import tqdm

from evaluation.bench.base import QUICK, Row, Sizes
from evaluation.bench.demo import whole_demo
from evaluation.bench.dynamics import mujoco_steps
from evaluation.bench.environments import rollout_threads, single_step, vector_steps
from evaluation.bench.fields import network_queries, table_queries
from evaluation.bench.kernels import contact_step, escape_fields, franka_steps, slowest_steps
from evaluation.bench.learning import rollout_collection
from evaluation.bench.planning import (
    franka_plan,
    one_search,
    plan_budgets,
    static_caging,
)
from piec_envs import available_threads, console, provenance

__all__ = ["QUICK", "Sizes", "run_bench"]


def run_bench(sizes: Sizes, progress: bool = True) -> dict[str, Any]:
    """Run every benchmark.

    Args:
        sizes: how much is measured.
        progress: whether to show a progress bar.

    Returns:
        "rows" of a table (benchmark, result, unit, wanted, met, note), "sizes", "machine",
        "versions" and "source".
    """
    benchmarks: dict[str, Callable[[Sizes], list[Row]]] = {
        "contact step": contact_step,
        "mobile Franka": franka_steps,
        "slowest steps": slowest_steps,
        "vector steps": vector_steps,
        "single step": single_step,
        "rollouts of PPO": rollout_collection,
        "escape fields": escape_fields,
        "learned field": network_queries,
        "tabulated field": table_queries,
        "static caging": static_caging,
        "planning budgets": partial(plan_budgets, progress=progress),
        "demo": whole_demo,
        "one search": partial(one_search, progress=progress),
        "Franka plan": partial(franka_plan, progress=progress),
        "rollouts": rollout_threads,
        "MuJoCo": mujoco_steps,
    }
    rows: list[Row] = []
    with tqdm(benchmarks.items(), disable=console.no_bar(progress), desc="bench") as bar:
        for name, benchmark in bar:
            bar.set_postfix_str(name)
            rows += benchmark(sizes)
    machine = {
        "cores": available_threads(),
        "system": platform.system(),
        "architecture": platform.machine(),
    }
    made_by = {"versions": provenance.versions(), "source": provenance.source()}
    return {"rows": rows, "sizes": asdict(sizes), "machine": machine, **made_by}

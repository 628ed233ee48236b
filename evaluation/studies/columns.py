"""Columns of the tables of studies: rates, distances and what plans share, with their spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from evaluation.metrics import bootstrap_interval, wilson_interval
from evaluation.tables import Rates, Spread


def column(results: Sequence[Mapping[str, Any]], name: str) -> np.ndarray:
    """One number of every plan's result.

    Args:
        results: one for each plan.
        name: of the number.

    Returns:
        Shape (plans,); None becomes NaN.
    """
    return np.array(
        [np.nan if result[name] is None else result[name] for result in results], dtype=float
    )


def success_columns(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Success under a random protocol: within the first plan, plan by plan, and over plans.

    Args:
        results: of `evaluate_once`, one for each plan.

    Returns:
        Cells of a table.
    """
    first = results[0]
    rates = [result["success_rate"] for result in results]
    return {
        "plans": len(results),
        "n": executions(results),
        "first plan": wilson_interval(first["successes"], first["n"]),
        "each plan": Rates(rates),
        "mean over plans": bootstrap_interval(rates),
        "least": Rates([min(rates)]),
    }


def executions(results: Sequence[Mapping[str, Any]], name: str = "n") -> str:
    """How many distinct executions there are.

    Args:
        results: one for each plan.
        name: of their number in a result.

    Returns:
        Such as "5 x 100", or the sum where plans differ in it.
    """
    counts = sorted({result[name] for result in results})
    return (
        f"{len(results)} x {counts[0]}"
        if len(counts) == 1
        else str(sum(result[name] for result in results))
    )


def distance_columns(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Distances at the end, over all executions of all plans, m.

    The standard deviation is that of all executions together.
    """
    weights = column(results, "n")
    cells: dict[str, Any] = {}
    for name, label in (("d2g", "d2g, m"), ("goal_distance", "goal distance, m")):
        means = column(results, f"{name}_mean")
        deviations = column(results, f"{name}_std")
        mean = float(np.average(means, weights=weights))
        variance = float(np.average(deviations**2 + (means - mean) ** 2, weights=weights))
        cells[label] = Spread(mean, variance**0.5)
    cells["deviation, m"] = float(np.average(column(results, "deviation"), weights=weights))
    return cells


def usage_columns(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """How the arm is used, means over plans: contact of each link, arm distance, caging."""
    contact = np.mean([result["contact_fraction"] for result in results], axis=0)  # (links,)
    cells: dict[str, Any] = {f"link {i + 1}": Rates([share]) for i, share in enumerate(contact)}
    cells["arm distance, m"] = spread(column(results, "mean_distance"))
    cells["caging"] = spread(column(results, "mean_caging"))
    return cells


def spread(values: np.ndarray) -> Spread:
    """Mean and standard deviation over plans."""
    return Spread(float(values.mean()), float(values.std()))


def home_columns(plans: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Where the nominal execution of each plan ends; one distinct execution for each plan.

    Args:
        plans: results of `plan_once`.
    """
    ends = [plan["nominal"]["goal_distance"] for plan in plans]
    home = sum(plan["nominal"]["d2g"] == 0 for plan in plans)
    crossed = sum(plan["crossing"] > 0 for plan in plans)
    return {
        "plans": len(plans),
        "n": len(plans),
        "in the goal": f"{home} of {len(plans)}",
        "goal distance, m": ends,
        "through itself": f"{crossed} of {len(plans)}",
    }

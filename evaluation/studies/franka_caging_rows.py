"""Rows of the tables of static caging by the Franka."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from evaluation.studies.posture_work import (
    Records,
    feasible_results,
    search_columns,
)
from evaluation.studies.workspace_radius import PAPER, least_times, radius_for
from piec_envs import CAGING_SCALE, get_object

CLOSE = 0.98  # of what the exhaustive search finds


def object_rows(
    best: Mapping[str, Any], yardstick: Mapping[str, Any], counts: Mapping[str, int]
) -> list[dict[str, Any]]:
    """One row for each object: the paper's Table 1 beside ours.

    Args:
        best: the best record of CMA-ES, by object.
        yardstick: that of the exhaustive search.
        counts: how many searches of CMA-ES there were.

    Returns:
        One row for each object.
    """
    rows = []
    for name, record in best.items():
        T = np.array(record["result"]["key_points"]["T"])
        T_0 = least_times(record)
        top = np.array(yardstick[name]["result"]["key_points"]["T"])
        mean, least = PAPER.get(name, (None, None))
        rows.append(
            {
                "object": name,
                "n": counts[name],
                "key points": len(T),
                "mean": CAGING_SCALE * T.mean(),
                "least": CAGING_SCALE * T.min(),
                "T - T_0, s": (T - T_0).mean(),
                "T / T_0": T.mean() / T_0.mean(),
                "enclosed": f"{sum(record['result']['key_points']['enclosed'])} of {len(T)}",
                "exhaustive: mean": CAGING_SCALE * top.mean(),
                "exhaustive: least": CAGING_SCALE * top.min(),
                "exhaustive: T - T_0, s": (top - T_0).mean(),
                "exhaustive: T / T_0": top.mean() / T_0.mean(),
                "share": f"{100 * T.mean() / top.mean():.1f} %",
                "paper: mean": mean,
                "paper: least": least,
                "radius, m": None if mean is None else radius_for(record, mean),
            }
        )
    return rows


def point_rows(best: Mapping[str, Any], yardstick: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The escape time of each key point.

    Args:
        best: the best record of CMA-ES, by object.
        yardstick: that of the exhaustive search.

    Returns:
        One row for each key point.
    """
    rows = []
    for name, record in best.items():
        T_0 = least_times(record)
        points = get_object(name).key_points
        found, top = (r["result"]["key_points"] for r in (record, yardstick[name]))
        for k, point in enumerate(points):
            rows.append(
                {
                    "object": name,
                    "key point, m": f"({point[0]:.2f}, {point[1]:.2f})",
                    "T, s": found["T"][k],
                    "T_0, s": T_0[k],
                    "T - T_0, s": found["T"][k] - T_0[k],
                    "T / T_0": found["T"][k] / T_0[k],
                    "enclosed": "yes" if found["enclosed"][k] else "no",
                    "exhaustive: T / T_0": top["T"][k] / T_0[k],
                    "exhaustive: enclosed": "yes" if top["enclosed"][k] else "no",
                    "share": f"{100 * found['T'][k] / top['T'][k]:.1f} %",
                }
            )
    return rows


def search_rows(
    by_case: Mapping[Any, Records], yardstick: Mapping[str, Any]
) -> list[dict[str, Any]]:
    """How often each search comes near the best.

    Args:
        by_case: records by object, optimised field and method.
        yardstick: the best record of the exhaustive search, by object.

    Returns:
        One row for each object, field and search.
    """
    rows = []
    for (name, optimised, method), records in by_case.items():
        rows.append(
            {
                "object": name,
                "field": optimised,
                "search": method.label,
                **_counts(records, yardstick[name]),
            }
        )
    for name, record in yardstick.items():
        field_name = record["spec"]["field"]["name"]
        search = record["spec"]["optimiser"]["name"]
        rows.append(
            {"object": name, "field": field_name, "search": search, **_counts([record], record)}
        )
    return rows


def _counts(records: Records, top: Mapping[str, Any]) -> dict[str, Any]:
    n = len(records)
    good = feasible_results(records)
    reached = sum(result["judged"] >= CLOSE * top["result"]["judged"] for result in good)
    return {
        "n": n,
        "feasible": f"{len(good)} of {n}",
        "reached": f"{reached} of {n}",
        **search_columns(records),
    }

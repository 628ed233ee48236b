"""Rows of the tables that compare ways of touching the object."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from evaluation.figures.modes import mode_of
from evaluation.studies.columns import (
    column,
    distance_columns,
    executions,
    home_columns,
    spread,
    success_columns,
)
from evaluation.studies.common import Case, StudyRun
from evaluation.studies.mismatch import Results
from evaluation.studies.pictures import first_trajectories
from evaluation.tables import Rates
from piec_envs import (
    CAGING_SCALE,
    choose_field,
    get_object,
    get_robot,
    object_escape_time,
)


@dataclass(frozen=True)
class Printed:
    """The paper's values, by method.

    Args:
        noise: d2g (m) and success under displacements, as printed.
        mismatch: d2g without noise and under each mismatch, m.
    """

    noise: Mapping[str, tuple[str, str]] = field(default_factory=dict)
    mismatch: Mapping[str, Mapping[str, float]] = field(default_factory=dict)


def disturbed_rows(
    cases: Sequence[Case],
    plans: Sequence[Any],
    results: Sequence[Any],
    paper: Mapping[str, tuple[str, str]],
) -> list[dict[str, Any]]:
    """Rows of the table of disturbed executions, the paper's values beside ours.

    Args:
        cases: what is compared.
        plans: for each the results of `plan_once`.
        results: for each the results of `evaluate_once` under noise.
        paper: d2g (m) and success as the paper prints them, by label.

    Returns:
        One row for each case.
    """
    rows = []
    for case, planned, executed_ in zip(cases, plans, results, strict=True):
        home = home_columns(planned)
        d2g, rate = paper.get(case.label, (None, None))
        row = {"method": case.title, **success_columns(executed_), **distance_columns(executed_)}
        row |= {
            "in the goal, nominal": home["in the goal"],
            "through itself": home["through itself"],
        }
        rows.append({**row, **({"paper: d2g, m": d2g, "paper: success": rate} if paper else {})})
    return rows


def mismatch_rows(
    cases: Sequence[Case], results: Results, protocols: Sequence[str]
) -> list[dict[str, Any]]:
    """Rows of d2g and success under each protocol, from the task's start and from drawn starts.

    Args:
        cases: what is compared.
        results: by protocol, twins with drawn starts included.
        protocols: the columns.

    Returns:
        Two rows for each case.
    """
    rows = []
    for i, case in enumerate(cases):
        for suffix, label in (("", "task's start"), ("-start", "drawn starts")):
            by_protocol = {name: results[f"{name}{suffix}"][i] for name in protocols}
            n = executions(next(iter(by_protocol.values())))
            row: dict[str, Any] = {"method": case.title, "from": label, "n": n}
            for name, plans in by_protocol.items():
                row[f"{name}: d2g, m"] = float(
                    np.average(column(plans, "d2g_mean"), weights=column(plans, "n"))
                )
            for name, plans in by_protocol.items():
                row[f"{name}: success"] = Rates(result["success_rate"] for result in plans)
            rows.append(row)
    return rows


def printed_rows(printed: Printed, protocols: Sequence[str]) -> list[dict[str, Any]]:
    """The paper's d2g as rows of the same table.

    Args:
        printed: the paper's values.
        protocols: the columns.

    Returns:
        One row for each method that the paper prints.
    """
    return [
        {"method": mode_of(label).label, "from": "paper", "n": "-"}
        | {f"{name}: d2g, m": values[name] for name in protocols if name in values}
        for label, values in printed.mismatch.items()
    ]


def usage_rows(
    study: StudyRun, cases: Sequence[Case], results: Sequence[Any]
) -> list[dict[str, Any]]:
    """How the arm is used without noise: contact, distance, and caging in part and as a whole.

    Args:
        study: the run.
        cases: what is compared.
        results: for each the results of `evaluate_once` without noise.

    Returns:
        One row for each case.
    """
    rows = []
    for case, executed_ in zip(cases, results, strict=True):
        whole = [whole_arm_caging(study, case, seed) for seed in study.seeds]
        contact = [np.mean(result["contact_fraction"]) for result in executed_]
        rows.append(
            {
                "method": case.title,
                "n": executions(executed_),
                "links in contact, mean share": spread(np.array(contact)),
                "arm distance, m": spread(column(executed_, "mean_distance")),
                "caging": spread(column(executed_, "mean_caging")),
                "caging at the end": spread(column(executed_, "final_caging")),
                "whole-arm caging": spread(np.array(whole)),
            }
        )
    return rows


def whole_arm_caging(study: StudyRun, case: Case, seed: int) -> float:
    """Caging of all parts of the arm over the nominal execution of one plan.

    Args:
        study: the run.
        case: whose plan.
        seed: the planner's.

    Returns:
        The mean over time, 0.02 T.
    """
    executed_ = study.load_evaluation(case, seed, "nominal")
    plan = study.load_plan(case, seed)
    drawn = first_trajectories(study, [case])[0]
    field = choose_field(
        case.env_kwargs.get("escape_field", "table"), get_robot(plan.robot).whole_name
    )
    points = get_object(drawn.object_name).key_points
    times = object_escape_time(field, points, executed_.pose[0], executed_.q_r[0])
    return CAGING_SCALE * float(times[1:].mean())

"""What the studies of plants other than the planner's model share (paper, section 6): rows, notes
and pictures.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

from evaluation.figures import Executed, final_distances, mismatch_paths
from evaluation.metrics import Interval, bootstrap_interval, wilson_interval
from evaluation.protocols import get_protocol
from evaluation.studies.columns import column, executions
from evaluation.studies.common import Case, StudyRun
from evaluation.studies.paper import all_notes
from evaluation.studies.pictures import case_setup, first_trajectories, over_plans
from evaluation.tables import Estimate, Rates, write_table

# protocol -> for each case the results of `evaluate_once`
Results = Mapping[str, list[list[dict[str, Any]]]]

GOOD = 0.9  # success below which the notes name a protocol

NOTES = """\
n counts distinct executions: plans x executions of each. A protocol that draws nothing is one
execution of a plan; its twin `-start` draws the object's start within 0.01 m and 0.05 rad. An
execution succeeds if the object's centre ends within 0.05 m of the goal's; d2g is the distance to
that region at the end. Deviation: largest distance of the object from the unperturbed execution at
the same time, and that at the end; unperturbed is the same plan under `nominal`, and for a `-start`
under `nominal-start` from the same start (`nominal-start` itself is compared with `nominal`). Means
over executions; intervals (95 %) by a bootstrap over plans, and for the success of one execution of
each plan by Wilson. A bootstrap has no width where all plans agree, though a few plans that agree
say little about another one. Each plan: success by planner seed. Diverged: executions whose
simulation became unstable; they count as failed."""

PICTURES = """\
object_paths.png shows the plans of the first seed from the task's start, final_distance.png all
plans from drawn starts."""


def with_starts(protocols: Sequence[str]) -> list[str]:
    """Each protocol followed by its twin with drawn starts."""
    return [name for protocol in protocols for name in (protocol, f"{protocol}-start")]


def evaluate_all(study: StudyRun, cases: Sequence[Case], protocols: Sequence[str]) -> Results:
    """Evaluate all plans under protocols and their twins with drawn starts.

    Args:
        study: the run.
        cases: whose plans.
        protocols: names, without the twins'.

    Returns:
        By protocol, twins included, what `StudyRun.evaluate` returns.
    """
    return {name: study.evaluate(cases, name) for name in with_starts(protocols)}


def success_rate(results: Sequence[Mapping[str, Any]], twin: str = "") -> Interval:
    """Success over all plans.

    Args:
        results: of `evaluate_once`, one for each plan.
        twin: "unperturbed_" for the rate of the unperturbed twin.

    Returns:
        Mean over plans with a bootstrap; where each plan is one execution, hence one draw of
        success or failure, Wilson's interval.
    """
    rates = column(results, f"{twin}success_rate")
    if (column(results, f"{twin}n") == 1).all():
        return wilson_interval(int(rates.sum()), len(rates))
    return bootstrap_interval(rates)


def estimate(results: Sequence[Mapping[str, Any]], name: str) -> Estimate:
    """Mean of a quantity over plans, with a bootstrap.

    Args:
        results: one for each plan.
        name: of the quantity in a result.

    Returns:
        The mean and the bounds of its interval.
    """
    return Estimate(*bootstrap_interval(column(results, name)))


def mismatch_rows(cases: Sequence[Case], results: Results) -> list[dict[str, Any]]:
    """Rows of the table: protocols by cases, each beside its unperturbed twin.

    Args:
        cases: what is compared.
        results: from `evaluate_all`.

    Returns:
        The rows.
    """
    return [
        {"protocol": protocol, "objective": case.title, **mismatch_columns(executed)}
        for protocol, by_case in results.items()
        for case, executed in zip(cases, by_case, strict=True)
    ]


def mismatch_columns(results: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """Cells of one row.

    Args:
        results: of `evaluate_once`, one for each plan.
    """
    return {
        "n": executions(results),
        "success": success_rate(results),
        "each plan": Rates(result["success_rate"] for result in results),
        "d2g, m": estimate(results, "d2g_mean"),
        "deviation, m": estimate(results, "deviation"),
        "deviation at the end, m": estimate(results, "final_deviation"),
        "diverged": sum(result["diverged"] for result in results),
        "unperturbed n": executions(results, "unperturbed_n"),
        "unperturbed success": success_rate(results, "unperturbed_"),
        "unperturbed d2g, m": estimate(results, "unperturbed_d2g"),
    }


def shortfalls(cases: Sequence[Case], results: Results, label: str = "caging") -> str:
    """One sentence about where a case succeeds in less than 90 % of its executions.

    Args:
        cases: all cases.
        results: of all protocols.
        label: of the case.

    Returns:
        The sentence; "" if the study has no such case.
    """
    if label not in [case.label for case in cases]:
        return ""
    rank = [case.label for case in cases].index(label)
    found = []
    for protocol, by_case in results.items():
        rates = column(by_case[rank], "success_rate")
        if rates.mean() < GOOD:
            found.append(
                f"`{protocol}` ({100 * rates.mean():.0f} %, least plan {100 * rates.min():.0f} %)"
            )
    if not found:
        return (
            f"Where {label} falls short: nowhere; it succeeds in at least {100 * GOOD:.0f} % "
            f"under every protocol."
        )
    return f"Where {label} falls short of {100 * GOOD:.0f} %: {', '.join(found)}."


def notes(cases: Sequence[Case], results: Results, *own: str) -> str:
    """Notes of a table: the study's own, what is shared, and where caging falls short.

    Args:
        cases: what is compared.
        results: from `evaluate_all`.
        own: paragraphs of the study.

    Returns:
        The text.
    """
    return "\n\n".join(filter(None, [*own, NOTES, shortfalls(cases, results)]))


def paper_table(
    study: StudyRun, cases: Sequence[Case], protocols: Sequence[str], title: str, own: str
) -> list[Path]:
    """The same rows for the plans with the paper's presets and budget, in a table `paper`.

    Args:
        study: the run.
        cases: from `paper_cases`; none writes nothing.
        protocols: those of the study's own table.
        title: of that table.
        own: the study's own notes.

    Returns:
        The files written.
    """
    if not cases:
        return []
    rows = mismatch_rows(cases, evaluate_all(study, cases, protocols))
    text = all_notes(f"{own}\n\n{NOTES}", [case.label for case in cases])
    return write_table(
        study.out_dir, rows, f"{title}, with the paper's weights and budget", text, "paper"
    )


def draw_mismatch(
    study: StudyRun,
    cases: Sequence[Case],
    drawn: Sequence[str],
    compared: Sequence[str],
    label: Callable[[str], str],
) -> list[Path]:
    """Object paths of the first plans from the task's start, and final distances of all plans from
    drawn starts.

    Args:
        study: the run.
        cases: what to compare.
        drawn: protocols whose paths are drawn beside the nominal one.
        compared: protocols whose final distances are compared, from drawn starts.
        label: what the figures call a protocol.

    Returns:
        The files written.
    """
    folder = study.out_dir
    runs = [[executed(study, case, name, label(name)) for name in drawn] for case in cases]
    final = {
        case.label: {
            label(name): over_plans(study, case, f"{name}-start", "goal_distance")[:, -1]
            for name in compared
        }
        for case in cases
    }
    return study.draw(
        partial(
            mismatch_paths, first_trajectories(study, cases), runs, folder / "object_paths.png"
        ),
        partial(final_distances, final, folder / "final_distance.png"),
    )


def executed(study: StudyRun, case: Case, protocol: str, label: str) -> Executed:
    """The first seed's plan from the task's start under a protocol.

    Args:
        study: the run.
        case: whose plan.
        protocol: its name.
        label: what figures call the execution.

    Returns:
        What the object did, and which object it was.
    """
    own = case_setup(case).plant.object
    plant = get_protocol(protocol).env_kwargs({"object": own, **case.env_kwargs})
    return Executed(
        label, plant["object"], study.load_evaluation(case, study.seeds[0], protocol).pose[0]
    )

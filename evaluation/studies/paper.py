"""The paper's budget, presets and cases, which studies show beside their own (paper, appendix
A.2.1).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from evaluation.studies import PUSH
from evaluation.studies.common import Case
from piec_envs import PAPER_PRESETS

# The paper's budget (appendix A.2.1), whatever a study plans with otherwise: one search of 100
# iterations with 50 samples over 5 via points. It names no first step size and no first guess:
# sigma = 0.2 rad or m and a guess at rest are ours. So is asking for the escape time on every fifth
# step, as all planners here do: the cost of a plan changes by less than 0.2 %. Nothing is
# restarted, screened or polished.
PAPER_PLANNER: Mapping[str, Any] = {
    "population": 50,
    "iterations": 100,
    "restarts": 1,
    "screening": 0,
    "survivors": 1,
    "via_points": 5,
    "moving_points": 5,
    "sigma": 0.2,
    "start": "rest",
    "escape_field": "auto",
    "escape_every": 5,
    "robust_iterations": 0,
}
PAPER_NOTES = """\
Rows called "paper" and "paper-miss" are planned and executed with the paper's contact model (no
compliance, unlimited lead), weights and budget: one search of 100 iterations with 50 samples, from
rest, nothing polished under noise. "paper" is the paper to the letter, under which a caging plan
has no reason to end at the goal: in each step its task term, 100 d^2, is 25 at half a metre from
the goal, its caging term 160 in a closed cage, wherever that is. "paper-miss" adds the default's
weight on a miss of the goal region at the end, 1e5 d2g."""


def paper_case(
    label: str, preset: str, objective: str, env_kwargs: Mapping[str, Any], env_id: str = PUSH
) -> Case:
    """A case with the paper's budget and one of its presets, for planning and for execution.

    Args:
        label: what tables call it, but for the preset.
        preset: "paper" or "paper-miss".
        objective: row of the table of objectives.
        env_kwargs: keyword arguments of the environment beside the preset.
        env_id: id of the environment.

    Returns:
        The case.
    """
    planner = {**PAPER_PLANNER, "preset": preset, "objective": objective}
    return Case(f"{label}, {preset}", planner, {**env_kwargs, "preset": preset}, env_id)


def paper_cases(objectives: Sequence[str], env_kwargs: Mapping[str, Any]) -> list[Case]:
    """Objectives with the paper's budget: to the letter, then with the weight on a miss.

    Args:
        objectives: rows of the table of objectives.
        env_kwargs: keyword arguments of the environment beside the preset.

    Returns:
        The cases.
    """
    return [
        paper_case(name, preset, name, env_kwargs)
        for preset in PAPER_PRESETS
        for name in objectives
    ]


def all_notes(notes: str, paper: Sequence[str]) -> str:
    """Notes of a table, and what the paper's rows are, where it has any.

    Args:
        notes: the study's own.
        paper: the objectives that have such rows.

    Returns:
        The text.
    """
    return f"{notes}\n\n{PAPER_NOTES}" if paper else notes

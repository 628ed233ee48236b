"""The table of planners of motions."""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from piec_envs import check_name


@dataclass(frozen=True)
class Row:
    """One planner: a dataclass with `plan(env_id, seed, progress, **env_kwargs)`.

    Args:
        where: its class, as `module:class`, loaded with its first use.
        summary: in a sentence.
    """

    where: str
    summary: str


PLANNERS: dict[str, Row] = {
    "cma-es": Row("planners.cma_es:CmaEsPlanner", "CMA-ES over via points, polished under noise"),
    "carry": Row(
        "planners.carry:RigidCarry",
        "a sliding base moves along and the arm keeps the posture of the start",
    ),
}
QUICK_PLANNERS = ("cma-es",)  # those with a `quick` budget beside their own


def planner_class(name: str) -> Any:
    """The class of a planner.

    Args:
        name: a row of the table of planners.

    Raises:
        UnknownNameError: if the table has no such row.
    """
    check_name("planner", name, PLANNERS)
    module, _, kind = PLANNERS[name].where.partition(":")
    return getattr(import_module(module), kind)

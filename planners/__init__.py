"""Planners (CMA-ES over via points, rigid carrying), plan files and their policy; searches for
enclosing postures.

The names below load what they need at their first use: CMA-ES alone takes a second.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from piec_envs import CagingProblem
    from planners.base import OpenLoopPolicy, Plan
    from planners.carry import RigidCarry
    from planners.cma_es import CmaEsPlanner
    from planners.cma_es_configuration import CmaEsConfiguration
    from planners.configuration import Configuration
    from planners.exhaustive import ExhaustiveConfiguration
    from planners.interrupted import PlanningInterrupted
    from planners.sqp import SqpConfiguration
    from planners.table import PLANNERS

_WHERE = {
    "CagingProblem": "piec_envs",
    "PLANNERS": "planners.table",
    "CmaEsConfiguration": "planners.cma_es_configuration",
    "CmaEsPlanner": "planners.cma_es",
    "Configuration": "planners.configuration",
    "ExhaustiveConfiguration": "planners.exhaustive",
    "OpenLoopPolicy": "planners.base",
    "Plan": "planners.base",
    "PlanningInterrupted": "planners.interrupted",
    "RigidCarry": "planners.carry",
    "SqpConfiguration": "planners.sqp",
}
__all__ = [
    "PLANNERS",
    "CagingProblem",
    "CmaEsConfiguration",
    "CmaEsPlanner",
    "Configuration",
    "ExhaustiveConfiguration",
    "OpenLoopPolicy",
    "Plan",
    "PlanningInterrupted",
    "RigidCarry",
    "SqpConfiguration",
]


def __getattr__(name: str) -> Any:
    if name not in _WHERE:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(_WHERE[name]), name)


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})

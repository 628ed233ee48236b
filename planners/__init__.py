"""Planners (CMA-ES over via points, rigid carrying), plan files and their policy; searches for enclosing postures."""

from piec_envs.episodes.posture import CagingProblem
from planners.base import OpenLoopPolicy, Plan
from planners.carry import RigidCarry
from planners.cma_es import CmaEsPlanner
from planners.configuration import CmaEsConfiguration, Configuration
from planners.exhaustive import ExhaustiveConfiguration
from planners.sqp import SqpConfiguration

__all__ = [
    "CagingProblem",
    "CmaEsConfiguration",
    "CmaEsPlanner",
    "Configuration",
    "ExhaustiveConfiguration",
    "OpenLoopPolicy",
    "Plan",
    "RigidCarry",
    "SqpConfiguration",
]

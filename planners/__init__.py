"""Planners: via-point trajectories by CMA-ES with plan files and their policy; enclosing postures by CMA-ES and SQP."""

from piec_envs.episodes.posture import CagingProblem
from planners.base import OpenLoopPolicy, Plan
from planners.cma_es import CmaEsPlanner
from planners.configuration import CmaEsConfiguration, Configuration
from planners.sqp import SqpConfiguration

__all__ = [
    "CagingProblem",
    "CmaEsConfiguration",
    "CmaEsPlanner",
    "Configuration",
    "OpenLoopPolicy",
    "Plan",
    "SqpConfiguration",
]

"""Open-loop planners: via-point trajectories, CMA-ES, plan files and the policy that executes them."""

from planners.base import OpenLoopPolicy, Plan
from planners.cma_es import CmaEsPlanner

__all__ = ["CmaEsPlanner", "OpenLoopPolicy", "Plan"]

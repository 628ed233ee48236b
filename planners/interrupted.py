"""What Ctrl-C leaves of a planning."""

from __future__ import annotations

from planners.base import Plan


class PlanningInterrupted(KeyboardInterrupt):
    """Ctrl-C while planning.

    Args:
        plan: the best so far.
        iterations: how many were done.
        total: how many there are.
    """

    def __init__(self, plan: Plan, iterations: int, total: int):
        super().__init__(plan, iterations, total)
        self.plan = plan
        self.iterations = iterations
        self.total = total

    def __str__(self) -> str:
        return f"planning was interrupted after {self.iterations} of {self.total} iterations"

"""What OSQP says of a step is looked at: its x of a problem without solution is a large finite
number.
"""

from __future__ import annotations

import numpy as np
import pytest

from piec_envs.escape.field import make_field
from planners import CagingProblem, SqpConfiguration
from planners.sqp import Linearised


@pytest.mark.parametrize("slope", [0.0, 1e-9])
def test_a_step_without_solution_is_no_step(slope):
    """A metre of overlap that no motion within the trust can undo, not even an eighth of it."""
    problem = CagingProblem(
        "planar_arm", "circle", np.array([0.35, 0.1, 0.0]), make_field("grid", resolution=32)
    )
    q = np.array([0.3, 1.0, 0.5, 0.5])
    sqp = SqpConfiguration()
    judged = problem.measure(q[None])
    stuck = Linearised(q, np.full(4, -0.5), np.array([-1.0, 0.1]), np.full((2, 4), slope), judged)
    np.testing.assert_array_equal(sqp.step(problem, stuck, sqp.trust), np.zeros(4))
    free = stuck._replace(phi=np.array([1.0, 0.1]))
    step = sqp.step(problem, free, sqp.trust)
    assert (np.abs(step) <= sqp.trust).all() and (step > 0).all()

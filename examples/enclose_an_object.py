"""Static caging: the posture that encloses an object best, by CMA-ES and by SQP with gradients.

Run it as `python examples/enclose_an_object.py`.
"""

import argparse

import numpy as np

from piec_envs import make_field
from planners import CagingProblem, CmaEsConfiguration, SqpConfiguration

POSE = np.array([0.3, 0.1, 0.0])  # of the object: x, y, angle, m and rad


def main(restarts: int, iterations: int) -> None:
    """Solve with the learned field, judge with the exact one."""
    problem = CagingProblem("planar_arm", "circle", POSE, make_field("network", "planar_arm"))
    exact = CagingProblem(
        "planar_arm", "circle", POSE, make_field("grid", "planar_arm", method="marching")
    )
    rng = np.random.default_rng(0)
    start = rng.uniform(problem.lower, problem.upper)
    for name, optimiser in (
        ("CMA-ES", CmaEsConfiguration(iterations=iterations)),
        ("SQP", SqpConfiguration(restarts=restarts)),
    ):
        found = optimiser.solve(problem, seed=0, start=start)
        judged = exact.measure(found.posture[None])
        print(
            f"{name}: q = {np.round(found.posture, 2)} rad, {found.queries} queries, "
            f"T = {found.escape_time:.0f} s (exact {judged.escape_time[0]:.0f} s), feasible: "
            f"{judged.feasible[0]}"
        )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="small budgets")
    quick = parser.parse_args().quick
    main(1 if quick else 5, 5 if quick else 100)

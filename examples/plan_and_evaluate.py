"""Plan a push with two objectives, disturb both plans, and carry one over to MuJoCo.

Run it as `python examples/plan_and_evaluate.py`.
"""

import argparse
from pathlib import Path

from evaluation import evaluate, summarise
from planners import CmaEsPlanner, OpenLoopPolicy, Plan

ENV = "piec_envs/PlanarArmPush-v0"
PROTOCOLS = ("nominal", "disturbance-5mm", "dynamics-mujoco-start")
QUICK = {
    "iterations": 2,
    "restarts": 1,
    "survivors": 1,
    "robust_iterations": 1,
    "robust_samples": 2,
    "population": 8,
}


def main(budget: dict, episodes: int, folder: Path) -> None:
    """Plan, save, load, evaluate, print."""
    for objective in ("contact", "caging"):
        made = CmaEsPlanner(objective=objective, **budget).plan(ENV, seed=0)
        file = made.save(folder / f"{objective}.npz")
        plan = Plan.load(file)
        print(
            f"{objective}: ends {plan.nominal['goal_distance']:.3f} m from the goal without "
            f"noise; wrote {file}"
        )
        for protocol in PROTOCOLS:
            found = summarise(evaluate(OpenLoopPolicy(plan), ENV, protocol, episodes))
            print(
                f"  {protocol:22} {found['successes']:3d} of {found['n']:3d}, d2g "
                f"{found['d2g_mean']:.3f} m"
            )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="tiny budgets, which find nothing good"
    )
    parser.add_argument("--out", type=Path, default=Path("runs/examples"))
    args = parser.parse_args()
    main(QUICK if args.quick else {}, 2 if args.quick else 100, args.out)

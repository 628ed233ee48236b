"""Train a small PPO agent on the native VectorEnv, and execute it closed and open loop.

Run it as `python examples/train_an_agent.py`; it needs the extra `rl`. `piec train` does the same
with files.
"""

import argparse
from pathlib import Path

from evaluation import evaluate
from planners.sb3 import AgentPolicy, default_spec, open_loop, train

ENV = "piec_envs/PlanarArmPush-v0"
TINY = {"n_envs": 4, "n_steps": 5, "batch_size": 20}


def main(steps: int, hyper: dict, episodes: int, folder: Path) -> None:
    """Hyper-parameters come from the file that ships; a training that was stopped goes on."""
    spec = default_spec(ENV, "ppo", seed=0, steps=steps, hyper=hyper)
    agent = train(spec, folder)
    print(f"{agent.steps} actions in {agent.seconds:.0f} s; wrote {folder / 'agent.zip'}")
    for protocol in ("nominal-start", "disturbance-3mm-start"):
        for loop, policy in (("closed", AgentPolicy(agent)), ("open", open_loop(agent))):
            found = evaluate(policy, ENV, protocol, episodes)
            print(f"{protocol}, {loop} loop: {100 * found.success.mean():.0f} % succeed")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="an agent that has learned nothing")
    parser.add_argument("--out", type=Path, default=Path("runs/examples/ppo"))
    args = parser.parse_args()
    main(
        40 if args.quick else 1_000_000,
        TINY if args.quick else {},
        2 if args.quick else 100,
        args.out,
    )

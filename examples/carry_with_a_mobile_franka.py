"""Carry a cage with a mobile Franka, under noise and on another plant, and animate it.

Run it as `python examples/carry_with_a_mobile_franka.py`.

Without the extra `franka`, which brings the meshes, `--geometry capsules` does.
"""

import argparse
from pathlib import Path

import gymnasium as gym

from evaluation import evaluate
from evaluation.figures.animation import animation
from planners import OpenLoopPolicy, RigidCarry

ENV = "piec_envs/MobileFrankaPush-v0"


def main(env_kwargs: dict, episodes: int, every: int, out: Path) -> None:
    """The control that optimises nothing: from a caged start the base moves in a straight line."""
    policy = OpenLoopPolicy(RigidCarry().plan(ENV, start="cage", **env_kwargs))
    for protocol in ("disturbance-5mm", "shape-box_212-start"):
        found = evaluate(
            policy, ENV, protocol, episodes, env_kwargs={"start": "cage", **env_kwargs}
        )
        print(
            f"{protocol}: {100 * found.success.mean():.0f} % of {len(found.success)} in the goal "
            f"region"
        )
    env = gym.make(ENV, start="cage", disturbance=0.005, render_mode="rgb_array", **env_kwargs)
    observation, _ = env.reset(seed=0)
    frames = []
    done = False
    step = 0
    while not done:
        if step % every == 0:
            frames.append(env.render())
        action, _ = policy.predict(observation)
        observation, _, _, done, info = env.step(action)
        step += 1
    print(
        f"the object ends {info['goal_distance']:.3f} m from the goal; wrote "
        f"{animation(frames, out)}"
    )


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--geometry", default="meshes", choices=("meshes", "capsules"))
    parser.add_argument("--quick", action="store_true", help="few episodes and frames")
    parser.add_argument("--out", type=Path, default=Path("runs/examples/carry.gif"))
    args = parser.parse_args()
    field = {"escape_field": None} if args.quick else {}
    main(
        {"geometry": args.geometry, **field},
        2 if args.quick else 100,
        500 if args.quick else 20,
        args.out,
    )

"""Step one environment, then 256 rows of it at once, and change the plant under a policy.

Run it as `python examples/step_environments.py`.
"""

import argparse
import time

import gymnasium as gym
import numpy as np

from piec_envs import wrappers  # which registers the environments as well

ENV = "piec_envs/PlanarArmPush-v0"


def one_episode(steps: int) -> None:
    """Sweep the arm towards the object and see how the caging changes."""
    env = gym.make(ENV, start_noise=(0.01, 0.05))
    _, info = env.reset(seed=0)
    print(
        f"at the start: {info['escape_time']:.1f} s to escape, goal {info['goal_distance']:.2f} "
        f"m away"
    )
    for _ in range(steps):
        _, _, _, _, info = env.step(np.array([1.0, 0.2, 0.2, 0.2]))
    touching = np.flatnonzero(info["contact_links"]).tolist()
    print(f"after {steps} steps: caging {info['caging']:.2f}, links {touching} touch the object")


def many_rows(rows: int, steps: int) -> None:
    """The native VectorEnv: one batch in one process, row i equal to the single env with
    seed + i.
    """
    envs = gym.make_vec(ENV, num_envs=rows, start_noise=(0.01, 0.05))
    envs.reset(seed=0)
    rng = np.random.default_rng(0)
    begin = time.perf_counter()
    for _ in range(steps):
        _, reward, _, _, info = envs.step(rng.uniform(-1, 1, envs.action_space.shape))
    rate = rows * steps / (time.perf_counter() - begin)
    print(f"{rows} rows: {rate:,.0f} steps per second, mean reward {reward.mean():.3f}")
    print(f"least distance to the object of all rows: {1e3 * info['min_distance'].min():.1f} mm")


def other_plants(steps: int) -> None:
    """Wrappers and keyword arguments say the same; `get_params` tells what is in force."""
    slippery = wrappers.FrictionMismatch(gym.make(ENV), friction=0.1)
    engine = gym.make(ENV, dynamics="mujoco", object="square")
    for env in (slippery, engine):
        env.reset(seed=0)
        for _ in range(steps):
            _, _, _, _, info = env.step(np.array([1.0, 0.0, 0.0, 0.0]))
        params = env.unwrapped.get_params()
        shown = {name: params[name] for name in ("dynamics", "object", "friction")}
        print(f"{shown}: the object is {info['goal_distance']:.3f} m from the goal")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a few steps only")
    quick = parser.parse_args().quick
    one_episode(20 if quick else 120)
    many_rows(8 if quick else 256, 10 if quick else 500)
    other_plants(20 if quick else 250)

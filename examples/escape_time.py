"""Ask for the time that a point needs to escape from between the links, and draw the field.

Run it as `python examples/escape_time.py`.
"""

import argparse
from pathlib import Path

import gymnasium as gym
import imageio.v3 as imageio
import numpy as np

from piec_envs import make_field  # which registers the environments as well

POSTURE = np.array([0.92, -1.64, -1.66, -2.4])  # curled to the right, rad
POINTS = np.array([[0.3, 0.1], [0.8, -0.5]])  # between the links, and outside, m


def main(resolution: int, out: Path) -> None:
    """Exact and learned escape time of two points, with gradients and a picture."""
    grid = {"name": "grid", "resolution": resolution, "method": "marching"}
    exact = make_field(robot_name="planar_arm", **grid)
    for name, field in (("exact", exact), ("learned", make_field("network", "planar_arm"))):
        times, by_point, by_joint = field.gradients(POINTS, POSTURE)
        print(f"{name}: T = {np.round(times, 1)} s")
        print(
            f"  of the first point dT/dp = {np.round(by_point[0], 1)} s/m, dT/dq = "
            f"{np.round(by_joint[0], 1)} s/rad"
        )
    path = exact.escape_path(POINTS[0], POSTURE)
    print(f"its fastest way out is {np.hypot(*np.diff(path, axis=0).T).sum():.2f} m long")
    env = gym.make("piec_envs/PlanarArmPush-v0", escape_field=grid, render_mode="rgb_array")
    env.reset(options={"state": {"q_r": POSTURE, "pose": [*POINTS[0], 0.0]}})
    out.parent.mkdir(parents=True, exist_ok=True)
    imageio.imwrite(out, env.render())
    print(f"wrote {out}")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a coarse grid")
    parser.add_argument("--out", type=Path, default=Path("runs/examples/escape_time.png"))
    args = parser.parse_args()
    main(64 if args.quick else 200, args.out)

#!/usr/bin/env bash
# Gymnasium 1.4.0: RescaleAction can turn the largest valid action into one outside of the env's action space.
#
# Behaviour: the wrapper maps [-1, 1] to the env's Box by an affine function in the action's precision and does
# not clip. With float32 bounds the ends land one rounding step beyond the Box for about one bound in six, so
# that an env which checks its actions (`assert self.action_space.contains(action)`) refuses +1 or -1 of a
# policy, an action that the wrapped space itself contains.
# Seen: q6 of the Panda in float32, -0.0175 becomes -0.01750004; and of 4000 drawn ends, 705.
# ClipAction cannot go between the two: its action space is unbounded, which RescaleAction refuses.
# Way round: clip in the env.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PY'
import sys

import gymnasium as gym
import numpy as np
from gymnasium.wrappers import ClipAction, RescaleAction


class Echo(gym.Env):
    """Keeps the action that it is given."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))

    def __init__(self, low, high):
        self.action_space = gym.spaces.Box(np.float32([low]), np.float32([high]))

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        self.given = action
        return np.zeros(1, np.float32), 0.0, False, False, {}


def outside(bounds):
    """How many ends of these ranges leave the env's space, and the first of them."""
    count, first = 0, None
    for low, high in bounds:
        env = Echo(low, high)
        wrapped = RescaleAction(env, np.float32(-1.0), np.float32(1.0))
        wrapped.reset(seed=0)
        for end in wrapped.action_space.low, wrapped.action_space.high:
            assert wrapped.action_space.contains(end)
            wrapped.step(end)
            if not env.action_space.contains(env.given):
                count += 1
                first = first or f"[{env.action_space.low[0]!r}, {env.action_space.high[0]!r}] at {end[0]}: {env.given[0]!r}"
    return count, first


panda = [(-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698), (-2.8973, 2.8973),
         (-0.0175, 3.7525), (-2.8973, 2.8973)]
rng = np.random.default_rng(0)
drawn = [(rng.uniform(-3.0, 0.0), rng.uniform(0.01, 3.0)) for _ in range(2000)]
arm, many = outside(panda), outside(drawn)
try:
    RescaleAction(ClipAction(Echo(-1.0, 1.0)), np.float32(-1.0), np.float32(1.0))
    refused = ""
except ValueError as error:
    refused = str(error)
print(f"gymnasium {gym.__version__}")
print(f"Panda's ranges: {arm[0]} of 14 ends outside; first: {arm[1]}")
print(f"drawn ranges: {many[0]} of 4000 ends outside")
print(f"ClipAction in between: {refused or 'accepted'}")
sys.exit(0 if (arm[0], many[0]) == (1, 705) and refused else "the behaviour has changed")
PY

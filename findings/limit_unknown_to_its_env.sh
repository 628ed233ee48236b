#!/usr/bin/env bash
# Gymnasium 1.4.0: an env never learns the step limit under which gym.make puts it.
#
# Behaviour: `max_episode_steps`, registered or given to gym.make, goes to the TimeLimit wrapper alone. The spec
# that make leaves on `env.unwrapped.spec` says None, the outer `env.spec` says the limit. So an env cannot charge a
# cost that belongs to the end of an episode where TimeLimit ends it, nor tell a learner the time that is left.
# Seen: registered 7, asked for 3: TimeLimit truncates at 3, the outer spec says 3, the env's own says None.
# Way round: a keyword argument of the env itself for the limit, equal to the registered one.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PY'
import sys

import gymnasium as gym
import numpy as np


class Idle(gym.Env):
    """Never ends by itself."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, {}


gym.register("Idle-v0", Idle, max_episode_steps=7)
seen = []
for asked in {}, {"max_episode_steps": 3}:
    env = gym.make("Idle-v0", **asked)
    env.reset(seed=0)
    steps, truncated = 0, False
    while not truncated:
        truncated = env.step(env.action_space.sample())[3]
        steps += 1
    seen.append((steps, env.spec.max_episode_steps, env.unwrapped.spec.max_episode_steps))
print(f"gymnasium {gym.__version__}")
for steps, outer, inner in seen:
    print(f"truncated after {steps} steps; env.spec says {outer}, env.unwrapped.spec says {inner}")
sys.exit(0 if seen == [(7, 7, None), (3, 3, None)] else "the behaviour has changed")
PY

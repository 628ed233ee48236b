#!/usr/bin/env bash
# Gymnasium 1.4.0: a vector env batches NumPy's booleans in infos as arrays of objects.
#
# Behaviour: VectorEnv gathers the infos of its envs by key. A Python bool makes a bool array, a NumPy float or int an
# array of its type; an np.bool_, which any comparison of arrays gives, makes an array of dtype object with None in
# the rows that said nothing. `~info["caught"]` and masks of it then fail or index by objects, and converters
# to other array libraries refuse it.
# Seen: two envs, one step: bool -> bool, np.float64 -> float64, np.int64 -> int64, np.bool_ -> object.
# Way round: bool(...) around every flag put into an info.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check gymnasium==1.4.0 numpy==2.4.6
"$folder/venv/bin/python" - <<'PY'
import sys

import gymnasium as gym
import numpy as np

VALUES = {"bool": True, "np.float64": np.float64(0.5), "np.int64": np.int64(2), "np.bool_": np.bool_(True)}


class Telling(gym.Env):
    """Tells one value of each type."""

    observation_space = gym.spaces.Box(-1.0, 1.0, (1,))
    action_space = gym.spaces.Box(-1.0, 1.0, (1,))

    def reset(self, seed=None, options=None):
        super().reset(seed=seed)
        return np.zeros(1, np.float32), {}

    def step(self, action):
        return np.zeros(1, np.float32), 0.0, False, False, dict(VALUES)


envs = gym.vector.SyncVectorEnv([Telling, Telling])
envs.reset(seed=0)
info = envs.step(envs.action_space.sample())[4]
seen = {name: str(info[name].dtype) for name in VALUES}
print(f"gymnasium {gym.__version__}, numpy {np.__version__}")
for name, dtype in seen.items():
    print(f"{name} in the infos of two envs -> array of {dtype}")
expected = {"bool": "bool", "np.float64": "float64", "np.int64": "int64", "np.bool_": "object"}
sys.exit(0 if seen == expected else "the behaviour has changed")
PY

#!/usr/bin/env bash
# Gymnasium 1.4.0 with torch 2.13.0: NumpyToTorch on a vector env fails as soon as a row ends under SAME_STEP.
#
# Behaviour: with autoreset_mode SAME_STEP a vector env puts each ended row's last observation into
# info["final_obs"], an array of objects. The wrapper converts every array of the info, that one too, and DLPack knows
# no objects: BufferError in the middle of an episode batch. Under NEXT_STEP, the default, nothing of the kind is there.
# Seen: two CartPoles, always pushed to the right: NEXT_STEP goes on for 40 steps, SAME_STEP raises at the first end.
# Way round: NEXT_STEP, or convert outside of the wrapper what the algorithm needs.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet --disable-pip-version-check \
  gymnasium==1.4.0 numpy==2.4.6 torch==2.13.0 array-api-compat==1.16.0 packaging==26.3
"$folder/venv/bin/python" - <<'PY'
import sys

import gymnasium as gym
import torch
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers.vector import NumpyToTorch

seen = {}
for mode in AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP:
    envs = gym.make_vec("CartPole-v1", 2, vectorization_mode="sync", vector_kwargs={"autoreset_mode": mode})
    envs = NumpyToTorch(envs)
    envs.reset(seed=0)
    steps = 0
    try:
        for steps in range(1, 41):
            envs.step(torch.tensor([1, 1]))
        seen[mode.name] = "went on"
    except BufferError as error:
        seen[mode.name] = f"BufferError at step {steps}"
        print(error)
print(f"gymnasium {gym.__version__}, torch {torch.__version__}")
for name, what in seen.items():
    print(f"{name}: {what}")
sys.exit(0 if seen["NEXT_STEP"] == "went on" and seen["SAME_STEP"].startswith("BufferError") else "the behaviour has changed")
PY

"""Frames in space beside threads, forks and copies."""

from __future__ import annotations

import copy
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.env.registry import MOTIONS
from piec_envs.errors import RenderingError

ROOT = Path(__file__).resolve().parents[1]
PUSH = "piec_envs/PlanarArmPush-v0"
VECTOR = {"vectorization_mode": "vector_entry_point", "num_envs": 1}


def opened(maker=gym.make, env_id=PUSH, **options):
    """An env that has drawn a frame in space, and the frame."""
    field = {"escape_field": None if env_id in MOTIONS else "grid"}
    env = maker(env_id, render_mode="rgb_array", renderer="mujoco", **field, **options)
    env.reset(seed=0)
    try:
        return env, np.asarray(env.render())
    except RenderingError as error:
        pytest.skip(str(error))


def in_a_thread(function):
    """What a function returns or raises in another thread."""
    found = []

    def call():
        try:
            found.append(function())
        except BaseException as error:
            found.append(error)

    thread = threading.Thread(target=call)
    thread.start()
    thread.join()
    return found[0]


@pytest.mark.parametrize("env_id", [PUSH, "piec_envs/PlanarArmCage-v0"])
@pytest.mark.parametrize(
    ("maker", "more"), [(gym.make, {}), (gym.make_vec, VECTOR)], ids=["single", "native"]
)
def test_a_copy_of_an_env_that_drew_draws_the_same_by_itself(maker, more, env_id):
    env, frame = opened(maker, env_id, **more)
    for copied in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        assert np.array_equal(copied.render(), frame)
        copied.close()
    assert np.array_equal(env.render(), frame)  # closing a copy takes nothing from the env
    env.close()


def test_any_thread_may_draw_and_close():
    env, frame = opened()
    assert np.array_equal(in_a_thread(env.render), frame)
    assert np.array_equal(env.render(), frame)
    assert in_a_thread(env.close) is None
    env, frame = in_a_thread(opened)  # by a thread that is no more
    assert np.array_equal(env.render(), frame)
    env.close()
    assert np.array_equal(env.render(), frame)  # opens anew
    in_a_thread(env.render)
    env.close()


FORKED = f"""
import os, sys, gymnasium as gym, piec_envs
def make():
    env = gym.make("{PUSH}", render_mode="rgb_array", renderer="mujoco", escape_field=None)
    env.reset(seed=0)
    return env
env = make()
if "before" in sys.argv:
    env.render()
if "closed" in sys.argv:
    env.close()
child = os.fork()
if child == 0:
    for each in (env, make()):
        try:
            print(each.render().shape, flush=True)
        except Exception as error:
            print(type(error).__name__, "context='spawn'" in str(error), flush=True)
        each.close()
    sys.exit(0)
print("ended", os.waitpid(child, 0)[1], flush=True)
if "closed" not in sys.argv:
    print(env.render().shape)
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this platform has no forks")
@pytest.mark.parametrize(
    "when", [["before"], ["before", "closed"], []], ids=["drawn", "closed", "never drawn"]
)
def test_a_forked_process_draws_only_if_its_parent_did_not(when):
    opened()[0].close()  # no test where there is no OpenGL
    command = [sys.executable, "-c", FORKED, *when]
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, timeout=300)
    told = "RenderingError True" if when else "(720, 720, 3)"
    rest = [] if "closed" in when else ["(720, 720, 3)"]
    assert result.stdout.splitlines() == [told, told, "ended 0", *rest]
    assert result.returncode == 0 and "Error" not in result.stderr

"""MuJoCo beside the quasi-dynamic model, and beside a plain loop over its own step."""

from __future__ import annotations

import time
from functools import partial
from typing import Any

import numpy as np

from evaluation.bench.base import Row, Sizes, make_started, median_seconds, row
from piec_envs import CONTROL_PERIOD, Commands, Motion, Plant, QuasiDynamics


def mujoco_steps(sizes: Sizes) -> list[Row]:
    """The same motion as in `contact_step`, under MuJoCo with the object on a table: 50 engine
    steps in each step.
    """
    from piec_envs import MujocoDynamics  # loads MuJoCo

    rows = sizes.mujoco_rows
    steps = sizes.motion
    actions = np.random.default_rng(0).uniform(0.4, 0.6, (rows, steps, 4))
    _, state = make_started(escape_field=None)
    q_r, q_cmd, pose = (
        np.repeat(value, rows, axis=0) for value in (state.q_r, state.q_cmd, state.pose)
    )
    plant = Plant("planar_arm", ["circle"] * rows, np.full(rows, 0.5))
    seconds: dict[int, float] = {}
    for threads in (1, 2):
        begin = time.perf_counter()
        motion = MujocoDynamics(threads).rollout(q_r, q_cmd, pose, Commands(actions), plant)
        seconds[threads] = time.perf_counter() - begin
    quasi = median_seconds(
        partial(QuasiDynamics(threads=1).rollout, q_r, q_cmd, pose, Commands(actions), plant),
        min(sizes.repeats, 3),
    )
    loop = _plain_loop(motion) * rows
    share = 100 * motion.contact[:, 1:].any(axis=2).mean()
    batch = f"{rows} rollouts of {steps} steps"
    return [
        row(
            "MuJoCo rollouts, two threads",
            seconds[2],
            "s",
            "at most 40",
            f"{batch}, in contact {share:.0f} %",
        ),
        row("MuJoCo rollouts, gain of the second thread", seconds[1] / seconds[2], "times"),
        row(
            "MuJoCo control step",
            1e6 * seconds[1] / (rows * steps),
            "us",
            "",
            "one core, 50 steps of 2 ms",
        ),
        row("MuJoCo rollouts over a loop of mj_step", loop / seconds[1], "times", "", "one thread"),
        row("MuJoCo rollouts over a loop of mj_step, two threads", loop / seconds[2], "times"),
        row(
            "quasi-dynamic over MuJoCo",
            seconds[1] / quasi,
            "times",
            "at least 100",
            "control steps, per core",
        ),
    ]


def _plain_loop(motion: Motion) -> float:
    """Seconds for one row of a motion in a Python loop over `mj_step`."""
    import mujoco

    from piec_envs import mujoco_model

    model: Any = mujoco_model("planar_arm", "circle", 0.5)
    data = mujoco.MjData(model)
    steps = round(CONTROL_PERIOD / model.opt.timestep)
    x, y, angle = motion.pose[0, 0]
    data.qpos[:] = (
        *motion.q_r[0, 0],
        x,
        y,
        data.qpos[6],
        np.cos(angle / 2),
        0,
        0,
        np.sin(angle / 2),
    )
    begin = time.perf_counter()
    for command in motion.q_cmd[0, 1:]:
        data.ctrl[:] = command
        for _ in range(steps):
            mujoco.mj_step(model, data)
    return time.perf_counter() - begin

"""The page of each environment, written from what the environment is:
`python -m piec_envs.env.sheets docs/envs`.
"""

from __future__ import annotations

import dataclasses
import re
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from piec_envs.dynamics.protocol import CONTROL_PERIOD
from piec_envs.env.cage import CageConfig
from piec_envs.env.config import EnvConfig
from piec_envs.env.registry import ENVS, Entry
from piec_envs.files import replacing
from piec_envs.model.task import GOAL_RADIUS, REWARD_SCALE, TRACKING_TOLERANCE
from piec_envs.model.terms import TERMS
from piec_envs.world.robots import get_robot

OWN = {
    "dtype": ('"float64"', 'of the observations, "float64" or "float32".'),
    "render_mode": ("None", 'None or "rgb_array".'),
    "renderer": (
        '"drawing"',
        '"drawing", the plane in software, or "mujoco", in space through OpenGL.',
    ),
}
CHOICES = {
    "contact": 'which parts touch the object: "whole_arm", "link" (the last link and the gripper) '
    'or "point" (a sphere of radius 0.03 m at the fingertips); the others are only drawn.',
    "geometry": '"meshes", cross-sections of the robot\'s collision meshes, which the extra '
    '`franka` installs, or "capsules", which needs no extra.',
    "reference": '"right" or "left": the side of the straight line on which the reference runs.',
}
INFO = {
    "goal_distance": "from the object's centre to the goal, m",
    "d2g": "from the object's centre to the goal region, m; 0 inside",
    "min_distance": "signed distance of the nearest link to the object, m",
    "mean_distance": "mean signed distance of the links, m",
    "penetration": "depth of the deepest overlap, m",
    "cost_task": "task term of the stage cost",
    "cost_command": "command term of the stage cost",
    "cost_prior": "prior term of the stage cost",
    "tracking_error": "from the object's centre to the reference, m",
    "mean_tracking_error": "its mean over the episode, m",
    "is_success": "whether the episode would be a success if it ended here",
    "diverged": "whether the simulation has become unstable; the last good state stays",
    "link_distance": "signed distance of each link to the object, m",
    "contact_links": "whether each link touches the object",
    "escape_time": "escape time of the object, s",
    "caging": "0.02 times the escape time",
    "enclosed": "whether a key point cannot leave the workspace under a hard wall",
    "self_distance": "least distance of two links that could collide, m",
    "q_r": "joint positions, rad or m",
    "pose": "x, y (m) and angle (rad) of the object",
}


def sheet(entry: Entry) -> str:
    """The page of one environment in Markdown.

    Args:
        entry: row of the table of environments.

    Returns:
        The text, which says what the environment of that id does with its defaults.

    Raises:
        MissingDependencyError: if the robot's geometry is not installed.
    """
    env: Any = gym.make(entry.env_id, disable_env_checker=True).unwrapped
    _, info = env.reset(seed=0)
    sections = [
        f"# {entry.env_id}",
        f"{entry.summary}",
        f"![{entry.name}]({entry.name}.png)",
        "Written by `make sheets`; a test compares it with the environment.",
        _action(entry, env),
        _observation(entry, env),
        _reward(entry, env),
        _start_and_end(entry, env),
        _info(info),
        _arguments(entry),
        "## Versions\n\nv0: first version.",
    ]
    env.close()
    return "\n\n".join(sections) + "\n"


def _action(entry: Entry, env: Any) -> str:
    limits = "\n".join(
        f"| {joint.name} | {_unit(joint)} | {joint.lower:.4g} | {joint.upper:.4g} | "
        f"{joint.speed_limit:g} | "
        f"{joint.max_lead:g} |"
        for joint in get_robot(env.config.robot).joints
    )
    meaning = (
        f"commanded joint velocities over the speed; a step lasts {CONTROL_PERIOD:g} s, and the "
        f"command leads the "
        "joint by at most the lead."
        if entry.motion
        else "the posture, each joint from its lower (-1) to its upper (1) limit, taken at once."
    )
    table = (
        f"| joint | unit | lower | upper | speed, 1/s | lead |\n| --- | --- | --- | --- | "
        f"--- | --- |\n{limits}"
    )
    return f"## Action\n\n`{_box(env.action_space)}`: {meaning}\n\n{table}"


def _unit(joint: Any) -> str:
    return "rad" if joint.axis[2] else "m"


def _box(space: Any) -> str:
    bound = float(space.high.max())
    even = bool((space.high == bound).all() and (space.low == -bound).all())
    return (
        f"Box({-bound:g}, {bound:g}, {space.shape}, {space.dtype})"
        if even
        else f"Box({space.shape}, {space.dtype})"
    )


def _observation(entry: Entry, env: Any) -> str:
    rows = []
    high = env.observation_space.high
    if entry.motion:
        terms = {term.name: term for term in TERMS}
        for name, place in env.observation_layout.items():
            bound = ", ".join(f"{value:g}" for value in dict.fromkeys(high[place].tolist()))
            rows.append(
                (_entries(place), f"`{name}`", terms[name].meaning, terms[name].unit, bound)
            )
    else:
        for i, (meaning, unit) in enumerate(
            (
                ("object x", "m"),
                ("object y", "m"),
                ("cosine of its angle", ""),
                ("sine of its angle", ""),
            )
        ):
            rows.append((str(i), "", meaning, unit, f"{high[i]:g}"))
    lines = "\n".join(f"| {' | '.join(row)} |" for row in rows)
    extra = ""
    if entry.motion:
        extra = (
            "\n\nWith `goal_conditioned` a dict: `observation` as above, `achieved_goal` and "
            "`desired_goal`, the "
            "object's and the goal's x and y, m."
        )
    return (
        f"## Observation\n\n`{_box(env.observation_space)}`\n\n| entries | term | meaning | unit "
        f"| largest |\n"
        f"| --- | --- | --- | --- | --- |\n{lines}{extra}"
    )


def _entries(place: slice) -> str:
    return (
        str(place.start) if place.stop == place.start + 1 else f"{place.start} to {place.stop - 1}"
    )


def _reward(entry: Entry, env: Any) -> str:
    if not entry.motion:
        return (
            "## Reward\n\n0.02 (T_hat - 1e3 overlap): the caging less 20 for each metre of "
            "overlap, added up over each "
            "link with each shape of the object and each two links that could collide."
        )
    weights = env.model.weights
    task = (
        "the distance to the reference of this time"
        if env.model.task.tracks
        else "the squared distance to the goal"
    )
    return (
        f"## Reward\n\nMinus {REWARD_SCALE:g} times the stage cost {weights.task:g} c_task + "
        f"{weights.command:g} |u|^2 + "
        f"{weights.prior:g} c_prior, to which the last step adds {weights.miss:g} d2g. c_task is "
        f"{task}, u the "
        "commanded "
        "joint velocities, c_prior minus the caging (above "
        f"{weights.saturation:g} a tenth counts) or what `prior` says. With `goal_conditioned`: "
        f"-(d2g > 0), or "
        'minus the task term alone for "dense".'
    )


def _start_and_end(entry: Entry, env: Any) -> str:
    if not entry.motion:
        return (
            "## Start and end\n\nThe arm straight, which may overlap the object; the object "
            "drawn evenly from the ring "
            "around the base, within 0.4 m and clear of the base, at any angle. Option of "
            "`reset`: `pose`. The first "
            "step ends the episode (terminated). Success: the object is enclosed and nothing "
            "overlaps by more than "
            "1e-6 m; enclosed is judged under a hard wall by fast marching with 100 nodes a side."
        )
    task = env.model.task
    setup = env.model.setup
    x, y, angle = task.start
    tracking = (
        f" and a mean tracking error of at most {TRACKING_TOLERANCE:g} m over the episode"
        if task.tracks
        else ""
    )
    return (
        f"## Start and end\n\nThe object `{setup.plant.object}` at ({x:g}, {y:g}) m, turned by "
        f"{np.rad2deg(angle):g} "
        f"degrees; the arm at {np.round(setup.posture, 4).tolist()}. Options of `reset`: "
        f"`params` (plant parameters) "
        "and `state` (a `State`, or a dict of q_r, q_cmd, pose, step). Never terminated; "
        "truncated after "
        f"{env.episode_actions} actions, or once diverged. Success: d2g = 0 at the last "
        f"step{tracking}: the object's "
        f"centre within {GOAL_RADIUS:g} m of the goal {tuple(task.goal.tolist())}."
    )


def _info(info: dict[str, Any]) -> str:
    lines = "\n".join(
        f"| `{name}` | {_shape(value)} | {INFO[name]} |" for name, value in info.items()
    )
    return f"## Info\n\n| key | shape | meaning |\n| --- | --- | --- |\n{lines}"


def _shape(value: Any) -> str:
    return str(np.shape(value)) if np.ndim(value) else "()"


def _arguments(entry: Entry) -> str:
    config = EnvConfig if entry.motion else CageConfig
    told = _told(config)
    rows = [(name, f'"{default}"', CHOICES[name]) for name, default in entry.choices.items()]
    for item in dataclasses.fields(config):
        if item.name in ("task", "robot"):
            continue
        default = f'"{entry.object}"' if item.name == "object" and entry.object else _default(item)
        rows.append((item.name, default, told[item.name]))
    rows += [(name, default, meaning) for name, (default, meaning) in OWN.items()]
    lines = "\n".join(f"| `{name}` | {default} | {meaning} |" for name, default, meaning in rows)
    return f"## Arguments\n\n| keyword | default | meaning |\n| --- | --- | --- |\n{lines}"


def _default(item: dataclasses.Field) -> str:
    return f'"{item.default}"' if isinstance(item.default, str) else str(item.default)


def _told(config: type) -> dict[str, str]:
    """What docstrings say of each field, those of a base class included."""
    told: dict[str, str] = {}
    for kind in reversed(config.__mro__[:-1]):
        arguments = (kind.__doc__ or "").partition("Args:")[2].partition("Raises:")[0]
        for match in re.finditer(r"^ {8}(\w+): (.*?)(?=^ {8}\S|\Z)", arguments, re.M | re.S):
            told[match[1]] = re.sub(r"\s+", " ", match[2]).strip()
    return told


def write_sheets(folder: Path) -> list[Path]:
    """Write the page and the picture of every environment.

    Args:
        folder: where; made if need be.

    Returns:
        The pages.

    Raises:
        MissingDependencyError: if a robot's geometry is not installed.
    """
    from matplotlib.image import imsave

    folder.mkdir(parents=True, exist_ok=True)
    pages = []
    for entry in ENVS.values():
        env = gym.make(entry.env_id, render_mode="rgb_array")
        env.reset(seed=0)
        picture: Any = env.render()
        imsave(folder / f"{entry.name}.png", picture)
        env.close()
        page = folder / f"{entry.name}.md"
        with replacing(page) as file:
            file.write(sheet(entry).encode())
        pages.append(page)
    return pages


if __name__ == "__main__":
    write_sheets(Path(sys.argv[1]))

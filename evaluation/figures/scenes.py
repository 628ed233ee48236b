"""Figures of the plane: keyframes of plans, disturbed object paths, the escape-time field along a plan."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import (
    CAGING,
    GREY,
    MEAN,
    NOMINAL,
    Trajectory,
    bounds,
    colour_bar,
    figure_file,
    mix,
    mode_of,
    show_scene,
)
from piec_envs.escape.field import CAGING_SCALE, object_escape_time
from piec_envs.escape.speed import SpeedModel
from piec_envs.rendering.drawing import (
    GOAL,
    INK,
    base_position,
    draw_escape_path,
    draw_ghost,
    draw_goal,
    draw_object,
    draw_reference,
    draw_robot,
)
from piec_envs.rendering.field import FieldStyle, draw_field
from piec_envs.rendering.frame import picture_field

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

PANEL = 3.6  # width of a panel, inches
PATH_POINTS = 300  # of an object path in a figure


def keyframe_steps(trajectory: Trajectory, between: int = 2) -> list[int]:
    """Start, first contact, `between` steps between that and the end, and the end."""
    first = trajectory.first_contact or 0
    return sorted({0, *np.linspace(first, trajectory.steps, between + 2).astype(int).tolist()})


def draw_keyframes(ax: Axes, trajectory: Trajectory, steps: Sequence[int]) -> None:
    """Overlay robot and object at some steps, early ones faint, the last one full.

    Args:
        ax: where to draw.
        trajectory: the plan's execution.
        steps: in ascending order.
    """
    colour = mode_of(trajectory.mode).colour
    for rank, step in enumerate(steps[:-1]):
        age = (rank + 1) / len(steps)
        line = {"edgecolor": mix("white", INK, 0.25 + 0.35 * age), "linewidth": 0.6, "zorder": 2 + age}
        face = mix("white", GREY, 0.3 + 0.6 * age)
        draw_ghost(ax, trajectory.robot, trajectory.q_r[step], facecolor=face, alpha=0.5, **line)
        draw_object(ax, trajectory.object, trajectory.pose[step], alpha=0.25 + 0.3 * age, **{**line, "zorder": 3 + age})
    draw_robot(ax, trajectory.robot, trajectory.q_r[steps[-1]], facecolor=mix("white", colour, 0.3))
    draw_object(ax, trajectory.object, trajectory.pose[steps[-1]])
    _path(ax, trajectory.pose, color=INK, lw=1.1, ls=(0, (1, 1.2)), zorder=5.8)
    _task(ax, trajectory)


def _task(ax: Axes, trajectory: Trajectory) -> None:
    """The goal region, and the reference where there is one."""
    draw_goal(ax, trajectory.goal)
    if trajectory.reference is not None and len(trajectory.reference):
        draw_reference(ax, trajectory.reference, zorder=4.6)


def draw_disturbed(ax: Axes, trajectory: Trajectory, nominal: bool = True) -> None:
    """Draw disturbed object paths (thin, grey), their ends, their mean (red) and the nominal path (blue).

    Args:
        ax: where to draw.
        trajectory: with disturbed executions.
        nominal: whether to draw the mean and the nominal path.
    """
    if trajectory.disturbed is not None:
        from matplotlib.collections import LineCollection

        every = max(1, trajectory.steps // PATH_POINTS)
        paths = trajectory.disturbed[:, ::every, :2]
        ax.add_collection(LineCollection(list(paths), colors=GREY, linewidths=0.5, alpha=0.45, zorder=3), autolim=False)
        ends = trajectory.disturbed[:, -1]
        ax.scatter(ends[:, 0], ends[:, 1], s=5, color=INK, linewidths=0, alpha=0.6, zorder=7)
        if nominal:
            _path(ax, trajectory.disturbed.mean(axis=0), color=MEAN, lw=1.8, zorder=5)
    if nominal:
        _path(ax, trajectory.pose, color=NOMINAL, lw=1.8, ls=(0, (4, 1.5)), zorder=5.5)


def _path(ax: Axes, pose: np.ndarray, **style) -> None:
    ax.plot(pose[:, 0], pose[:, 1], **style)


def _title(ax: Axes, trajectory: Trajectory, note: str = "") -> None:
    """Name of the mode in its colour, and a note after it."""
    mode = mode_of(trajectory.mode)
    ax.set_title(mode.label, loc="left", color=mix(mode.colour, "black", 0.2), fontweight="bold")
    ax.set_title(note, loc="right", fontsize=8.5)


def _success_note(trajectory: Trajectory) -> str:
    """How many disturbed executions end in the goal region."""
    ended = trajectory.inside[:, -1]
    return f"{ended.sum()} of {len(ended)} in the goal"


def _panel_height(box: np.ndarray, width: float) -> float:
    """Height of a panel that shows a box with equal scales, inches."""
    (x_min, x_max), (y_min, y_max) = box
    return width * (y_max - y_min) / (x_max - x_min)


def keyframes(trajectories: Sequence[Trajectory], path: str | os.PathLike) -> Path:
    """One panel for each plan: overlaid keyframes, the object's path and the goal region.

    Args:
        trajectories: nominal executions.
        path: where to write the PNG.

    Returns:
        The path.
    """
    steps = [keyframe_steps(trajectory) for trajectory in trajectories]
    box = bounds([replace(trajectory, disturbed=None) for trajectory in trajectories], steps)
    with figure_file(path, PANEL * len(trajectories), _panel_height(box, PANEL) + 0.3) as figure:
        for ax, trajectory, shown in zip(np.ravel(figure.subplots(1, len(steps))), trajectories, steps, strict=True):
            draw_keyframes(ax, trajectory, shown)
            first = trajectory.first_contact
            _title(ax, trajectory, "" if first is None else f"first contact {trajectory.period * first:.0f} s")
            show_scene(ax, box)
    return Path(path)


def trajectories(plans: Sequence[Trajectory], path: str | os.PathLike) -> Path:
    """One panel for each plan: disturbed object paths, their mean, the nominal path, the robot at the end.

    Args:
        plans: executions with disturbed ones.
        path: where to write the PNG.

    Returns:
        The path.
    """
    box = bounds(plans, [[plan.steps] for plan in plans])
    legend = 0.6 if len(plans) > 1 else 0.95  # of two rows below one panel, which has no room for a row of all
    with figure_file(path, PANEL * len(plans), _panel_height(box, PANEL) + legend) as figure:
        axes = np.ravel(figure.subplots(1, len(plans)))
        for ax, plan in zip(axes, plans, strict=True):
            draw_ghost(ax, plan.robot, plan.q_r[-1], facecolor="#eceef2", edgecolor=mix("white", INK, 0.3), alpha=1.0)
            draw_object(ax, plan.object, plan.pose[0], alpha=0.5, zorder=2)
            draw_disturbed(ax, plan)
            _task(ax, plan)
            _title(ax, plan, _success_note(plan))
            show_scene(ax, box)
        _path_legend(figure, tracking=any(plan.reference is not None for plan in plans))
    return Path(path)


def _path_legend(figure: Figure, tracking: bool) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=NOMINAL, lw=1.8, ls=(0, (4, 1.5)), label="nominal"),
        Line2D([], [], color=GREY, lw=0.8, label="disturbed"),
        Line2D([], [], color=MEAN, lw=1.8, label="mean of the disturbed"),
    ]
    if tracking:
        handles.append(Line2D([], [], color=GOAL, lw=1.6, ls=(0, (4, 2)), label="reference"))
    columns = len(handles) if figure.get_figwidth() > PANEL else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def strip_steps(trajectory: Trajectory, count: int) -> list[int]:
    """Evenly spaced steps from the first contact (or the start) to the end."""
    return np.linspace(trajectory.first_contact or 0, trajectory.steps, count).astype(int).tolist()


def draw_field_panel(ax: Axes, trajectory: Trajectory, step: int, speed: SpeedModel | None = None) -> AxesImage:
    """Draw the escape-time field at one step with the object's fastest way out.

    Args:
        ax: where to draw.
        trajectory: the plan's execution.
        step: which step.
        speed: of the escaping object; None takes the default.

    Returns:
        The heat map, for a colour bar.
    """
    speed = speed or SpeedModel()
    q, pose = trajectory.q_r[step], trajectory.pose[step]
    field = picture_field(trajectory.robot_name, speed)
    image = draw_field(ax, trajectory.robot, q, field.solve(q), FieldStyle(speed, labels=False, line=0.6))
    draw_escape_path(ax, field.escape_path(pose[:2], q), linewidth=1.6)
    draw_robot(ax, trajectory.robot, q, None if trajectory.contact is None else trajectory.contact[step], linewidth=0.7)
    draw_object(ax, trajectory.object, pose, linewidth=0.8)
    draw_goal(ax, trajectory.goal, linewidth=1.4)
    caging = CAGING_SCALE * object_escape_time(field, trajectory.object.key_points, pose, q)
    ax.set_title(f"t = {trajectory.period * step:.0f} s    caging {caging:.2f}", fontsize=9)
    half = 1.02 * trajectory.robot.workspace_radius
    centre = base_position(trajectory.robot, q)
    show_scene(ax, np.stack([centre - half, centre + half], axis=1))
    return image


def field_strip(trajectory: Trajectory, path: str | os.PathLike, steps: Sequence[int] | None = None) -> Path:
    """The escape-time field and the fastest way out at several times of a plan.

    Args:
        trajectory: the plan's execution.
        path: where to write the PNG.
        steps: which steps; None takes four from the first contact to the end.

    Returns:
        The path.
    """
    shown = list(strip_steps(trajectory, 4) if steps is None else steps)
    side = 2.7
    with figure_file(path, side * len(shown) + 0.6, side + 0.25) as figure:
        axes = np.ravel(figure.subplots(1, len(shown)))
        images = [draw_field_panel(ax, trajectory, step) for ax, step in zip(axes, shown, strict=True)]
        colour_bar(figure, images[-1], axes, CAGING)
    return Path(path)


def overview(plans: Sequence[Trajectory], path: str | os.PathLike, strip: Trajectory | None = None) -> Path:
    """The hero picture: keyframes with disturbed object paths for each plan, the field of one of them below.

    Args:
        plans: executions with disturbed ones.
        path: where to write the PNG.
        strip: whose field to show at four times; None takes the last of `plans`.

    Returns:
        The path.
    """
    strip = strip or plans[-1]
    steps = [keyframe_steps(plan, between=1) for plan in plans]
    box = bounds(plans, steps)
    width, columns = PANEL * len(plans), 4
    top, bottom = _panel_height(box, PANEL) + 0.3, (width - 0.6) / columns + 0.3
    with figure_file(path, width, top + bottom) as figure:
        subfigures: Any = figure.subfigures(2, 1, height_ratios=[top, bottom])
        upper, lower = subfigures
        for ax, plan, shown in zip(np.ravel(upper.subplots(1, len(plans))), plans, steps, strict=True):
            draw_keyframes(ax, plan, shown)
            draw_disturbed(ax, plan, nominal=False)
            _title(ax, plan, _success_note(plan))
            show_scene(ax, box)
        axes = np.ravel(lower.subplots(1, columns))
        images = [draw_field_panel(ax, strip, s) for ax, s in zip(axes, strip_steps(strip, columns), strict=True)]
        colour_bar(lower, images[-1], axes, CAGING)
    return Path(path)

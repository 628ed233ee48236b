"""Figures of the plane: keyframes of plans, and disturbed object paths."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import GREY, MEAN, NOMINAL, figure_file, mix, panel_title, show_scene
from evaluation.figures.modes import mode_of
from evaluation.figures.strip import draw_strip, goal_handle, strip_steps
from evaluation.figures.trajectory import Trajectory, bounds
from piec_envs import rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D

# width of a panel with and without the space around it, inches
PANEL = 3.6
INNER = 3.4
PATH_POINTS = 300  # of an object path in a figure


def keyframe_steps(trajectory: Trajectory, between: int = 2) -> list[int]:
    """Start, first contact, some steps between that and the end, and the end.

    Args:
        trajectory: the plan's execution.
        between: how many steps after the first contact and before the end.

    Returns:
        Steps in ascending order, each once.
    """
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
        line = {
            "edgecolor": mix("white", rendering.INK, 0.25 + 0.35 * age),
            "linewidth": 0.6,
            "zorder": 2 + age,
        }
        face = mix("white", GREY, 0.3 + 0.6 * age)
        rendering.draw_ghost(
            ax, trajectory.robot, trajectory.q_r[step], facecolor=face, alpha=0.5, **line
        )
        rendering.draw_object(
            ax,
            trajectory.object,
            trajectory.pose[step],
            alpha=0.25 + 0.3 * age,
            **{**line, "zorder": 3 + age},
        )
    rendering.draw_robot(
        ax, trajectory.robot, trajectory.q_r[steps[-1]], facecolor=mix("white", colour, 0.3)
    )
    rendering.draw_object(ax, trajectory.object, trajectory.pose[steps[-1]])
    _path(ax, trajectory.pose, color=rendering.INK, lw=1.1, ls=(0, (1, 1.2)), zorder=5.8)
    _task(ax, trajectory)


def _task(ax: Axes, trajectory: Trajectory) -> None:
    """The goal region, and the reference where there is one."""
    rendering.draw_goal(ax, trajectory.goal)
    if trajectory.reference is not None and len(trajectory.reference):
        rendering.draw_reference(ax, trajectory.reference, zorder=4.6)


def draw_disturbed(ax: Axes, trajectory: Trajectory, nominal: bool = True) -> None:
    """Draw disturbed object paths (thin, grey), their ends, their mean (red) and the nominal path
    (blue).

    Args:
        ax: where to draw.
        trajectory: with disturbed executions.
        nominal: whether to draw the mean and the nominal path.
    """
    if trajectory.disturbed is not None:
        from matplotlib.collections import LineCollection

        every = max(1, trajectory.steps // PATH_POINTS)
        paths = trajectory.disturbed[:, ::every, :2]
        ax.add_collection(
            LineCollection(list(paths), colors=GREY, linewidths=0.5, alpha=0.45, zorder=3),
            autolim=False,
        )
        ends = trajectory.disturbed[:, -1]
        ax.scatter(
            ends[:, 0], ends[:, 1], s=5, color=rendering.INK, linewidths=0, alpha=0.6, zorder=7
        )
        if nominal:
            _path(ax, trajectory.disturbed.mean(axis=0), color=MEAN, lw=1.8, zorder=5)
    if nominal:
        _path(ax, trajectory.pose, color=NOMINAL, lw=1.8, ls=(0, (4, 1.5)), zorder=5.5)


def _path(ax: Axes, pose: np.ndarray, **style) -> None:
    ax.plot(pose[:, 0], pose[:, 1], **style)


def _title(ax: Axes, trajectory: Trajectory, note: str = "") -> None:
    """Name of the mode in its colour, and a note below it."""
    mode = mode_of(trajectory.mode)
    panel_title(ax, mode.label, note, mix(mode.colour, "black", 0.2))


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
    with figure_file(path, PANEL * len(trajectories), _panel_height(box, INNER) + 0.45) as figure:
        for ax, trajectory, shown in zip(
            np.ravel(figure.subplots(1, len(steps))), trajectories, steps, strict=True
        ):
            draw_keyframes(ax, trajectory, shown)
            first = trajectory.first_contact
            _title(
                ax,
                trajectory,
                "" if first is None else f"first contact {trajectory.period * first:.0f} s",
            )
            show_scene(ax, box)
    return Path(path)


def trajectories(plans: Sequence[Trajectory], path: str | os.PathLike) -> Path:
    """One panel for each plan: disturbed object paths, their mean, the nominal path, the robot at
    the end.

    Args:
        plans: executions with disturbed ones.
        path: where to write the PNG.

    Returns:
        The path.
    """
    box = bounds(plans, [[plan.steps] for plan in plans])
    # of two rows below one panel, which has no room for a row of all
    legend = 0.75 if len(plans) > 1 else 1.1
    with figure_file(path, PANEL * len(plans), _panel_height(box, INNER) + legend) as figure:
        axes = np.ravel(figure.subplots(1, len(plans)))
        for ax, plan in zip(axes, plans, strict=True):
            rendering.draw_ghost(
                ax,
                plan.robot,
                plan.q_r[-1],
                facecolor="#eceef2",
                edgecolor=mix("white", rendering.INK, 0.3),
                alpha=1.0,
            )
            rendering.draw_object(ax, plan.object, plan.pose[0], alpha=0.5, zorder=2)
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
        handles.append(
            Line2D([], [], color=rendering.GOAL, lw=1.6, ls=(0, (4, 2)), label="reference")
        )
    columns = len(handles) if figure.get_figwidth() > PANEL else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def overview(
    plans: Sequence[Trajectory], path: str | os.PathLike, strip: Trajectory | None = None
) -> Path:
    """The hero picture: keyframes with disturbed object paths for each plan, the field of one of
    them below.

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
    width = PANEL * len(plans)
    columns = 4
    top = _panel_height(box, INNER) + 0.75
    bottom = (width - 0.6) / columns + 0.75
    with figure_file(path, width, top + bottom) as figure:
        subfigures: Any = figure.subfigures(2, 1, height_ratios=[top, bottom])
        upper, lower = subfigures
        for ax, plan, shown in zip(
            np.ravel(upper.subplots(1, len(plans))), plans, steps, strict=True
        ):
            draw_keyframes(ax, plan, shown)
            draw_disturbed(ax, plan, nominal=False)
            _title(ax, plan, _success_note(plan))
            show_scene(ax, box)
        handles = _overview_handles()
        upper.legend(handles=handles, loc="outside lower center", ncols=len(handles))
        draw_strip(lower, strip, strip_steps(strip, columns))
    return Path(path)


def _overview_handles() -> list[Line2D]:
    """What the lines and dots of keyframes with disturbed paths mean."""
    from matplotlib.lines import Line2D

    return [
        Line2D(
            [],
            [],
            color=rendering.INK,
            lw=1.1,
            ls=(0, (1, 1.2)),
            label="object without disturbance",
        ),
        Line2D([], [], color=GREY, lw=0.8, label="disturbed"),
        Line2D([], [], color=rendering.INK, marker="o", ms=3, lw=0, label="where they end"),
        goal_handle(),
    ]

"""Keyframes in space: one row for each execution, one column for each time."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import figure_file, mix, show_scene
from evaluation.figures.modes import mode_of
from evaluation.figures.trajectory import Trajectory, bounds
from piec_envs import RenderingError, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

TIMES = (0.0, 33.0, 66.0, 100.0)  # s
# width of a panel and of the labels, inches
PANEL = 2.3
LABEL = 0.35
ASPECT = 0.75  # height of a picture over its width
DEPTH = 0.78  # of the plane that such a picture shows, over its width
# shift of what is looked at, over half of its width: objects are tall and stand at the back
RAISED = 0.09

Steps = Sequence[Sequence[int]]  # for each execution those to be shown


def space_keyframes(
    trajectories: Sequence[Trajectory], path: str | os.PathLike, times: Sequence[float] = TIMES
) -> Path:
    """Robot and object in space at some times, one row for each execution; a line shows the way of
    the object.

    Without OpenGL the same keyframes are drawn in the plane, and a warning says so.

    Args:
        trajectories: nominal executions, from top to bottom; where an object has loose bodies,
            `loose` says where they are.
        path: where to write the PNG.
        times: from left to right, s; those after an execution's end show its end.

    Returns:
        The path.
    """
    steps = [
        [min(round(time / each.period), each.steps) for time in times] for each in trajectories
    ]
    box = bounds([replace(each, disturbed=None) for each in trajectories], steps)
    pictures = _pictures(trajectories, steps, _view(box))
    aspect = ASPECT if pictures else float(np.ptp(box[1]) / np.ptp(box[0]))
    height = (aspect * PANEL + 0.05) * len(steps) + 0.25
    with figure_file(path, PANEL * len(times) + LABEL, height) as figure:
        axes = figure.subplots(len(steps), len(times), squeeze=False)
        for row, (trajectory, shown) in enumerate(zip(trajectories, steps, strict=True)):
            for column, (ax, step) in enumerate(zip(axes[row], shown, strict=True)):
                if pictures:
                    ax.imshow(pictures[row][column])
                    ax.set_axis_off()
                else:
                    _draw_flat(ax, trajectory, step)
                    show_scene(ax, box)
            _row_label(axes[row, 0], trajectory, [each.mode for each in trajectories])
        for ax, time in zip(axes[0], times, strict=True):
            ax.set_title(f"t = {time:g} s", fontsize=9)
    return Path(path)


def _view(box: np.ndarray) -> rendering.View:
    """What a picture of the box ((x, x), (y, y)) shows, m."""
    width, depth = np.ptp(box, axis=1)
    half = 0.5 * max(float(width), float(depth) / DEPTH)
    return rendering.View(box.mean(axis=1) + np.array([0.0, RAISED * half]), half)


def _pictures(
    trajectories: Sequence[Trajectory], steps: Steps, view: rendering.View
) -> list[list[np.ndarray]]:
    """Pictures in space, shape (height, width, 3) each; none where there is no OpenGL."""
    frames = rendering.SpaceFrames()
    try:
        return [
            [_picture(frames, trajectory, step, view) for step in shown]
            for trajectory, shown in zip(trajectories, steps, strict=True)
        ]
    except RenderingError as error:
        warnings.warn(f"keyframes are drawn in the plane: {error}", stacklevel=3)
        return []
    finally:
        frames.close()


def _picture(
    frames: rendering.SpaceFrames, trajectory: Trajectory, step: int, view: rendering.View
) -> np.ndarray:
    marks = rendering.task_marks(
        trajectory.goal, trajectory.reference, trajectory.pose[: step + 1, :2]
    )
    loose = None if trajectory.loose is None else trajectory.loose[step]
    q = trajectory.q_r[step]
    pose = trajectory.pose[step]
    picture = frames.scene(trajectory.robot, trajectory.object_name, q, pose, marks, view, loose)
    rows = len(picture)
    cut = round(0.5 * (1 - ASPECT) * rows)
    return picture[cut : rows - cut]


def _draw_flat(ax: Axes, trajectory: Trajectory, step: int) -> None:
    """The same keyframe in the plane."""
    touched = None if trajectory.contact is None else trajectory.contact[step]
    if trajectory.reference is not None and len(trajectory.reference):
        rendering.draw_reference(ax, trajectory.reference)
    if step > 0:
        rendering.draw_trail(ax, trajectory.pose[: step + 1, :2])
    rendering.draw_goal(ax, trajectory.goal, linewidth=1.2)
    rendering.draw_robot(ax, trajectory.robot, trajectory.q_r[step], touched, linewidth=0.7)
    if trajectory.loose is not None:
        rendering.draw_loose(ax, trajectory.object, trajectory.loose[step], linewidth=0.7)
    rendering.draw_object(ax, trajectory.object, trajectory.pose[step], linewidth=0.8)


def _row_label(ax: Axes, trajectory: Trajectory, among: Sequence[str]) -> None:
    """Name of an execution to the left of its row."""
    mode = mode_of(trajectory.mode, among)
    style: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "center", "fontweight": "bold"}
    colour = mix(mode.colour, "black", 0.2)
    ax.text(-0.03, 0.5, mode.label, transform=ax.transAxes, color=colour, **style)

"""The escape-time field along a plan, with the fastest ways out."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import CAGING, colour_bar, figure_file, show_scene
from evaluation.figures.trajectory import Trajectory
from piec_envs import rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D

SIDE = 2.7  # of a panel, inches
LEAST_WIDTH = 7.4  # of a strip: its legend in a row, inches


def strip_steps(trajectory: Trajectory, count: int) -> list[int]:
    """Evenly spaced steps from the first contact (or the start) to the end.

    Args:
        trajectory: the plan's execution.
        count: how many.

    Returns:
        Steps in ascending order.
    """
    return np.linspace(trajectory.first_contact or 0, trajectory.steps, count).astype(int).tolist()


def draw_field_panel(
    ax: Axes, trajectory: Trajectory, step: int, escape: rendering.Escape, top: float
) -> AxesImage:
    """Draw the escape-time field at one step with the object's fastest way out.

    Args:
        ax: where to draw.
        trajectory: the plan's execution.
        step: which step.
        escape: solved at that step.
        top: caging at the end of the colour scale.

    Returns:
        The heat map, for a colour bar.
    """
    q = trajectory.q_r[step]
    pose = trajectory.pose[step]
    image = rendering.draw_field(
        ax,
        trajectory.robot,
        q,
        escape.field_map,
        rendering.FieldStyle(labels=False, line=0.6, top=top),
    )
    rendering.draw_escape(ax, escape, linewidth=1.6)
    rendering.draw_robot(
        ax,
        trajectory.robot,
        q,
        None if trajectory.contact is None else trajectory.contact[step],
        linewidth=0.7,
    )
    rendering.draw_object(ax, trajectory.object, pose, linewidth=0.8)
    rendering.draw_goal(ax, trajectory.goal, linewidth=1.4)
    time = f"t = {trajectory.period * step:.0f} s"
    ax.set_title(f"{time},   caging {escape.caging:.2f}\n{rendering.caption(escape)}", fontsize=8.5)
    half = 1.02 * trajectory.robot.workspace_radius
    centre = rendering.base_position(trajectory.robot, q)
    show_scene(ax, np.stack([centre - half, centre + half], axis=1))
    return image


def draw_strip(figure: Any, trajectory: Trajectory, steps: Sequence[int]) -> None:
    """One panel of the field for each of some steps, with a colour bar and a legend of the ways
    out.

    Args:
        figure: or subfigure.
        trajectory: the plan's execution.
        steps: which steps.
    """
    at = [(trajectory.pose[step], trajectory.q_r[step]) for step in steps]
    escapes = [
        rendering.solve_escape(trajectory.robot_name, trajectory.object, pose, q) for pose, q in at
    ]
    top = rendering.field_top(escape.caging for escape in escapes)
    axes = np.ravel(figure.subplots(1, len(steps)))
    for ax, step, escape in zip(axes, steps, escapes, strict=True):
        image = draw_field_panel(ax, trajectory, step, escape, top)
    colour_bar(figure, image, axes, CAGING)
    handles = [*rendering.way_handles(escapes), goal_handle(), *_touched_handle(trajectory)]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=2.6)


def field_strip(
    trajectory: Trajectory, path: str | os.PathLike, steps: Sequence[int] | None = None
) -> Path:
    """The escape-time field and the fastest way out at several times of a plan.

    Args:
        trajectory: the plan's execution.
        path: where to write the PNG.
        steps: which steps; None takes four from the first contact to the end.

    Returns:
        The path.
    """
    shown = list(strip_steps(trajectory, 4) if steps is None else steps)
    with figure_file(path, max(SIDE * len(shown) + 0.6, LEAST_WIDTH), SIDE + 0.65) as figure:
        draw_strip(figure, trajectory, shown)
    return Path(path)


def goal_handle() -> Line2D:
    """A sample of the goal region for a legend."""
    from matplotlib.lines import Line2D

    return Line2D(
        [], [], marker="o", ms=7, mfc="none", mec=rendering.GOAL, mew=1.6, lw=0, label="goal region"
    )


def _touched_handle(trajectory: Trajectory) -> list[Line2D]:
    """A sample of a link in contact for a legend, where contacts are known."""
    from matplotlib.lines import Line2D

    style: dict[str, Any] = {
        "marker": "s",
        "ms": 7,
        "mfc": rendering.TOUCHED,
        "mec": rendering.INK,
        "mew": 0.7,
        "lw": 0,
    }
    return [] if trajectory.contact is None else [Line2D([], [], label="link in contact", **style)]

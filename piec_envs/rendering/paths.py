"""Paths and regions on a Matplotlib axis: ways out, trails, references, goal and workspace."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from piec_envs.model.task import GOAL_RADIUS
from piec_envs.rendering.colours import EDGE_OF_WORKSPACE, GOAL, INK, OBJECT, PATH
from piec_envs.rendering.drawing import draw_dot
from piec_envs.rendering.outlines import base_position
from piec_envs.world.robots import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_SMOOTH = np.array([1, 2, 3, 2, 1]) / 9


def draw_escape_path(ax: Axes, path: np.ndarray, **style: Any) -> None:
    """Draw a fastest escape path; the grid's zigzag is smoothed over five points.

    Args:
        ax: where to draw.
        path: shape (m, 2), m.
        style: properties of a Matplotlib line.
    """
    cased_line(ax, escape_line(path), **{"color": PATH, "linewidth": 2.0, "zorder": 7, **style})


def escape_line(path: np.ndarray) -> np.ndarray:
    """A fastest escape path without the grid's zigzag, smoothed over five points, shape (m,
    2), m.
    """
    if len(path) <= 4:
        return path
    padded = np.pad(path, ((2, 2), (0, 0)), mode="reflect", reflect_type="odd")
    return sliding_window_view(padded, 5, axis=0) @ _SMOOTH


def draw_trail(ax: Axes, trail: np.ndarray, **style: Any) -> None:
    """Draw where the object has been.

    Args:
        ax: where to draw.
        trail: shape (m, 2), m.
        style: properties of a Matplotlib line.
    """
    cased_line(ax, trail, **{"color": OBJECT, "linewidth": 1.6, "zorder": 5.5, **style})


def draw_reference(ax: Axes, reference: np.ndarray, **style: Any) -> None:
    """Draw the path to be tracked.

    Args:
        ax: where to draw.
        reference: shape (m, 2), m.
        style: properties of a Matplotlib line.
    """
    cased_line(
        ax,
        reference,
        **{"color": GOAL, "linewidth": 1.6, "linestyle": (0, (4, 2)), "zorder": 4.4, **style},
    )


def draw_workspace(ax: Axes, robot: Robot, q: np.ndarray) -> Any:
    """Draw the circle that an escaping object has to cross, dashed.

    Args:
        ax: where to draw.
        robot: gives the radius.
        q: joint positions, shape (n,), rad or m.

    Returns:
        The circle.
    """
    return draw_escape_circle(ax, base_position(robot, q), robot.workspace_radius)


def draw_escape_circle(ax: Axes, centre: np.ndarray, radius: float) -> Any:
    """Draw a circle that is to be crossed, dashed.

    Args:
        ax: where to draw.
        centre: shape (2,), m.
        radius: m.

    Returns:
        The circle.
    """
    from matplotlib.patches import Circle

    x, y = centre
    circle = Circle((x, y), radius, fill=False, edgecolor=EDGE_OF_WORKSPACE, lw=1.4, ls=(0, (6, 4)))
    circle.set_zorder(7)
    ax.add_artist(circle)
    return circle


def draw_goal(ax: Axes, goal: np.ndarray, radius: float = GOAL_RADIUS, **style: Any) -> None:
    """Draw the goal region.

    Args:
        ax: where to draw.
        goal: its centre, shape (2,), m.
        radius: m.
        style: properties of a Matplotlib patch.
    """
    draw_dot(
        ax,
        goal,
        radius,
        **{"facecolor": GOAL, "edgecolor": "none", "alpha": 0.4, "zorder": 3.5, **style},
    )
    draw_dot(
        ax,
        goal,
        radius,
        **{"facecolor": "none", "edgecolor": GOAL, "linewidth": 2.0, "zorder": 6.5, **style},
    )


def cased_line(ax: Axes, points: np.ndarray, **style: Any) -> None:
    """Draw a line with a thin dark rim, legible on light and dark ground.

    Args:
        ax: where to draw.
        points: shape (m, 2), m.
        style: properties of a Matplotlib line, "linewidth" among them.
    """
    style = {"solid_capstyle": "round", "path_effects": rim(style["linewidth"]), **style}
    ax.plot(points[:, 0], points[:, 1], **style)


def rim(linewidth: float) -> list[Any]:
    """Path effects that give a line of this width, points, its dark rim."""
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=linewidth + 1.2, foreground=INK, alpha=0.55), Normal()]

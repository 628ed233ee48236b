"""Frames of running episodes, drawn in software with Matplotlib's Agg canvas: no GL, no window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piec_envs.dynamics.protocol import CONTROL_PERIOD
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.escape.speed import SpeedModel
from piec_envs.rendering.colours import INK
from piec_envs.rendering.drawing import draw_key_points, draw_loose, draw_object, draw_robot
from piec_envs.rendering.escape import ENCLOSED, Escape, draw_escape, solve_escape
from piec_envs.rendering.field import FieldStyle, draw_field
from piec_envs.rendering.outlines import base_position
from piec_envs.rendering.paths import draw_goal, draw_reference, draw_trail, draw_workspace
from piec_envs.rendering.view import View, episode_view
from piec_envs.world.objects import Object, get_object
from piec_envs.world.robots import Robot, get_robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from piec_envs.model.caging_problem import Caged
    from piec_envs.model.model import Model
    from piec_envs.model.rollout import Measured
    from piec_envs.model.state import State

INCHES = 7.2  # side of the figure; line widths and fonts scale with the frame
# narrow, for the corner beside the workspace
SAID_ENCLOSED = ENCLOSED.replace(": ", ":\n").splitlines()
MARGIN = 1.03  # visible half-width over that of the view


def new_axis(size: int) -> tuple[Figure, Axes]:
    """A square figure of `size` pixels and an axis without frame that fills it."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure((INCHES, INCHES), dpi=size / INCHES, facecolor="white")
    FigureCanvasAgg(figure)
    ax = figure.add_axes((0, 0, 1, 1))
    ax.set_axis_off()
    ax.set_aspect("equal")
    return figure, ax


def pixels(figure: Figure) -> np.ndarray:
    """Draw a figure, shape (height, width, 3), uint8."""
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba())[..., :3].copy()  # type: ignore[attr-defined]


def render_frame(
    model: Model,
    state: State,
    measured: Measured,
    row: int,
    trail: np.ndarray | None = None,
    size: int = 720,
) -> np.ndarray:
    """Draw one of several states.

    Args:
        model: what simulates them.
        state: the states.
        measured: what is measured of them.
        row: which of them.
        trail: where its object has been, shape (m, 2), m.
        size: height and width, pixels.

    Returns:
        The picture, shape (size, size, 3), uint8; the same for the same state.
    """
    figure, ax = new_axis(size)
    robot = model.robot
    task = model.task
    q = state.q_r[row]
    pose = state.pose[row]
    item = get_object(state.params[row].object)
    enclosed = False
    if model.field is None:
        draw_workspace(ax, robot, q)
    else:
        enclosed = _draw_escape(
            ax, robot, item, pose, q, getattr(model.field, "speed", SpeedModel())
        ).enclosed
    if task.tracks:
        draw_reference(ax, task.reference)
    if trail is not None and len(trail) > 1:
        draw_trail(ax, trail)
    draw_goal(ax, task.goal)
    draw_robot(ax, robot, q, measured.contact[row])
    draw_loose(ax, item, state.loose_places(row))
    draw_object(ax, item, pose)
    caging = None if model.field is None else CAGING_SCALE * state.escape_time[row]
    _note(ax, _caption(state.step[row], measured.column("d2g")[row], caging, enclosed))
    _look_at(ax, episode_view(robot, q, task))
    return pixels(figure)


def _draw_escape(
    ax: Axes, robot: Robot, item: Object, pose: np.ndarray, q: np.ndarray, speed: SpeedModel
) -> Escape:
    """The field around a posture, and the fastest way out for an object."""
    escape = solve_escape(robot.name, item, pose, q, speed)
    draw_field(ax, robot, q, escape.field_map, FieldStyle(speed))
    draw_escape(ax, escape)
    return escape


def render_posture(caged: Caged, size: int = 720) -> np.ndarray:
    """Draw a posture of static caging, its field and the object's key points.

    Args:
        caged: the posture beside its object.
        size: height and width, pixels.

    Returns:
        The picture, shape (size, size, 3), uint8; the same for the same posture.
    """
    figure, ax = new_axis(size)
    robot = get_robot(caged.robot)
    item = get_object(caged.object)
    _draw_escape(ax, robot, item, caged.pose, caged.q_r, caged.speed)
    draw_robot(ax, robot, caged.q_r)
    draw_object(ax, item, caged.pose)
    draw_key_points(ax, item, caged.pose)
    words = (
        SAID_ENCLOSED if caged.enclosed else ["start" if caged.enclosed is None else "not enclosed"]
    )
    _note(ax, [*words, f"caging = {CAGING_SCALE * caged.escape_time:.2f}"])
    _look_at(ax, View(base_position(robot, caged.q_r), robot.workspace_radius))
    return pixels(figure)


def _caption(step: int, distance: float, caging: float | None, enclosed: bool) -> list[str]:
    """Time, caging and distance to the goal region, in lines."""
    told = [] if caging is None else [f"caging = {caging:.2f}"]
    return [
        f"t = {CONTROL_PERIOD * int(step):.1f} s",
        *told,
        f"d2g = {distance:.3f} m",
        *(SAID_ENCLOSED if enclosed else []),
    ]


def _note(ax: Axes, lines: list[str]) -> None:
    """Lines of text in the upper left corner."""
    style: dict[str, Any] = {
        "transform": ax.transAxes,
        "color": INK,
        "va": "top",
        "linespacing": 1.35,
    }
    ax.text(0.015, 0.985, "\n".join(lines), fontsize=11, **style)


def _look_at(ax: Axes, view: View) -> None:
    low = view.centre - MARGIN * view.half
    high = view.centre + MARGIN * view.half
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])

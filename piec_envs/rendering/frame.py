"""Frames of running episodes, drawn in software with Matplotlib's Agg canvas: no GL, no window."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from piec_envs.dynamics.base import CONTROL_PERIOD
from piec_envs.dynamics.free_bodies import places_of
from piec_envs.episodes.tasks import MEASURES
from piec_envs.escape.field import CAGING_SCALE
from piec_envs.escape.speed import SpeedModel
from piec_envs.rendering.drawing import (
    INK,
    base_position,
    draw_goal,
    draw_key_points,
    draw_loose,
    draw_object,
    draw_reference,
    draw_robot,
    draw_trail,
    draw_workspace,
)
from piec_envs.rendering.escape import ENCLOSED, Escape, draw_escape, solve_escape
from piec_envs.rendering.field import FieldStyle, draw_field
from piec_envs.rendering.view import View, episode_view
from piec_envs.world.objects import Object, get_object
from piec_envs.world.robots import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from piec_envs.episodes.batch import EpisodeBatch
    from piec_envs.episodes.cage import CageBatch

INCHES = 7.2  # side of the figure; line widths and fonts scale with the frame
SAID_ENCLOSED = ENCLOSED.replace(": ", ":\n").splitlines()  # narrow, for the corner beside the workspace
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


def render_frame(batch: EpisodeBatch, row: int, trail: np.ndarray | None = None, size: int = 720) -> np.ndarray:
    """Draw the present state of one episode.

    Args:
        batch: the episodes.
        row: which of them.
        trail: where its object has been, shape (m, 2), m.
        size: height and width, pixels.

    Returns:
        The picture, shape (size, size, 3), uint8; the same for the same state.
    """
    figure, ax = new_axis(size)
    q, pose = batch.state.q_r[row], batch.state.pose[row]
    item = get_object(batch.state.params[row].object)
    enclosed = False
    if batch.field is None:
        draw_workspace(ax, batch.robot, q)
    else:
        speed = getattr(batch.field, "speed", SpeedModel())
        enclosed = _draw_escape(ax, batch.robot, item, pose, q, speed).enclosed
    if batch.tracking:
        draw_reference(ax, batch.task.reference)
    if trail is not None and len(trail) > 1:
        draw_trail(ax, trail)
    draw_goal(ax, batch.task.goal)
    draw_robot(ax, batch.robot, q, batch.contact[row])
    draw_loose(ax, item, places_of(item, q, pose, batch.state.memory[row])[1:])
    draw_object(ax, item, pose)
    _caption(ax, batch, row, enclosed)
    _look_at(ax, episode_view(batch.robot, q, batch.task))
    return pixels(figure)


def _draw_escape(ax: Axes, robot: Robot, item: Object, pose: np.ndarray, q: np.ndarray, speed: SpeedModel) -> Escape:
    """The field around a posture, and the fastest way out for an object."""
    escape = solve_escape(robot.name, item, pose, q, speed)
    draw_field(ax, robot, q, escape.field_map, FieldStyle(speed))
    draw_escape(ax, escape)
    return escape


def render_posture(batch: CageBatch, row: int, size: int = 720) -> np.ndarray:
    """Draw the posture of one static caging episode, its field and the object's key points.

    Args:
        batch: the episodes.
        row: which of them.
        size: height and width, pixels.

    Returns:
        The picture, shape (size, size, 3), uint8; the same for the same posture.
    """
    figure, ax = new_axis(size)
    q, pose, item = batch.q_r[row], batch.pose[row], get_object(batch.config.object)
    _draw_escape(ax, batch.robot, item, pose, q, getattr(batch.field, "speed", SpeedModel()))
    draw_robot(ax, batch.robot, q)
    draw_object(ax, item, pose)
    draw_key_points(ax, item, pose)
    words = SAID_ENCLOSED if batch.enclosed[row] else ["not enclosed" if batch.done[row] else "start"]
    _note(ax, [*words, f"caging = {CAGING_SCALE * batch.escape_time[row]:.2f}"])
    _look_at(ax, View(base_position(batch.robot, q), batch.robot.workspace_radius))
    return pixels(figure)


def _caption(ax: Axes, batch: EpisodeBatch, row: int, enclosed: bool) -> None:
    """Time, caging and distance to the goal region in the upper left corner."""
    time = CONTROL_PERIOD * int(batch.state.step[row])
    distance = batch.measures[row, MEASURES.index("d2g")]
    lines = [f"t = {time:.1f} s", f"d2g = {distance:.3f} m"]
    if batch.field is not None:
        lines.insert(1, f"caging = {CAGING_SCALE * batch.state.escape_time[row]:.2f}")
    lines += SAID_ENCLOSED if enclosed else []
    _note(ax, lines)


def _note(ax: Axes, lines: list[str]) -> None:
    """Lines of text in the upper left corner."""
    style: dict[str, Any] = {"transform": ax.transAxes, "color": INK, "va": "top", "linespacing": 1.35}
    ax.text(0.015, 0.985, "\n".join(lines), fontsize=11, **style)


def _look_at(ax: Axes, view: View) -> None:
    low, high = view.centre - MARGIN * view.half, view.centre + MARGIN * view.half
    ax.set_xlim(low[0], high[0])
    ax.set_ylim(low[1], high[1])

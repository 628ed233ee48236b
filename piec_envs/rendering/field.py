"""The escape-time field as a picture: heat map, contours and the wall around the robot."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.ndimage import distance_transform_edt

from piec_envs.escape.field import CAGING_SCALE
from piec_envs.escape.protocol import FieldMap
from piec_envs.escape.speed import SpeedModel
from piec_envs.rendering.drawing import union_patch
from piec_envs.rendering.outlines import link_outlines
from piec_envs.rendering.paths import draw_workspace
from piec_envs.world.robots import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.image import AxesImage

WALL = "#9aa0ad"
# caging 0 to FIELD_TOP
FIELD_COLOURS = ("#cfd6ea", "#a3a6d3", "#8377b8", "#6a4a9b", "#4c2477", "#2a0f4a")
FIELD_TOP = 1.0  # caging at the end of the colour scale, at least
TOP_STEP = 0.2  # caging; that end goes up in such steps where captions go beyond it
CONTOUR_STEP = 0.1  # caging between two contours


@dataclass(frozen=True)
class FieldStyle:
    """How an escape-time field is drawn.

    Args:
        speed: its wall, d <= d0, is drawn around the robot.
        labels: whether contours carry their value.
        font: size of these labels, points.
        line: width of the contours, points.
        top: caging at the end of the colour scale.
    """

    speed: SpeedModel = field(default_factory=SpeedModel)
    labels: bool = True
    font: float = 7.5
    line: float = 0.7
    top: float = FIELD_TOP


def field_top(values: Iterable[float]) -> float:
    """The end of a colour scale that reaches up to all of these values of caging, inf left out."""
    highest = max((value for value in values if np.isfinite(value)), default=0.0)
    return max(FIELD_TOP, TOP_STEP * float(np.ceil(highest / TOP_STEP - 1e-9)))


@cache
def field_colours() -> Colormap:
    """The colour map of caging, light for free and dark for enclosed, of even lightness steps."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("caging", FIELD_COLOURS)


def draw_field(
    ax: Axes, robot: Robot, q: np.ndarray, field_map: FieldMap, style: FieldStyle | None = None
) -> AxesImage:
    """Draw caging = 0.02 T as a heat map with contours, the wall around the robot and the
    workspace.

    Args:
        ax: where to draw.
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        field_map: the solved configuration.
        style: wall and labels; None takes the defaults.

    Returns:
        The image, for a colour bar.
    """
    style = style or FieldStyle()
    x = field_map.x
    y = field_map.y
    caging = _filled(field_map, style.speed, style.top)
    levels = CONTOUR_STEP * np.arange(1, round(style.top / CONTOUR_STEP))
    scale: dict[str, Any] = {"cmap": field_colours(), "vmin": 0.0, "vmax": style.top}
    image = draw_nodes(ax, x, y, caging, interpolation="bilinear", **scale)
    circle = draw_workspace(ax, robot, q)
    image.set_clip_path(circle)
    lines = ax.contour(
        x, y, caging, levels=levels, colors="white", linewidths=style.line, alpha=0.85, zorder=2
    )
    lines.set_clip_path(circle)
    if style.labels:
        ax.clabel(
            lines, levels[1::2], fmt="%.1f", fontsize=style.font, inline_spacing=3, zorder=2.5
        )
    draw_wall(ax, robot, q, style.speed)
    return image


def draw_nodes(
    ax: Axes, x: np.ndarray, y: np.ndarray, values: np.ndarray, **style: Any
) -> AxesImage:
    """Draw values on the nodes of a grid as an image.

    Args:
        ax: where to draw.
        x: of the columns, evenly spaced, shape (N,), m.
        y: of the rows, evenly spaced, shape (N,), m.
        values: shape (N, N).
        style: properties of a Matplotlib image.

    Returns:
        The image, for a colour bar, say.
    """
    half = 0.5 * (x[1] - x[0])
    extent = (x[0] - half, x[-1] + half, y[0] - half, y[-1] + half)
    return ax.imshow(
        values, extent=extent, origin="lower", **{"interpolation": "nearest", "zorder": 1, **style}
    )


def draw_wall(ax: Axes, robot: Robot, q: np.ndarray, speed: SpeedModel) -> None:
    """Draw the wall, everything within d0 of the robot, as one even shape.

    Args:
        ax: where to draw.
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        speed: gives d0.
    """
    wall = [outline for link in link_outlines(robot, q, grow=speed.d0) for outline in link]
    ax.add_artist(union_patch(wall, facecolor=WALL, edgecolor="none", zorder=3))


def _filled(field_map: FieldMap, speed: SpeedModel, top: float = FIELD_TOP) -> np.ndarray:
    """Caging on the grid, carried on evenly into the wall, which hides it, so that contours run up
    to it.
    """
    wall = field_map.speed <= max(speed.leak, speed.floor) * speed.u_bar * (1 + 1e-9)  # (N, N)
    caging = CAGING_SCALE * np.where(np.isfinite(field_map.T), field_map.T, top / CAGING_SCALE)
    return np.minimum(carried_into_wall(caging, wall), top)


def carried_into_wall(values: np.ndarray, wall: np.ndarray) -> np.ndarray:
    """Values on a grid, those in the wall replaced by the nearest ones outside it.

    Args:
        values: shape (N, N), in any unit.
        wall: which nodes lie in the wall, shape (N, N).

    Returns:
        Shape (N, N); the values themselves where there is no wall.
    """
    if not wall.any():
        return values
    rows, columns = distance_transform_edt(wall, return_distances=False, return_indices=True)
    return values[rows, columns]

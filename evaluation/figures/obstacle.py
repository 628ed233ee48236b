"""Escape times around a fixed obstacle: the field with its level sets, and the speed map
beside it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import figure_file, show_scene
from piec_envs import FieldMap, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.contour import ContourSet
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

SIDE = 3.7  # of a panel, inches
LEVEL_STEP = 0.1  # between contours, s; every second one is labelled
# colours of speed 0 and of full speed
SLOW = "#4a3b78"
FAST = "#f4dc7c"
CAGED = "#b4b8c2"  # where nothing leads out


@dataclass(frozen=True, eq=False)
class ObstaclePanel:
    """A solved obstacle, one row of the figure.

    Args:
        title: what stands above it.
        field_map: escape time and speed.
        outlines: of the obstacle, its outer one first and its cavity's second, squares of shape (4,
            2), m.
        radius: of the escape circle around the origin, m.
        star: the point mass in the cavity, shape (2,), m.
        point: name and place, shape (2,), of a point outside, m.
        paths: fastest escape paths, each of shape (m, 2), m.
    """

    title: str
    field_map: FieldMap
    outlines: tuple[np.ndarray, np.ndarray]
    radius: float
    star: np.ndarray
    point: tuple[str, np.ndarray]
    paths: tuple[np.ndarray, ...]

    @property
    def time(self) -> np.ndarray:
        """T, carried on into the obstacle, which hides it, so that contours run up to it, shape (N,
        N), s.
        """
        lowest = self.field_map.speed.max() * (1 - 1e-9)
        return rendering.carried_into_wall(self.field_map.T, self.field_map.speed < lowest)

    @property
    def open(self) -> bool:
        """Whether a way leads out of everywhere."""
        return bool(np.isfinite(self.time).all())

    def walled(self, way: np.ndarray) -> np.ndarray:
        """Which points of a way, shape (m, 2), m, lie in the obstacle, by the node beside them,
        shape (m,).
        """
        x, y, _, speed = self.field_map
        j, i = (
            np.rint((way[:, k] - axis[0]) / (axis[1] - axis[0])).astype(int)
            for k, axis in enumerate((x, y))
        )
        return speed[i.clip(0, len(y) - 1), j.clip(0, len(x) - 1)] < speed.max() * (1 - 1e-9)

    @property
    def beside_star(self) -> np.ndarray:
        """Room for text in the cavity, across from the star, shape (2,), m."""
        return 2 * self.outlines[1].mean(axis=0) - self.star

    @property
    def longest(self) -> float:
        """Largest finite T outside the obstacle, s."""
        return float(self.time[np.isfinite(self.time)].max())


def escape_times(panels: Sequence[ObstaclePanel], path: str | os.PathLike) -> Path:
    """One row for each obstacle: its escape-time field, and its speed map.

    Args:
        panels: the solved obstacles, on one colour scale.
        path: where to write the PNG.

    Returns:
        The path.
    """
    top = LEVEL_STEP * np.ceil(max(panel.longest for panel in panels) / LEVEL_STEP)
    with figure_file(path, 2 * SIDE + 0.2, (SIDE + 0.3) * len(panels) + 0.75) as figure:
        rows: Any = figure.subplots(len(panels), 2, squeeze=False)
        for (left, right), panel in zip(rows, panels, strict=True):
            field = draw_time(left, panel, top)
            speed = draw_speed(right, panel)
            left.set_title(f"escape time T, {panel.title}")
            right.set_title(f"speed, {panel.title}")
        if any(panel.walled(way).any() for panel in panels for way in panel.paths):
            handles = [
                rendering.way_handle(rendering.FREE, dashed=False),
                rendering.way_handle(rendering.ENCLOSED, dashed=True),
            ]
            figure.legend(handles=handles, loc="outside lower center", ncols=2, handlelength=2.6)
        _bar(figure, field, rows[:, 0], "T [s]")
        _bar(figure, speed, rows[:, 1], "speed [m/s]")
    return Path(path)


def draw_time(ax: Axes, panel: ObstaclePanel, top: float) -> AxesImage:
    """Draw T with labelled contours, grey where nothing leads out.

    Args:
        ax: where to draw.
        panel: the solved obstacle.
        top: T at the end of the colour scale, s.

    Returns:
        The image, for a colour bar.
    """
    x = panel.field_map.x
    y = panel.field_map.y
    time = np.ma.masked_invalid(panel.time)
    colours = rendering.field_colours().with_extremes(bad=CAGED)
    image = _show(ax, panel, time, cmap=colours, vmin=0.0, vmax=top)
    levels = LEVEL_STEP * np.arange(1, round(top / LEVEL_STEP))
    lines = ax.contour(
        x, y, time, levels=levels, colors="white", linewidths=0.8, alpha=0.9, zorder=2
    )
    lines.set_clip_path(image.get_clip_path())
    _label(ax, panel, lines, levels)
    ring = _ring(panel, facecolor="white", edgecolor=rendering.INK, linewidth=1.0, zorder=3)
    ax.add_artist(ring)
    for way in panel.paths:
        walled = panel.walled(way)
        rendering.draw_way(ax, way, walled, bool(walled.any()), linewidth=2.2)
    _mark(ax, panel)
    if not panel.open:
        x_text, y_text = panel.beside_star
        ax.text(x_text, y_text, "T = ∞", ha="center", va="center", fontsize=9.5, zorder=8)
    _window(ax, panel)
    return image


def _label(ax: Axes, panel: ObstaclePanel, lines: ContourSet, levels: np.ndarray) -> None:
    """Values of every second contour, on the side away from the obstacle, and of one in the
    cavity.
    """
    away = -panel.outlines[0].mean(axis=0)
    away /= np.hypot(*away)
    style: dict[str, Any] = {"fmt": "%.1f", "fontsize": 7.5, "inline_spacing": 3, "zorder": 2.5}
    outside = [(panel.radius - level) * away for level in levels[1::2] if level < panel.radius]
    ax.clabel(lines, manual=outside, colors=rendering.INK, **style)
    if panel.open:
        ax.clabel(lines, manual=[panel.beside_star], colors="white", **style)


def draw_speed(ax: Axes, panel: ObstaclePanel) -> AxesImage:
    """Draw the speed map within the escape circle.

    Args:
        ax: where to draw.
        panel: gives the map and the wall.

    Returns:
        The image, for a colour bar.
    """
    from matplotlib.colors import LinearSegmentedColormap

    field_map = panel.field_map
    colours = LinearSegmentedColormap.from_list("speed", [SLOW, FAST])
    image = _show(
        ax, panel, field_map.speed, cmap=colours, vmin=0.0, vmax=float(field_map.speed.max())
    )
    ax.add_artist(_ring(panel, facecolor="none", edgecolor=rendering.INK, linewidth=0.8, zorder=3))
    # (2, 2) the outline's first side, along which the wall's speed stands
    side = panel.outlines[0][:2]
    x, y = 0.25 * (side + panel.outlines[1][:2]).sum(axis=0)
    turn = float(np.degrees(np.arctan2(*(side[1] - side[0])[::-1])))
    text: dict[str, Any] = {
        "ha": "center",
        "va": "center",
        "rotation": turn,
        "rotation_mode": "anchor",
        "zorder": 8,
    }
    ax.text(x, y, f"u = {field_map.speed.min():g}", color="white", fontsize=8, **text)
    ax.text(
        -0.5 * panel.radius,
        -0.5 * panel.radius,
        f"u = {field_map.speed.max():g}",
        fontsize=8,
        **{**text, "rotation": 0},
    )
    _mark(ax, panel)
    _window(ax, panel)
    return image


def _show(ax: Axes, panel: ObstaclePanel, values: np.ndarray, **style: Any) -> AxesImage:
    """An image over the grid, cut off at the escape circle, which is drawn as well."""
    image = rendering.draw_nodes(ax, panel.field_map.x, panel.field_map.y, values, **style)
    image.set_clip_path(rendering.draw_escape_circle(ax, np.zeros(2), panel.radius))
    return image


def _ring(panel: ObstaclePanel, **style: Any) -> Any:
    """The obstacle with its cavity left open."""
    outer, cavity = panel.outlines
    return rendering.union_patch([outer, cavity[::-1]], **style)


def _mark(ax: Axes, panel: ObstaclePanel) -> None:
    """The point mass as a star, and the point outside with its name."""
    name, (x, y) = panel.point
    ax.plot(
        *panel.star, marker="*", ms=15, mfc=rendering.OBJECT, mec=rendering.INK, mew=0.9, zorder=9
    )
    ax.plot(x, y, marker="o", ms=5.5, mfc="white", mec=rendering.INK, mew=1.0, zorder=9)
    ax.annotate(
        name, (x, y), (-4, -11), textcoords="offset points", fontsize=9, fontweight="bold", zorder=9
    )


def _window(ax: Axes, panel: ObstaclePanel) -> None:
    half = 1.03 * panel.radius
    show_scene(ax, np.array([[-half, half], [-half, half]]))


def _bar(figure: Figure, image: AxesImage, axes: np.ndarray, label: str) -> None:
    bar = figure.colorbar(
        image, ax=list(axes), location="bottom", panchor=False, shrink=0.7, aspect=32, pad=0.01
    )
    bar.set_label(label, fontsize=8.5)
    bar.outline.set_visible(False)

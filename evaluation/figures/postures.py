"""Figures of static caging: postures in their escape-time field, and the values that optimisers
reach.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import CAGING, colour_bar, figure_file, mix, panel_title, show_scene
from piec_envs import RenderingError, get_object, get_robot, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage
    from matplotlib.lines import Line2D

# of a panel; of a figure whose legend is a row, inches
SIDE = 3.3
LEAST_WIDTH = 5.8
COLUMNS = 4  # of the legend, at most
SERIES = ("#882255", "#3b7db8", "#44aa99", "#e69f00", "#555b6b")  # colours of methods


@dataclass(frozen=True, eq=False)
class PosturePanel:
    """One posture beside an object.

    Args:
        robot_name: row of the table of robots.
        object_name: row of the table of objects.
        pose: the object's x, y, angle, shape (3,), m and rad.
        q_r: joint positions, shape (n,), rad or m.
        label: what figures call it.
        enclosed: whether nothing leads out, where a record says so; None lets the field decide.
    """

    robot_name: str
    object_name: str
    pose: np.ndarray
    q_r: np.ndarray
    label: str
    enclosed: bool | None = None

    @property
    def escape(self) -> rendering.Escape:
        """The field, and the fastest way out."""
        item = get_object(self.object_name)
        escape = rendering.solve_escape(self.robot_name, item, self.pose, self.q_r)
        return escape if self.enclosed is None else replace(escape, enclosed=self.enclosed)


def draw_posture(
    ax: Axes, panel: PosturePanel, escape: rendering.Escape, top: float, close: bool = False
) -> AxesImage:
    """Draw a posture with the field's heat map and contours, the object and its key points.

    Args:
        ax: where to draw.
        panel: what to draw.
        escape: how its object gets out.
        top: caging at the end of the colour scale.
        close: whether to show the surroundings of robot and object alone.

    Returns:
        The heat map, for a colour bar.
    """
    robot = get_robot(panel.robot_name)
    item = get_object(panel.object_name)
    image = rendering.draw_field(
        ax,
        robot,
        panel.q_r,
        escape.field_map,
        rendering.FieldStyle(labels=False, line=0.6, top=top),
    )
    rendering.draw_escape(ax, escape, linewidth=1.6)
    rendering.draw_robot(ax, robot, panel.q_r, linewidth=0.8)
    rendering.draw_object(ax, item, panel.pose, linewidth=0.8)
    rendering.draw_key_points(ax, item, panel.pose, s=11)
    centre = rendering.base_position(robot, panel.q_r)
    half = 1.02 * robot.workspace_radius
    if close:
        centre, half = rendering.close_view(robot, panel.q_r, item, panel.pose)
    show_scene(ax, np.stack([centre - half, centre + half], axis=1))
    return image


def _draw_all(
    figure: Figure,
    axes: np.ndarray,
    rows: Sequence[Sequence[PosturePanel]],
    close: bool,
    named: bool,
) -> None:
    """Postures on one colour scale, with titles, a colour bar and a legend of the ways out.

    Args:
        figure: where they are.
        axes: one for each panel, shape (rows, columns).
        rows: the panels.
        close: whether to show the surroundings of robot and object alone.
        named: whether panels carry their labels.
    """
    panels = [panel for row in rows for panel in row]
    escapes = [panel.escape for panel in panels]
    top = rendering.field_top(escape.caging for escape in escapes)
    for ax, panel, escape in zip(np.ravel(axes), panels, escapes, strict=True):
        image = draw_posture(ax, panel, escape, top, close)
        word = "enclosed" if escape.enclosed else "open"
        panel_title(ax, panel.label if named else "", f"caging {escape.caging:.2f}, {word}")
    colour_bar(figure, image, axes, CAGING)
    handles = [*rendering.way_handles(escapes), _key_point_handle()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=2.6)


def _key_point_handle() -> Line2D:
    """A sample of a key point for a legend."""
    from matplotlib.lines import Line2D

    return Line2D(
        [],
        [],
        marker="o",
        ms=4,
        mfc=rendering.KEY_POINT,
        mec="white",
        lw=0,
        label="key point, where T is asked",
    )


def posture_row(panels: Sequence[PosturePanel], path: str | os.PathLike) -> Path:
    """Postures side by side with the whole workspace, such as a start and what optimisers make of
    it.

    Args:
        panels: from left to right.
        path: where to write the PNG.

    Returns:
        The path.
    """
    with figure_file(path, max(SIDE * len(panels) + 0.7, LEAST_WIDTH), SIDE + 0.75) as figure:
        axes = figure.subplots(1, len(panels), squeeze=False)
        _draw_all(figure, axes, [panels], close=False, named=True)
    return Path(path)


def posture_grid(rows: Sequence[Sequence[PosturePanel]], path: str | os.PathLike) -> Path:
    """Close views of postures, one row of panels for each method, one column for each object pose.

    Args:
        rows: panels, all rows of the same length.
        path: where to write the PNG.

    Returns:
        The path.
    """
    side = 0.8 * SIDE
    with figure_file(
        path, max(side * len(rows[0]) + 0.7, LEAST_WIDTH), (side + 0.25) * len(rows) + 0.3
    ) as figure:
        axes = figure.subplots(len(rows), len(rows[0]), squeeze=False)
        _draw_all(figure, axes, rows, close=True, named=False)
        for line, panels in zip(axes, rows, strict=True):
            name: Any = {
                "rotation": 90,
                "ha": "right",
                "va": "center",
                "fontweight": "bold",
                "fontsize": 10,
            }
            line[0].text(-0.02, 0.5, panels[0].label, transform=line[0].transAxes, **name)
    return Path(path)


def posture_scenes(panels: Sequence[PosturePanel], path: str | os.PathLike) -> Path:
    """Postures in space, and below each its field; without OpenGL the fields alone, and a warning.

    Args:
        panels: from left to right.
        path: where to write the PNG.

    Returns:
        The path.
    """
    scenes = _scenes(panels)
    height = SIDE * (1 + len(scenes) // len(panels)) + 0.75
    with figure_file(path, max(SIDE * len(panels) + 0.7, LEAST_WIDTH), height) as figure:
        axes = figure.subplots(1 + len(scenes) // len(panels), len(panels), squeeze=False)
        for ax, scene, panel in zip(axes[0], scenes, panels, strict=False):
            ax.imshow(scene)
            ax.set_axis_off()
            panel_title(ax, panel.label, "")
        _draw_all(figure, axes[-1:], [panels], close=True, named=not scenes)
    return Path(path)


def _scenes(panels: Sequence[PosturePanel]) -> list[np.ndarray]:
    """Pictures in space, one for each panel; none where there is no OpenGL."""
    frames = rendering.SpaceFrames()
    try:
        return [_scene(frames, panel) for panel in panels]
    except RenderingError as error:
        warnings.warn(f"postures are drawn in the plane alone: {error}", stacklevel=2)
        return []
    finally:
        frames.close()


def _scene(frames: rendering.SpaceFrames, panel: PosturePanel) -> np.ndarray:
    """A close picture of a posture in space."""
    robot = get_robot(panel.robot_name)
    item = get_object(panel.object_name)
    view = rendering.close_view(robot, panel.q_r, item, panel.pose)
    return frames.scene(robot, item.name, panel.q_r, panel.pose, view=view)


def value_dots(
    values: Mapping[str, Sequence[np.ndarray]], places: Sequence[str], path: str | os.PathLike
) -> Path:
    """Every result as a dot: filled where the object is enclosed, hollow where it can get out.

    Args:
        values: for each method and each place, caging and whether it encloses, shape (m, 2).
        places: their names.
        path: where to write the PNG.

    Returns:
        The path.
    """
    with figure_file(path, max(4.5, 1.5 * len(places) + 1.2), 3.1) as figure:
        ax = figure.subplots()
        width = 0.8 / len(values)
        for i, (label, groups) in enumerate(values.items()):
            colour = SERIES[i % len(SERIES)]
            for place, group in enumerate(groups):
                spread = width * 0.7 * (np.arange(len(group)) / max(1, len(group) - 1) - 0.5)
                x = place + (i - (len(values) - 1) / 2) * width + spread
                held = group[:, 1] > 0
                style: Any = {
                    "s": 20,
                    "linewidths": 1.0,
                    "edgecolors": mix(colour, "black", 0.1),
                    "zorder": 3,
                }
                ax.scatter(x[held], group[held, 0], facecolors=colour, **style)
                ax.scatter(x[~held], group[~held, 0], facecolors="white", **style)
            ax.scatter([], [], s=20, color=colour, label=label)
        ax.scatter([], [], s=20, facecolors="white", edgecolors="#5b6170", label="not enclosed")
        ax.set_xticks(range(len(places)), list(places))
        ax.set_ylabel("caging")
        ax.set_ylim(0.0, 1.06 * ax.get_ylim()[1])
        lines = -(-(len(values) + 1) // COLUMNS)  # rounded up
        figure.legend(loc="outside upper center", ncols=-(-(len(values) + 1) // lines))
    return Path(path)

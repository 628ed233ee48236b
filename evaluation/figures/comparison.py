"""Escape fields side by side: their contours, and the fastest way out of a point."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import CAGING, colour_bar, figure_file, show_scene
from evaluation.figures.fields import NEAR, ROW, SIDE, note, panels, view
from piec_envs import CAGING_SCALE, BatchedField, enclosed_points, get_robot, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

EXACT_WAY: dict[str, Any] = {"color": "white", "linewidth": 3.6, "alpha": 0.8, "zorder": 6.8}


def field_comparison(
    fields: Mapping[str, BatchedField],
    configurations: Sequence[np.ndarray],
    points: Sequence[np.ndarray],
    path: str | os.PathLike,
    near: float | None = NEAR,
) -> Path:
    """Rows of configurations, columns of fields: caging with contours, and the fastest way out of a
    point.

    Args:
        fields: by label, of one robot; the path of the first, the exact one, is drawn in all
            panels.
        configurations: joint positions, each of shape (n,), rad or m.
        points: the point in each configuration, each of shape (2,), m.
        path: where to write the PNG.
        near: half-width of panels around the robot, m; None shows all of the workspace.

    Returns:
        The path.
    """
    solved = [
        _solve_row(list(fields.values()), q, point)
        for q, point in zip(configurations, points, strict=True)
    ]
    top = rendering.field_top(escape.caging for row in solved for escape in row)
    with figure_file(path, SIDE * len(fields) + 0.7, ROW * len(configurations) + 0.65) as figure:
        axes = panels(figure, configurations, fields)
        for row, escapes, q, point in zip(axes, solved, configurations, points, strict=True):
            for ax, field, escape in zip(row, fields.values(), escapes, strict=True):
                way = None if escape is escapes[0] else escapes[0].way
                image = draw_comparison(ax, field, q, point, escape, top, way)
                show_scene(ax, view(get_robot(field.robot_name), q, near))
        colour_bar(figure, image, axes, CAGING)
        _way_legend(figure, [escape for row in solved for escape in row], len(fields) > 1)
    return Path(path)


def _solve_row(
    fields: Sequence[BatchedField], q: np.ndarray, point: np.ndarray
) -> list[rendering.Escape]:
    """How a point gets out of a posture by each of the fields; the first, the exact one, says
    whether it does.

    A point that lies in the wall itself is judged where that way first leaves it.
    """
    exact = fields[0]
    escapes = []
    for field in fields:
        way = field.escape_path(point, q)
        caging = CAGING_SCALE * float(field.query(np.reshape(point, (1, 2)), q)[0])
        escapes.append(
            rendering.Escape(field.solve(q), way, rendering.in_wall(field, way, q), False, caging)
        )
    way = escapes[0].way
    outside = way[[int(np.argmax(rendering.wall_depth(exact, way, q) < 0))]]  # (1, 2)
    held = bool(enclosed_points(exact.robot_name, outside, q, exact.speed)[0])
    return [replace(escape, enclosed=held) for escape in escapes]


def _way_legend(figure: Figure, escapes: Sequence[rendering.Escape], several: bool) -> None:
    """What the ways and the star mean."""
    from matplotlib.lines import Line2D

    star = Line2D(
        [],
        [],
        marker="*",
        ms=10,
        mfc=rendering.OBJECT,
        mec=rendering.INK,
        mew=0.8,
        lw=0,
        label="the point",
    )
    band = [
        Line2D(
            [],
            [],
            path_effects=rendering.rim(3.6),
            **{**EXACT_WAY, "alpha": 1.0},
            label="by the exact field",
        )
    ]
    handles = [star, *rendering.way_handles(escapes), *(band if several else [])]
    columns = len(handles) if several else 2
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=2.6)


def draw_comparison(
    ax: Axes,
    field: BatchedField,
    q: np.ndarray,
    point: np.ndarray,
    escape: rendering.Escape,
    top: float = rendering.FIELD_TOP,
    exact_way: np.ndarray | None = None,
) -> AxesImage:
    """Draw a field with its fastest way out of a point, and the exact one beneath as a pale band.

    Args:
        ax: where to draw.
        field: the field.
        q: joint positions, shape (n,), rad or m.
        point: shape (2,), m.
        escape: how it gets out by that field.
        top: caging at the end of the colour scale.
        exact_way: shape (m, 2), m; None draws none.

    Returns:
        The heat map, for a colour bar.
    """
    robot = get_robot(field.robot_name)
    image = rendering.draw_field(
        ax,
        robot,
        q,
        escape.field_map,
        rendering.FieldStyle(field.speed, labels=False, line=0.6, top=top),
    )
    rendering.draw_robot(ax, robot, q, linewidth=0.7)
    rendering.draw_escape(ax, escape, linewidth=1.6)
    if exact_way is not None:
        rendering.draw_escape_path(ax, exact_way, **EXACT_WAY)
    ax.plot(*point, marker="*", ms=11, mfc=rendering.OBJECT, mec=rendering.INK, mew=0.8, zorder=9)
    note(ax, f"caging {escape.caging:.3f}{', enclosed' if escape.enclosed else ''}")
    return image

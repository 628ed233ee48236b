"""Where escape fields differ from the exact one, side by side."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import colour_bar, figure_file, show_scene
from piec_envs import BatchedField, Robot, get_robot, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import Colormap
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

# width and height of a panel with its note, inches
SIDE = 2.5
ROW = 2.6
FREE = 0.05  # distance to the robot from which on errors count, m
# half-widths of views of the robot, m
NEAR = 0.75
NEARER = 0.5
ERROR_LIMIT = 5.0  # percent at the ends of the colour scale
# too short, exact, too long
ERROR_COLOURS = ("#1f4e8c", "#7fa6d1", "#f7f7f5", "#e6a06c", "#a3441c")


@dataclass(frozen=True, eq=False)
class RelativeError:
    """How far a field is from a reference field over the workspace of one configuration.

    Args:
        x: of the reference's nodes, shape (N,), m.
        y: of the reference's nodes, shape (N,), m.
        percent: 100 (T - T_ref) / T_ref, shape (N, N); 0 outside the workspace, not finite where a
            T is not.
        distance: to the robot, shape (N, N), m.
        counted: nodes in view, in the workspace, more than FREE from the robot, with finite times,
            shape (N, N).
    """

    x: np.ndarray
    y: np.ndarray
    percent: np.ndarray
    distance: np.ndarray
    counted: np.ndarray

    @classmethod
    def between(
        cls, reference: BatchedField, field: BatchedField, q: np.ndarray, near: float | None = None
    ) -> RelativeError:
        """Ask both fields at the nodes of the reference.

        Args:
            reference: what counts as true.
            field: what is compared with it.
            q: joint positions, shape (n,), rad or m.
            near: half-width of the view around the robot, m; None takes all of the workspace.

        Returns:
            The error at these nodes, and which of them count.
        """
        sampled, _ = reference.sample(np.asarray(q, dtype=float))
        x, y, *_ = reference.solve(q)
        nodes = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)  # (N * N, 2)
        exact, asked = (
            asked.query(nodes, q).reshape(len(y), len(x)) for asked in (reference, field)
        )
        with np.errstate(divide="ignore", invalid="ignore"):
            percent = np.where(exact > 0, 100 * (asked - exact) / exact, 0.0)
        low, high = view(get_robot(reference.robot_name), q, near).T  # (2,), (2,)
        shown = ((nodes >= low) & (nodes <= high)).all(axis=1).reshape(exact.shape)
        counted = shown & np.isfinite(percent) & (exact > 0) & (sampled.distance > FREE)
        return cls(x, y, percent, sampled.distance, counted)

    def percentile(self, share: float) -> float:
        """Percentile `share` (0 to 100) of the absolute error over the counted nodes, percent."""
        return float(np.percentile(np.abs(self.percent[self.counted]), share))

    @property
    def median(self) -> float:
        """Median of the absolute error over the counted nodes, percent."""
        return self.percentile(50)

    @property
    def p95(self) -> float:
        """95th percentile of the absolute error over the counted nodes, percent."""
        return self.percentile(95)

    @property
    def largest(self) -> float:
        """Largest absolute error over the counted nodes, percent: that of a cage, whose inside is a
        small part.
        """
        return self.percentile(100)


def view(robot: Robot, q: np.ndarray, near: float | None = None) -> np.ndarray:
    """The square part of the plane that a panel shows.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        near: half-width of a view around the middle of the robot, m; None shows all of the
            workspace.

    Returns:
        ((x_min, x_max), (y_min, y_max)), m.
    """
    if near is None:
        centre = rendering.base_position(robot, q)
        half = 1.02 * robot.workspace_radius
    else:
        # (m, 2)
        corners = np.concatenate(
            [outline for link in rendering.link_outlines(robot, q) for outline in link]
        )
        centre = 0.5 * (corners.min(axis=0) + corners.max(axis=0))
        half = near
    return np.stack([centre - half, centre + half], axis=1)


def error_map(
    reference: BatchedField,
    fields: Mapping[str, BatchedField],
    configurations: Sequence[np.ndarray],
    path: str | os.PathLike,
    near: float | None = NEARER,
) -> Path:
    """Rows of configurations, columns of fields: where and how far escape times are off.

    Args:
        reference: what counts as true; all fields are asked at its nodes.
        fields: by label, of one robot.
        configurations: joint positions, each of shape (n,), rad or m.
        path: where to write the PNG.
        near: half-width of panels around the robot, m; None shows all of the workspace.

    Returns:
        The path.
    """
    with figure_file(path, SIDE * len(fields) + 0.7, ROW * len(configurations) + 0.3) as figure:
        axes = panels(figure, configurations, fields)
        for row, q in zip(axes, configurations, strict=True):
            for ax, field in zip(row, fields.values(), strict=True):
                image = draw_error(
                    ax, RelativeError.between(reference, field, q, near), reference, q
                )
                show_scene(ax, view(get_robot(reference.robot_name), q, near))
        colour_bar(figure, image, axes, "error of T [%]", extend="both")
    return Path(path)


def draw_error(ax: Axes, error: RelativeError, reference: BatchedField, q: np.ndarray) -> AxesImage:
    """Draw a relative error with its median, 95th percentile and maximum.

    Args:
        ax: where to draw.
        error: of a field.
        reference: what it was compared with.
        q: joint positions, shape (n,), rad or m.

    Returns:
        The image, for a colour bar.
    """
    robot = get_robot(reference.robot_name)
    percent = rendering.carried_into_wall(error.percent, error.distance <= reference.speed.d0)
    scale: dict[str, Any] = {"cmap": _error_colours(), "vmin": -ERROR_LIMIT, "vmax": ERROR_LIMIT}
    image = rendering.draw_nodes(ax, error.x, error.y, np.ma.masked_invalid(percent), **scale)
    image.set_clip_path(rendering.draw_workspace(ax, robot, q))
    rendering.draw_wall(ax, robot, q, reference.speed)
    rendering.draw_robot(ax, robot, q, linewidth=0.7)
    values = {"median": error.median, "p95": error.p95, "max": error.largest}
    note(ax, "   ".join(f"{name} {_percent(value)}" for name, value in values.items()))
    return image


@cache
def _error_colours() -> Colormap:
    """Blue where escape times are too short, orange where too long, pale in between."""
    from matplotlib.colors import LinearSegmentedColormap

    return LinearSegmentedColormap.from_list("error", ERROR_COLOURS).with_extremes(
        bad=rendering.WALL
    )


def panels(figure: Figure, rows: Sequence[np.ndarray], labels: Mapping[str, Any]) -> np.ndarray:
    """A grid of axes, with titles over its first row.

    Args:
        figure: that gets them.
        rows: one for each row of the grid.
        labels: titles, one for each column.

    Returns:
        Axes, shape (rows, labels).
    """
    axes: Any = figure.subplots(len(rows), len(labels), squeeze=False)
    for ax, label in zip(axes[0], labels, strict=True):
        ax.set_title(label)
    return axes


def note(ax: Axes, text: str) -> None:
    """A small line under a panel, which has a height in the layout and no width.

    Args:
        ax: the panel.
        text: the line.
    """
    style: dict[str, Any] = {"transform": ax.transAxes, "ha": "center", "va": "top", "fontsize": 7}
    ax.text(0.5, -0.02, " ", **style)
    ax.text(0.5, -0.02, text, **style).set_in_layout(False)


def _percent(value: float) -> str:
    """About two digits: 12 %, 1.2 %, 0.12 %."""
    return (
        f"{value:.{0 if value >= 10 else 1 if value >= 1 else 2}f} %"
        if value >= 0.01
        else "< 0.01 %"
    )

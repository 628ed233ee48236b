"""The fastest way out of a posture as pictures show it: a free one, or, where there is none, the
one that leaks.

The wall around the robot leaks, so that T is finite everywhere and has a slope to descend. A
fastest way may therefore run through a link. Such a part is dashed, and so is the whole way of an
object that is enclosed: under a hard wall nothing leads out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from piec_envs.escape.base import BatchedField
from piec_envs.escape.between import distance_at
from piec_envs.escape.field import (
    CAGING_SCALE,
    enclosed_points,
    key_points_world,
    object_escape_time,
)
from piec_envs.escape.grid import GridField
from piec_envs.escape.protocol import FieldMap
from piec_envs.escape.speed import SpeedModel
from piec_envs.rendering.colours import PATH
from piec_envs.rendering.paths import cased_line, escape_line, rim
from piec_envs.world.objects import Object
from piec_envs.world.robots import get_robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.lines import Line2D

RESOLUTION = 100  # nodes a side of the field in a picture
FREE = "fastest way out"
ENCLOSED = "enclosed: no free way out"
LEAKS = "fastest through the wall, which leaks"
OPEN = "open"
LINE: dict[str, Any] = {"color": PATH, "linewidth": 2.0, "zorder": 7}
DASHED: dict[str, Any] = {"linestyle": (0, (2.2, 1.4)), "dash_capstyle": "butt"}
# cells of such a field by which a sampled way may dip into the wall and still passes beside it
GRAZE = 0.5


@dataclass(frozen=True, eq=False)
class Escape:
    """How an object gets out of a posture.

    Args:
        field_map: escape time over the workspace.
        way: fastest way out, shape (m, 2), m; a single point where nothing leads out at all.
        walled: whether each of its points lies in the wall, shape (m,).
        enclosed: whether nothing leads out under a hard wall.
        caging: 0.02 of the object's escape time.
    """

    field_map: FieldMap
    way: np.ndarray
    walled: np.ndarray
    enclosed: bool
    caging: float


@cache
def picture_field(robot_name: str, speed: SpeedModel) -> GridField:
    """The grid field that pictures show, whatever field the episode itself is measured by.

    Args:
        robot_name: a row of the table of robots.
        speed: largest speed as a function of the distance to the robot.

    Returns:
        The field, of second order, 100 nodes a side.
    """
    return GridField(robot_name, RESOLUTION, "marching", speed, threads=1)


def solve_escape(
    robot_name: str, item: Object, pose: np.ndarray, q: np.ndarray, speed: SpeedModel | None = None
) -> Escape:
    """The field of a posture and the fastest way out for an object.

    The way begins at the object's centre; where that alone is free, at a key point that is not. One
    enclosed key point holds the whole object.

    Args:
        robot_name: row of the table of robots.
        item: the object.
        pose: its x, y, angle, shape (3,), m, rad.
        q: joint positions, shape (n,), rad or m.
        speed: of the escaping object; None takes the default.

    Returns:
        The field, the way, and whether a hard wall lets the object out.
    """
    speed = speed or SpeedModel()
    field = picture_field(robot_name, speed)
    points = np.vstack([pose[:2], key_points_world(item.key_points, pose)])  # (1 + k, 2)
    held = enclosed_points(robot_name, points, q, speed)
    enclosed = bool(held[1:].any())
    start = points[held.argmax()] if enclosed else points[0]
    way = field.escape_path(start, q)
    caging = CAGING_SCALE * float(object_escape_time(field, item.key_points, pose, q))
    return Escape(field.solve(q), way, in_wall(field, way, q), enclosed, caging)


def wall_depth(field: BatchedField, way: np.ndarray, q: np.ndarray) -> np.ndarray:
    """How deep the points of a way lie in the wall around the robot, d0 - d.

    Args:
        field: whose wall, within d0 of the robot.
        way: shape (m, 2), m.
        q: joint positions, shape (n,), rad or m.

    Returns:
        Shape (m,), m.
    """
    sampled, base = field.sample(np.asarray(q, dtype=float))
    ends = sampled.start, sampled.start + sampled.h * (len(sampled.time) - 1)
    inner = np.clip(way - base, *ends)  # the last point may lie a rounding beyond the grid
    return field.speed.d0 - np.array([distance_at(sampled, x, y) for x, y in inner])


def in_wall(field: BatchedField, way: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Which points of a way lie in the wall; what only grazes its edge does not.

    Args:
        field, way, q: as in `wall_depth`.

    Returns:
        Shape (m,), bool.
    """
    depth = wall_depth(field, way, q)
    spacing = 2 * get_robot(field.robot_name).workspace_radius / RESOLUTION
    walled = depth >= 0
    for run in runs(walled):
        walled[run] &= depth[run].max() > GRAZE * spacing
    return walled


def runs(flags: np.ndarray) -> list[slice]:
    """Stretches of equal flags, one after the other, as slices of the array (m,)."""
    edges = [0, *(np.flatnonzero(np.diff(flags)) + 1).tolist(), len(flags)]
    return [slice(first, last) for first, last in pairwise(edges)]


# --- drawing -----------------------------------------------------------------------------------


def draw_way(ax: Axes, way: np.ndarray, walled: np.ndarray, enclosed: bool, **style: Any) -> None:
    """Draw a way out: a line where it is free, dashes in the wall and wherever the object is
    enclosed.

    Args:
        ax: where to draw.
        way: shape (m, 2), m.
        walled: which of its points lie in the wall, shape (m,).
        enclosed: whether it is no free way at all.
        style: properties of a Matplotlib line.
    """
    line = escape_line(way)
    dashed = np.ones(len(line), dtype=bool) if enclosed else walled
    for run in runs(dashed):
        first = max(run.start - 1, 0)  # joined to the stretch before
        kind = DASHED if dashed[run.start] else {}
        cased_line(ax, line[first : run.stop], **{**LINE, **kind, **style})


def draw_escape(ax: Axes, escape: Escape, **style: Any) -> None:
    """Draw the way out of a solved posture, as `draw_way` does.

    Args:
        ax: where to draw.
        escape: the posture's.
        style: properties of a Matplotlib line.
    """
    draw_way(ax, escape.way, escape.walled, escape.enclosed, **style)


def caption(escape: Escape) -> str:
    """What a caption says of a way out."""
    return ENCLOSED if escape.enclosed else LEAKS if escape.walled.any() else OPEN


def way_handles(escapes: Sequence[Escape]) -> list[Line2D]:
    """What a legend says of the ways of some postures, in a fixed order."""
    free = any(not escape.enclosed for escape in escapes)
    leaks = any(not escape.enclosed and escape.walled.any() for escape in escapes)
    held = any(escape.enclosed for escape in escapes)
    kinds = ((free, FREE, False), (leaks, LEAKS, True), (held, ENCLOSED, True))
    return [way_handle(label, dashed) for shown, label, dashed in kinds if shown]


def way_handle(label: str, dashed: bool) -> Line2D:
    """A sample of a way for a legend.

    Args:
        label: its text.
        dashed: whether it is drawn dashed.

    Returns:
        A line without points.
    """
    from matplotlib.lines import Line2D

    kind: dict[str, Any] = DASHED if dashed else {}
    return Line2D([], [], color=PATH, linewidth=1.8, path_effects=rim(1.8), label=label, **kind)

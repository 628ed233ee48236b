"""What pictures are made of: robot, object, paths and regions on a Matplotlib axis.

Matplotlib is imported where it is needed, so that importing the package stays quick, and only its
object-oriented side is used: no pyplot, no window, no global state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from piec_envs.dynamics.free_bodies import planar
from piec_envs.escape.field import key_points_world
from piec_envs.geometry.batched import robot_frames
from piec_envs.model.task import GOAL_RADIUS
from piec_envs.world.objects import Object
from piec_envs.world.robots import Robot
from piec_envs.world.shapes import RoundedPolygon

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path

INK = "#1d2230"  # outlines and text
LINK = "#e9ebef"
TOUCHED = "#e8849a"  # links in contact
OBJECT = "#f6c445"
LOOSE = "#b07a4f"  # bodies that come with an object
GOAL = "#1fa774"
KEY_POINT = "#d6252f"
PATH = "#4be3f2"  # fastest escape
EDGE_OF_WORKSPACE = "#d6453d"

PALE = 0.45  # opacity of parts that touch nothing
_SMOOTH = np.array([1, 2, 3, 2, 1]) / 9


# --- geometry ----------------------------------------------------------------------------------


def base_position(robot: Robot, q: np.ndarray) -> np.ndarray:
    """Centre of the workspace: where the joints that slide have moved the base, shape (2,), m."""
    return robot_frames(robot.name, q)[robot.base_dof, :2]


def _placed(shape: RoundedPolygon, frame: np.ndarray, grow: float = 0.0) -> np.ndarray:
    """Outline of a shape, grown by `grow` (m), in a frame (x, y, cos, sin), shape (m, 2)."""
    x, y, c, s = frame
    outline = RoundedPolygon(shape.vertices, shape.radius + grow).outline()
    return outline @ np.array([[c, s], [-s, c]]) + (x, y)


def _compound(outlines: Sequence[np.ndarray]) -> Path:
    """One path around all outlines: filled, they make a union."""
    from matplotlib.path import Path

    return Path.make_compound_path(
        *(Path(np.vstack([outline, outline[:1]]), closed=True) for outline in outlines)
    )


def union_patch(outlines: Sequence[np.ndarray], **style: Any) -> PathPatch:
    """A Matplotlib patch of the union of closed outlines, each of shape (m, 2), m."""
    from matplotlib.patches import PathPatch

    return PathPatch(_compound(outlines), **style)


def link_outlines(robot: Robot, q: np.ndarray, grow: float = 0.0) -> list[list[np.ndarray]]:
    """Outlines of every link's shapes in the world.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        grow: width of the band around them to include, m.

    Returns:
        For each link, for each of its shapes, points of shape (m, 2), m.
    """
    frames = robot_frames(robot.name, q)
    return [
        [_placed(shape, frames[link.frame], grow) for shape in link.shapes] for link in robot.links
    ]


def scenery_outlines(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Outlines of the parts that touch nothing, those without shapes left out, shape (m, 2) each,
    m.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
    """
    frames = robot_frames(robot.name, q)
    return [_placed(shape, frames[link.frame]) for link in robot.scenery for shape in link.shapes]


def arm_outlines(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Outlines of all that is drawn of a robot, shape (m, 2) each, m.

    Args:
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
    """
    return [
        *(outline for link in link_outlines(robot, q) for outline in link),
        *scenery_outlines(robot, q),
    ]


# --- bodies ------------------------------------------------------------------------------------


def draw_robot(
    ax: Axes, robot: Robot, q: np.ndarray, contact: Sequence[bool] | None = None, **style: Any
) -> None:
    """Draw the links of a robot and its joints as circles; parts that touch nothing are pale.

    Args:
        ax: where to draw.
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        contact: links to highlight, shape (links,).
        style: properties of a Matplotlib patch; `facecolor` is that of links without contact.
    """
    style = {"facecolor": LINK, "edgecolor": INK, "linewidth": 0.9, "zorder": 5, **style}
    _draw_scenery(ax, robot, q, **style)
    outlines = link_outlines(robot, q)
    touched = (
        np.zeros(len(outlines), dtype=bool) if contact is None else np.asarray(contact, dtype=bool)
    )
    for link in sorted(range(len(outlines)), key=lambda k: touched[k]):
        face = {"facecolor": TOUCHED} if touched[link] else {}
        ax.add_artist(union_patch(outlines[link], **{**style, **face}))
    frames = robot_frames(robot.name, q)
    reach = min(_half_width(robot), 0.05)
    pale = {"alpha": PALE} if robot.whole_name != robot.name else {}
    for j, joint in enumerate(robot.joints):
        if joint.axis[2] != 0:
            _dot(ax, frames[j + 1, :2], 0.42 * reach, **{**style, "facecolor": "white", **pale})
    _dot(ax, base_position(robot, q), 0.62 * reach, **{**style, "facecolor": style["edgecolor"]})


def _draw_scenery(ax: Axes, robot: Robot, q: np.ndarray, **style: Any) -> None:
    """The parts that touch nothing, paler than `style` and below it, as one shape of even
    transparency.
    """
    outlines = scenery_outlines(robot, q)
    if outlines:
        faded = {"alpha": PALE * (style.get("alpha") or 1.0), "zorder": style["zorder"] - 0.1}
        ax.add_artist(union_patch(outlines, **{**style, **faded}))


def draw_ghost(ax: Axes, robot: Robot, q: np.ndarray, **style: Any) -> None:
    """Draw a robot as one shape of even transparency, for overlaid keyframes.

    Args:
        ax: where to draw.
        robot: the robot.
        q: joint positions, shape (n,), rad or m.
        style: properties of a Matplotlib patch.
    """
    style = {"facecolor": LINK, "edgecolor": "none", "alpha": 0.4, "zorder": 4, **style}
    _draw_scenery(ax, robot, q, **style)
    ax.add_artist(
        union_patch([outline for link in link_outlines(robot, q) for outline in link], **style)
    )


def draw_object(ax: Axes, item: Object, pose: np.ndarray, **style: Any) -> None:
    """Draw an object, with a tick that shows its angle.

    Args:
        ax: where to draw.
        item: the object.
        pose: its x, y, angle, shape (3,), m, rad.
        style: properties of a Matplotlib patch.
    """
    style = {"facecolor": OBJECT, "edgecolor": INK, "linewidth": 1.1, "zorder": 6, **style}
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    frame = np.array([pose[0], pose[1], c, s])
    ax.add_artist(union_patch([_placed(shape, frame) for shape in item.shapes], **style))
    inner = 0.35 * item.bounding_radius
    outer = 0.75 * item.bounding_radius
    line: dict[str, Any] = {name: style.get(name) for name in ("linewidth", "alpha", "zorder")}
    ax.plot(
        pose[0] + c * np.array([inner, outer]),
        pose[1] + s * np.array([inner, outer]),
        color=INK,
        **line,
    )


def draw_loose(ax: Axes, item: Object, places: np.ndarray, **style: Any) -> None:
    """Draw the loose bodies of an object.

    Args:
        ax: where to draw.
        item: the object.
        places: position and quaternion of each, shape (k, 7).
        style: properties of a Matplotlib patch.
    """
    style = {"facecolor": LOOSE, "edgecolor": INK, "linewidth": 0.9, "zorder": 5.8, **style}
    for body, (x, y, angle) in zip(item.loose, planar(places, np.zeros(len(places))), strict=True):
        frame = np.array([x, y, np.cos(angle), np.sin(angle)])
        ax.add_artist(union_patch([_placed(shape, frame) for shape in body.shapes], **style))


def draw_key_points(ax: Axes, item: Object, pose: np.ndarray, **style: Any) -> None:
    """Draw the key points of an object, where its escape time is asked, as dots."""
    points = key_points_world(item.key_points, pose)  # (k, 2)
    style = {
        "s": 16,
        "color": KEY_POINT,
        "edgecolors": "white",
        "linewidths": 0.6,
        "zorder": 8,
        **style,
    }
    ax.scatter(points[:, 0], points[:, 1], **style)


def _half_width(robot: Robot) -> float:
    """Radius of the thinnest rounded part of the arm, m; 0.05 for sharp ones."""
    # a small tip makes no thin arm
    parts = [link for link in robot.scenery if link.shapes] or robot.links
    return min(
        (shape.radius for link in parts for shape in link.shapes if shape.radius > 0), default=0.05
    )


def _dot(ax: Axes, centre: np.ndarray, radius: float, **style: Any) -> None:
    from matplotlib.patches import Circle

    ax.add_artist(Circle((float(centre[0]), float(centre[1])), radius, **style))


# --- paths and regions -------------------------------------------------------------------------


def draw_escape_path(ax: Axes, path: np.ndarray, **style: Any) -> None:
    """Draw a fastest escape path, shape (m, 2), m; the grid's zigzag is smoothed over five
    points.
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
    """Draw where the object has been, shape (m, 2), m."""
    cased_line(ax, trail, **{"color": OBJECT, "linewidth": 1.6, "zorder": 5.5, **style})


def draw_reference(ax: Axes, reference: np.ndarray, **style: Any) -> None:
    """Draw the path to be tracked, shape (m, 2), m."""
    cased_line(
        ax,
        reference,
        **{"color": GOAL, "linewidth": 1.6, "linestyle": (0, (4, 2)), "zorder": 4.4, **style},
    )


def draw_workspace(ax: Axes, robot: Robot, q: np.ndarray) -> Any:
    """Draw the circle that an escaping object has to cross, dashed, and return it."""
    return draw_escape_circle(ax, base_position(robot, q), robot.workspace_radius)


def draw_escape_circle(ax: Axes, centre: np.ndarray, radius: float) -> Any:
    """Draw a circle that is to be crossed, dashed, around `centre`, shape (2,), m, and
    return it.
    """
    from matplotlib.patches import Circle

    x, y = centre
    circle = Circle((x, y), radius, fill=False, edgecolor=EDGE_OF_WORKSPACE, lw=1.4, ls=(0, (6, 4)))
    circle.set_zorder(7)
    ax.add_artist(circle)
    return circle


def draw_goal(ax: Axes, goal: np.ndarray, radius: float = GOAL_RADIUS, **style: Any) -> None:
    """Draw the goal region around `goal`, shape (2,), m."""
    _dot(
        ax,
        goal,
        radius,
        **{"facecolor": GOAL, "edgecolor": "none", "alpha": 0.4, "zorder": 3.5, **style},
    )
    _dot(
        ax,
        goal,
        radius,
        **{"facecolor": "none", "edgecolor": GOAL, "linewidth": 2.0, "zorder": 6.5, **style},
    )


def cased_line(ax: Axes, points: np.ndarray, **style: Any) -> None:
    """Draw a line, shape (m, 2), m, with a thin dark rim, legible on light and dark ground."""
    style = {"solid_capstyle": "round", "path_effects": rim(style["linewidth"]), **style}
    ax.plot(points[:, 0], points[:, 1], **style)


def rim(linewidth: float) -> list[Any]:
    """Path effects that give a line of this width, points, its dark rim."""
    from matplotlib.patheffects import Normal, Stroke

    return [Stroke(linewidth=linewidth + 1.2, foreground=INK, alpha=0.55), Normal()]

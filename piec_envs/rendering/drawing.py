"""Robots and objects on a Matplotlib axis.

Matplotlib is imported where it is needed, so that importing the package stays quick, and only its
object-oriented side is used: no pyplot, no window, no global state.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from piec_envs.dynamics.free_bodies import planar
from piec_envs.escape.field import key_points_world
from piec_envs.geometry.batched import robot_frames
from piec_envs.rendering.colours import INK, KEY_POINT, LINK, LOOSE, OBJECT, PALE, TOUCHED
from piec_envs.rendering.outlines import base_position, link_outlines, placed, scenery_outlines
from piec_envs.world.objects import Object
from piec_envs.world.robots import Robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.patches import PathPatch
    from matplotlib.path import Path


def _compound(outlines: Sequence[np.ndarray]) -> Path:
    """One path around all outlines: filled, they make a union."""
    from matplotlib.path import Path

    return Path.make_compound_path(
        *(Path(np.vstack([outline, outline[:1]]), closed=True) for outline in outlines)
    )


def union_patch(outlines: Sequence[np.ndarray], **style: Any) -> PathPatch:
    """A Matplotlib patch of the union of closed outlines.

    Args:
        outlines: each of shape (m, 2), m.
        style: properties of a Matplotlib patch.

    Returns:
        The patch.
    """
    from matplotlib.patches import PathPatch

    return PathPatch(_compound(outlines), **style)


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
            draw_dot(ax, frames[j + 1, :2], 0.42 * reach, **{**style, "facecolor": "white", **pale})
    draw_dot(
        ax, base_position(robot, q), 0.62 * reach, **{**style, "facecolor": style["edgecolor"]}
    )


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
    ax.add_artist(union_patch([placed(shape, frame) for shape in item.shapes], **style))
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
        ax.add_artist(union_patch([placed(shape, frame) for shape in body.shapes], **style))


def draw_key_points(ax: Axes, item: Object, pose: np.ndarray, **style: Any) -> None:
    """Draw the key points of an object, where its escape time is asked, as dots.

    Args:
        ax: where to draw.
        item: the object.
        pose: its x, y, angle, shape (3,), m, rad.
        style: properties of a Matplotlib scatter plot.
    """
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


def draw_dot(ax: Axes, centre: np.ndarray, radius: float, **style: Any) -> None:
    """Draw a circle that is filled.

    Args:
        ax: where to draw.
        centre: shape (2,), m.
        radius: m.
        style: properties of a Matplotlib patch.
    """
    from matplotlib.patches import Circle

    ax.add_artist(Circle((float(centre[0]), float(centre[1])), radius, **style))

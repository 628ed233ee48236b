"""Figures of plans under another plant than was planned for: object paths, and how simplified a
shape is.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import GREY, MEAN, NOMINAL, figure_file, mix, show_scene
from evaluation.figures.modes import mode_of
from evaluation.figures.trajectory import Trajectory, bounds
from evaluation.shape_mismatch import shape_mismatch
from piec_envs import GOAL_RADIUS, Object, get_object, rendering, trace_surface

if TYPE_CHECKING:
    from matplotlib.axes import Axes

PANEL = 3.3  # width of a panel, inches
# width and height of an entry of the legend, inches
ENTRY = 1.25
LINE = 0.22
FAR = 0.2  # m from the goal; objects that end beyond it are not looked at closely
EXECUTED = (MEAN, "#f08a24", "#7a4fb5", "#2b2f3a", "#c05a9d")
DASHES = ((0, (4, 1.6)), (0, (2.2, 1.4)), (0, (6, 1.6, 1.2, 1.6)), (0, (1.2, 1.2)), (0, (8, 2)))
PLANNED = "#f28e1c"  # the simplified shape
SHIFT = "#2f6fb7"  # contact displacement
TURN = "#1d8f4e"  # normal error
SAMPLES = 721  # directions of an outline


@dataclass(frozen=True, eq=False)
class Executed:
    """One execution of a plan under another plant.

    Args:
        label: what the legend calls the plant.
        object_name: row of the table of objects.
        pose: object x, y, angle, shape (N + 1, 3), m and rad.
    """

    label: str
    object_name: str
    pose: np.ndarray


def mismatch_paths(
    plans: Sequence[Trajectory], executed: Sequence[Sequence[Executed]], path: str | os.PathLike
) -> Path:
    """One column for each plan, the whole way above and its end below.

    The nominal path is solid and blue, executed ones are dashed (one alone: red), the goal is
    green; objects at the end have their true shapes.

    Args:
        plans: nominal executions.
        executed: for each plan its executions under other plants, the same plants for each.
        path: where to write the PNG.

    Returns:
        The path.
    """
    pairs = list(zip(plans, executed, strict=True))
    shown = [replace(plan, disturbed=np.stack([run.pose for run in runs])) for plan, runs in pairs]
    whole = bounds(shown, [[plan.steps] for plan in plans])
    end = end_box(pairs)
    heights = [PANEL * float(np.ptp(box[1]) / np.ptp(box[0])) for box in (whole, end)]
    handles = _path_handles([run.label for run in executed[0]])
    columns = min(len(handles), int(PANEL * len(plans) / ENTRY))
    lines = -(-len(handles) // columns)
    with figure_file(path, PANEL * len(plans), sum(heights) + 0.53 + LINE * lines) as figure:
        axes = figure.subplots(2, len(plans), height_ratios=heights, squeeze=False)
        for (above, below), (plan, runs) in zip(axes.T, pairs, strict=True):
            mode = mode_of(plan.mode)
            above.set_title(
                mode.label, loc="left", color=mix(mode.colour, "black", 0.2), fontweight="bold"
            )
            for ax, box in ((above, whole), (below, end)):
                _draw_paths(ax, plan, runs)
                show_scene(ax, box)
            _frame(above, end)
            _frame(below, end)
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=2.6)
    return Path(path)


def end_box(
    pairs: Sequence[tuple[Trajectory, Sequence[Executed]]], margin: float = 0.03
) -> np.ndarray:
    """Box around the goal regions and all objects that end near them, at least as wide as high.

    Args:
        pairs: nominal executions, each with its executions under other plants.
        margin: space around it, m.

    Returns:
        ((x_min, x_max), (y_min, y_max)), m.
    """
    points = []
    for plan, runs in pairs:
        ends = [
            (plan.object, plan.pose[-1]),
            *((get_object(run.object_name), run.pose[-1]) for run in runs),
        ]
        points += [
            _placed(item, end).T for item, end in ends if np.hypot(*(end[:2] - plan.goal)) < FAR
        ]
        points += [plan.goal[None] + shift for shift in (-GOAL_RADIUS, GOAL_RADIUS)]
    cloud = np.concatenate(points)  # (m, 2)
    # NaN parts shapes
    box = np.stack([np.nanmin(cloud, axis=0) - margin, np.nanmax(cloud, axis=0) + margin], axis=1)
    missing = max(0.0, float(np.ptp(box[1]) - np.ptp(box[0])))
    box[0] += 0.5 * missing * np.array([-1, 1])
    return box


def _draw_paths(ax: Axes, plan: Trajectory, runs: Sequence[Executed]) -> None:
    """The arm and the objects at the end, the planned object at the start, and all object paths."""
    rendering.draw_ghost(
        ax,
        plan.robot,
        plan.q_r[-1],
        facecolor="#eceef2",
        edgecolor=mix("white", rendering.INK, 0.3),
        alpha=1.0,
    )
    rendering.draw_object(ax, plan.object, plan.pose[0], alpha=0.35, zorder=2)
    rendering.draw_goal(ax, plan.goal)
    ax.plot(plan.pose[:, 0], plan.pose[:, 1], color=mix(NOMINAL, "white", 0.25), lw=3.2, zorder=5)
    ax.plot(
        *_placed(plan.object, plan.pose[-1]), color=mix(NOMINAL, "white", 0.25), lw=2.4, zorder=6
    )
    ax.plot(*plan.pose[-1, :2], color=NOMINAL, marker="o", ms=6, zorder=6.7)
    for rank, run in enumerate(runs):
        colour, dashes = _style(rank)
        ax.plot(run.pose[:, 0], run.pose[:, 1], color=colour, lw=1.3, ls=dashes, zorder=5.5)
        ax.plot(
            *_placed(get_object(run.object_name), run.pose[-1]),
            color=colour,
            lw=1.3,
            ls=dashes,
            zorder=6.2,
        )
        ax.plot(*run.pose[-1, :2], color=colour, marker="o", ms=4, zorder=6.8)


def _placed(item: Object, pose: np.ndarray) -> np.ndarray:
    """Outline of an object at a pose (x, y, angle), shape (2, m), m."""
    c = np.cos(pose[2])
    s = np.sin(pose[2])
    return np.array([[c, -s], [s, c]]) @ _outline(item) + pose[:2, None]


def _frame(ax: Axes, box: np.ndarray) -> None:
    """A thin frame around the box that is shown below."""
    (x_min, x_max), (y_min, y_max) = box
    x = [x_min, x_max, x_max, x_min, x_min]
    y = [y_min, y_min, y_max, y_max, y_min]
    ax.plot(x, y, color=GREY, lw=0.8, zorder=7, clip_on=False)


def _style(rank: int) -> tuple[str, Any]:
    return EXECUTED[rank % len(EXECUTED)], DASHES[rank % len(DASHES)]


def _path_handles(labels: Sequence[str]) -> list:
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], color=mix(NOMINAL, "white", 0.25), lw=3.2, label="nominal")]
    for rank, label in enumerate(labels):
        colour, dashes = _style(rank)
        handles.append(Line2D([], [], color=colour, lw=1.3, ls=dashes, label=label))
    goal = Line2D(
        [],
        [],
        color=rendering.GOAL,
        marker="o",
        ms=8,
        mfc=mix(rendering.GOAL, "white", 0.6),
        lw=0,
        label="goal region",
    )
    return [*handles, goal]


def shape_mismatches(planned: Object, true: Sequence[Object], path: str | os.PathLike) -> Path:
    """One panel for each true shape: the planned one orange, its outline black, and where it is
    most wrong.

    A blue segment shows the largest displacement of the contact point, a green arc the largest
    error of the surface normal.

    Args:
        planned: the object that is planned for.
        true: those that are there.
        path: where to write the PNG.

    Returns:
        The path.
    """
    reach = max(item.bounding_radius for item in (planned, *true))
    with figure_file(path, 2.4 * len(true), 2.2 + 0.8) as figure:
        for ax, item in zip(np.ravel(figure.subplots(1, len(true))), true, strict=True):
            _draw_mismatch(ax, planned, item)
            show_scene(ax, reach * np.array([[-1.3, 1.1], [-1.1, 1.1]]))
        handles = _mismatch_handles(planned.name)
        columns = len(handles) if len(true) > 2 else 2
        figure.legend(handles=handles, loc="outside lower center", ncols=columns, handlelength=1.6)
    return Path(path)


def _draw_mismatch(ax: Axes, planned: Object, true: Object) -> None:
    """One panel of `shape_mismatches`."""
    mismatch = shape_mismatch(planned.shapes, true.shapes)
    ax.fill(
        *_outline(planned),
        facecolor=mix(rendering.OBJECT, "white", 0.55),
        edgecolor=PLANNED,
        lw=1.6,
    )
    ax.plot(*_outline(true), color=rendering.INK, lw=1.3)
    (shift, moved) = mismatch.worst_displacement
    (turn, turned) = mismatch.worst_normal_error
    ends = _points(planned, moved[0]), _points(true, moved[0])
    ax.plot(*np.column_stack([end[0] for end in ends]), color=SHIFT, lw=2.6, zorder=4)
    # Of the directions in which the normal is most wrong, one away from the segment.
    _draw_turn(ax, planned, true, turned[len(turned) // 2])
    numbers = (
        f"$\\delta\\phi_n$ = {1e3 * shift:.1f} mm,  $\\delta\\gamma_d$ = {np.degrees(turn):.1f}°"
    )
    ax.set_title(f"{true.name}\n{numbers}", linespacing=1.5)


def _draw_turn(ax: Axes, planned: Object, true: Object, direction: float) -> None:
    """The two normals, both from the true contact point, and the arc between them."""
    (_, normal) = _points(planned, direction)
    (point, true_normal) = _points(true, direction)
    angles = [float(np.arctan2(n[1], n[0])) for n in (normal, true_normal)]
    length = 0.55 * planned.bounding_radius
    turn = (angles[1] - angles[0] + np.pi) % (2 * np.pi) - np.pi
    arc = angles[0] + np.linspace(0, turn, 40)
    for angle, colour in zip(angles, (PLANNED, rendering.INK), strict=True):
        tip = point + length * np.array([np.cos(angle), np.sin(angle)])
        ax.plot(*np.column_stack([point, tip]), color=colour, lw=0.9, zorder=4)
    ax.plot(
        *(point[:, None] + 0.75 * length * np.array([np.cos(arc), np.sin(arc)])),
        color=TURN,
        lw=2.2,
        zorder=5,
    )


def _points(item: Object, direction: float) -> tuple[np.ndarray, np.ndarray]:
    """The surface's point and normal in one direction, shape (2,) each."""
    reach, normal = trace_surface(item.shapes, np.array([direction]))
    return reach[0] * np.array([np.cos(direction), np.sin(direction)]), normal[0]


def _outline(item: Object) -> np.ndarray:
    """The surface as it is seen from outside, shape (2, SAMPLES)."""
    corners = np.concatenate(
        [np.arctan2(shape.vertices[:, 1], shape.vertices[:, 0]) for shape in item.shapes]
    )
    directions = np.sort(np.concatenate([np.linspace(-np.pi, np.pi, SAMPLES), corners]))
    return trace_surface(item.shapes, directions)[0] * np.array(
        [np.cos(directions), np.sin(directions)]
    )


def _mismatch_handles(name: str) -> list:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    return [
        Patch(
            facecolor=mix(rendering.OBJECT, "white", 0.55),
            edgecolor=PLANNED,
            lw=1.4,
            label=f"planned: {name}",
        ),
        Line2D([], [], color=rendering.INK, lw=1.3, label="true"),
        Line2D([], [], color=SHIFT, lw=2.6, label="contact displacement"),
        Line2D([], [], color=TURN, lw=2.2, label="normal error"),
    ]

"""Figures of tracking with caging: what a larger weight of tracking gives, and what it costs."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import figure_file, mix
from evaluation.figures.modes import MODES
from evaluation.figures.trajectory import Trajectory
from piec_envs import GOAL_RADIUS, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
# of the plane, and width of the curves beside it, inches
HEIGHT = 2.9
LEAST_WIDTH = 1.8
CURVES = 4.2
MARGIN = 0.03  # around ways and goals, m


@dataclass(frozen=True, eq=False)
class Tracked:
    """One execution of a tracking task.

    Args:
        trajectory: with its reference.
        caging: over time, shape (N + 1,).
    """

    trajectory: Trajectory
    caging: np.ndarray


def weight_colours(weights: Sequence[float]) -> dict[float, str]:
    """A colour for each lambda, the weight of tracking over that of caging, from orange to
    purple.
    """
    from matplotlib.colors import to_hex

    first = MODES["contact"].colour
    last = MODES["caging"].colour
    ordered = sorted(weights)
    return {
        weight: to_hex(mix(first, last, k / max(1, len(ordered) - 1)))
        for k, weight in enumerate(ordered)
    }


def tradeoff(
    points: Mapping[float, np.ndarray], path: str | os.PathLike, limit: float | None = None
) -> Path:
    """Tracking error over mean caging for each lambda: small dots are plans, large ones their
    means.

    Args:
        points: lambda -> mean caging and mean tracking error (m) of each plan, shape (M, 2).
        path: where to write the PNG.
        limit: largest error of a success, m, drawn as a line where it is in sight; None draws none.

    Returns:
        The path.
    """
    colours = weight_colours(list(points))
    with figure_file(path, 4.6, 3.4) as figure:
        ax = figure.subplots()
        # (weights, 2)
        means = np.array([np.mean(points[weight], axis=0) for weight in sorted(points)]) * [1, 1e3]
        ax.plot(*means.T, color="#b9bdc8", lw=1.0, zorder=2)
        for mean, weight in zip(means, sorted(points), strict=True):
            caging, error = np.asarray(points[weight]).T
            ax.scatter(
                caging, 1e3 * error, s=14, color=colours[weight], alpha=0.5, linewidths=0, zorder=3
            )
            style: dict[str, Any] = {"s": 64, "edgecolors": "white", "linewidths": 0.9, "zorder": 4}
            ax.scatter(mean[0], mean[1], color=colours[weight], label=_weight(weight), **style)
        ax.margins(x=0.14, y=0.14)
        ax.set_ylim(bottom=0)
        # far above all plans it says nothing
        if limit is not None and 1e3 * limit <= ax.get_ylim()[1]:
            ax.axhline(1e3 * limit, color=rendering.GOAL, lw=1.2, ls=(0, (2, 1.5)), zorder=1)
            end: dict[str, Any] = {
                "ha": "right",
                "va": "bottom",
                "transform": ax.get_yaxis_transform(),
            }
            ax.text(
                1.0,
                1e3 * limit,
                "largest error of a success",
                color=mix(rendering.GOAL, "black", 0.2),
                fontsize=7.5,
                **end,
            )
        ax.grid(axis="x")
        ax.set_xlabel("mean caging")
        ax.set_ylabel("mean tracking error [mm]")
        figure.legend(
            loc="outside upper center", ncols=len(points), handletextpad=0.1, columnspacing=1.1
        )
    return Path(path)


def reference_paths(runs: Mapping[float, Sequence[Tracked]], path: str | os.PathLike) -> Path:
    """Left the references and the ways of the object, right caging over time, both by lambda.

    Several executions of one lambda are a line each at the left, and a mean with the range at the
    right.

    Args:
        runs: lambda -> executions, all of the same length.
        path: where to write the PNG.

    Returns:
        The path.
    """
    colours = weight_colours(list(runs))
    shown = [run.trajectory for each in runs.values() for run in each]
    box = path_box(shown)
    width = max(LEAST_WIDTH, HEIGHT * float(np.ptp(box[0]) / np.ptp(box[1])))
    with figure_file(path, width + CURVES + 1.5, HEIGHT + 0.9) as figure:
        left, right = figure.subplots(1, 2, width_ratios=[width, CURVES])
        _draw_task(left, shown)
        plane_axis(left, box)
        for weight in sorted(runs):
            for run in runs[weight]:
                left.plot(*run.trajectory.pose[:, :2].T, color=colours[weight], lw=1.5, zorder=5)
            _draw_caging(right, runs[weight], colours[weight], _weight(weight))
        right.set_xlabel("time [s]")
        right.set_ylabel("caging")
        right.set_xlim(0, max(each.period * each.steps for each in shown))
        figure.legend(loc="outside upper center", ncols=len(runs) + 1, handlelength=1.9)
    return Path(path)


def _draw_task(ax: Axes, shown: Sequence[Trajectory]) -> None:
    """References, each once, the goal region and where the object starts."""
    references = {
        each.reference.tobytes(): each.reference for each in shown if each.reference is not None
    }
    for rank, reference in enumerate(references.values()):
        rendering.draw_reference(
            ax, reference, linewidth=2.4, zorder=4, label="" if rank else "reference"
        )
    ax.plot(
        *shown[0].pose[0, :2],
        "o",
        color=rendering.OBJECT,
        mec=rendering.INK,
        mew=0.8,
        ms=7,
        zorder=8,
    )
    rendering.draw_goal(ax, shown[0].goal, linewidth=1.4)


def path_box(plans: Sequence[Trajectory]) -> np.ndarray:
    """Box around all ways of the object, references and goal regions, ((x_min, x_max), (y_min,
    y_max)), m.
    """
    points = [plan.goal[None] + shift for plan in plans for shift in (-GOAL_RADIUS, GOAL_RADIUS)]
    points += [plan.pose[:, :2] for plan in plans]
    points += [
        plan.disturbed[..., :2].reshape(-1, 2) for plan in plans if plan.disturbed is not None
    ]
    points += [plan.reference for plan in plans if plan.reference is not None]
    cloud = np.concatenate(points)  # (m, 2)
    return np.stack([cloud.min(axis=0) - MARGIN, cloud.max(axis=0) + MARGIN], axis=1)


def plane_axis(ax: Axes, box: np.ndarray) -> None:
    """Turn an axis into a window on the plane, with equal scales and ticks in metres.

    Args:
        ax: which.
        box: least and largest x, then y, shape (2, 2), m.
    """
    ax.set(xlim=box[0], ylim=box[1], aspect="equal")
    ax.locator_params(nbins=6)
    ax.grid(True, axis="both")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")


def _draw_caging(ax: Axes, runs: Sequence[Tracked], colour: str, label: str) -> None:
    """Mean caging over time with the range over executions."""
    caging = np.stack([run.caging for run in runs])  # (M, N + 1)
    time = runs[0].trajectory.period * np.arange(caging.shape[1])
    if len(runs) > 1:
        ax.fill_between(
            time, caging.min(axis=0), caging.max(axis=0), color=colour, alpha=0.18, linewidth=0
        )
    ax.plot(time, caging.mean(axis=0), color=colour, lw=1.7, label=label)


def _weight(weight: float) -> str:
    return f"$\\lambda$ = {weight:g}"

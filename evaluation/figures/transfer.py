"""The figure of plans under plants that are ever closer to a real one: what was planned and what
came of it.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from evaluation.figures.base import MEAN, NOMINAL, figure_file
from evaluation.figures.tracking import path_box, plane_axis
from evaluation.figures.trajectory import Trajectory
from piec_envs import rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

PANEL = 2.9  # width of a panel, inches


def transfer_paths(plans: Sequence[Trajectory], path: str | os.PathLike) -> Path:
    """One panel for each plant: the planned way of the object blue, its trials thin and dashed,
    their mean red.

    Args:
        plans: planned executions named by their plants; `disturbed` holds the trials.
        path: where to write the PNG.

    Returns:
        The path.
    """
    box = path_box(plans)
    height = PANEL * float(np.ptp(box[1]) / np.ptp(box[0])) + 0.95
    with figure_file(path, PANEL * len(plans) + 0.4, height) as figure:
        axes = figure.subplots(1, len(plans), sharex=True, sharey=True, squeeze=False)[0]
        for ax, plan in zip(axes, plans, strict=True):
            _draw_trials(ax, plan)
            plane_axis(ax, box)
            ax.label_outer()
            ax.set_title(plan.mode, loc="left", fontweight="bold")
            ended = plan.inside[:, -1]
            ax.set_title(f"{ended.sum()} of {len(ended)} in the goal", loc="right", fontsize=8.5)
        _legend(figure)
    return Path(path)


def _draw_trials(ax: Axes, plan: Trajectory) -> None:
    rendering.draw_goal(ax, plan.goal, linewidth=1.4)
    ax.plot(*plan.pose[:, :2].T, color=NOMINAL, lw=2.2, zorder=4)
    for trial in () if plan.disturbed is None else plan.disturbed:
        ax.plot(*trial[:, :2].T, color=rendering.INK, lw=0.8, ls=(0, (4, 2)), alpha=0.75, zorder=5)
        ax.plot(*trial[-1, :2], "o", color=rendering.INK, ms=2.5, zorder=7)
    if plan.disturbed is not None:
        ax.plot(*plan.disturbed.mean(axis=0)[:, :2].T, color=MEAN, lw=1.8, zorder=6)
    ax.plot(
        *plan.pose[0, :2], "o", color=rendering.OBJECT, mec=rendering.INK, mew=0.8, ms=7, zorder=8
    )


def _legend(figure: Figure) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], color=NOMINAL, lw=2.2, label="planned"),
        Line2D([], [], color=rendering.INK, lw=0.8, ls=(0, (4, 2)), label="trials"),
        Line2D([], [], color=MEAN, lw=1.8, label="their mean"),
        Line2D(
            [],
            [],
            color=rendering.OBJECT,
            marker="o",
            mec=rendering.INK,
            mew=0.8,
            ms=7,
            lw=0,
            label="nominal start",
        ),
        Line2D(
            [],
            [],
            color=rendering.GOAL,
            marker="o",
            ms=8,
            mfc="none",
            mew=1.4,
            lw=0,
            label="goal region",
        ),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), handlelength=2.2)

"""The figure of all perturbations at once: success, and how far the object drifts on the way and at
the end.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from evaluation.figures.base import GREY, figure_file, mix
from evaluation.figures.modes import mode_of
from evaluation.metrics import Interval
from evaluation.tables import Estimate

if TYPE_CHECKING:
    from matplotlib.axes import Axes

LINE = 0.3  # height of a protocol, inches
SPREAD = 0.6  # share of it over which the modes are spread
LEAST = 1.0  # mm; smaller deviations are drawn there, since the axis is logarithmic
TITLES = (
    "success, task's start [%]",
    "success, drawn starts [%]",
    "deviation, drawn starts [mm]:  ❘ largest  ● at the end",
)


class Robustness(NamedTuple):
    """What one kind of plan does under one protocol.

    Args:
        success: from the task's start.
        drawn: success from drawn starts.
        deviation: largest distance from the unperturbed execution, from drawn starts, m.
        end: distance from the unperturbed execution at the end, from drawn starts, m.
    """

    success: Interval
    drawn: Interval
    deviation: Estimate
    end: Estimate


def robustness(rows: Mapping[str, Mapping[str, Robustness]], path: str | os.PathLike) -> Path:
    """Dots with intervals for each protocol and mode: success from both kinds of start, and the
    drift.

    In the last column a line leads from the largest deviation on the way (bar) to that at the end
    (dot): a long line to a dot at the left is an object that the arm has brought back.

    Args:
        rows: protocol -> mode -> numbers, from top to bottom.
        path: where to write the PNG.

    Returns:
        The path.
    """
    names = list(rows)
    modes = list(next(iter(rows.values())))
    with figure_file(path, 10.5, 1.1 + LINE * len(names)) as figure:
        axes = np.ravel(figure.subplots(1, 3, sharey=True, width_ratios=[1, 1, 1.5]))
        for rank, name in enumerate(modes):
            colour = mode_of(name, modes).colour
            where = np.arange(len(names)) + SPREAD * (rank / max(1, len(modes) - 1) - 0.5)
            cells = [rows[protocol][name] for protocol in names]
            _dots(axes[0], [100 * np.array(cell.success) for cell in cells], where, colour)
            _dots(axes[1], [100 * np.array(cell.drawn) for cell in cells], where, colour)
            _drift(axes[2], cells, where, colour)
            axes[0].plot([], [], "o", color=colour, label=mode_of(name, modes).label)
        _lines(axes, names)
        for ax, title in zip(axes, TITLES, strict=True):
            ax.set_title(title, fontsize=9)
        for ax in axes[:2]:
            ax.set_xlim(-4, 104)
            ax.set_xticks(range(0, 101, 25))
        axes[2].set_xscale("log")
        axes[2].set_xticks([1, 10, 100, 1000], ["≤ 1", "10", "100", "1000"])
        axes[2].minorticks_off()
        axes[2].set_xlim(0.85 * LEAST)
        figure.legend(loc="outside upper center", ncols=len(modes))
    return Path(path)


def _dots(ax: Axes, values: Sequence[np.ndarray], where: np.ndarray, colour: str) -> None:
    """Estimates as dots on their intervals."""
    centre, low, high = np.array(values).T
    ax.hlines(where, low, high, color=mix(colour, "white", 0.35), lw=1.6, zorder=2)
    ax.plot(centre, where, "o", color=colour, ms=4.2, zorder=3, clip_on=False)


def _drift(ax: Axes, cells: Sequence[Robustness], where: np.ndarray, colour: str) -> None:
    """The way back from the largest deviation to that at the end."""
    # (rows, 2)
    millimetres = 1e3 * np.array([(cell.deviation.value, cell.end.value) for cell in cells])
    largest, end = np.maximum(millimetres, LEAST).T
    ax.hlines(where, end, largest, color=mix(colour, "white", 0.5), lw=1.6, zorder=2)
    ax.plot(largest, where, "|", color=colour, ms=5.5, mew=1.6, zorder=3)
    ax.plot(end, where, "o", color=colour, ms=4.2, zorder=4, clip_on=False)


def _lines(axes: np.ndarray, names: Sequence[str]) -> None:
    """Names at the left, bands behind every other protocol, and lines between families of
    protocols.
    """
    axes[0].set_yticks(range(len(names)), names)
    axes[0].set_ylim(len(names) - 0.5, -0.5)
    for ax in axes:
        ax.grid(axis="x")
        ax.grid(axis="y", visible=False)
        ax.tick_params(axis="y", length=0)
        for k, name in enumerate(names):
            if k % 2:
                ax.axhspan(k - 0.5, k + 0.5, color="#f5f6f8", zorder=0)
            if k and name.partition("-")[0] != names[k - 1].partition("-")[0]:
                ax.axhline(k - 0.5, color=GREY, lw=0.7, zorder=1)

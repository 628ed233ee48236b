"""Figures over time and over modes: curves with bands, bars, and boxes with their samples."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import figure_file, mix
from evaluation.figures.modes import Mode, mode_of
from piec_envs import CONTROL_PERIOD, GOAL_RADIUS, rendering

if TYPE_CHECKING:
    from matplotlib.axes import Axes

CURVE_POINTS = 250  # of a curve in a figure
BAND = (0.1, 0.9)  # quantiles

Series = Mapping[str, np.ndarray]  # mode -> (N + 1,) or (M, N + 1)
Sweep = Mapping[str, Mapping[float, np.ndarray]]  # mode -> sigma in m -> samples
# mode -> sigma in m, or name of a plant -> samples
Samples = Mapping[str, Mapping[Any, np.ndarray]]


def contact_fractions(
    fractions: Series, path: str | os.PathLike, links: Sequence[str] | None = None
) -> Path:
    """Grouped bars: share of the time in which each link touches the object.

    Args:
        fractions: mode -> (links,), in [0, 1].
        path: where to write the PNG.
        links: their names; None numbers them.

    Returns:
        The path.
    """
    count = len(next(iter(fractions.values())))
    names = links or [f"link {k + 1}" for k in range(count)]
    width = 0.8 / len(fractions)
    with figure_file(path, 1.2 + 1.1 * count, 2.6) as figure:
        ax = figure.subplots()
        for rank, (name, values) in enumerate(fractions.items()):
            mode = mode_of(name, list(fractions))
            where = np.arange(count) + (rank - (len(fractions) - 1) / 2) * width
            bars = ax.bar(
                where, 100 * np.asarray(values), 0.9 * width, color=mode.colour, label=mode.label
            )
            ax.bar_label(bars, fmt="%.0f", fontsize=7, padding=1.5, color="#5b6170")
        ax.set_xticks(np.arange(count), names)
        ax.tick_params(axis="x", length=0)
        ax.set_ylabel("time in contact [%]")
        ax.set_ylim(0, 108)
        ax.set_yticks(range(0, 101, 25))
        _legend(figure, ax)
    return Path(path)


def over_time(
    series: Series, ylabel: str, path: str | os.PathLike, period: float = CONTROL_PERIOD
) -> Path:
    """Curves over time, with a band from the 10 % to the 90 % quantile where there are several
    executions.

    Args:
        series: mode -> (N + 1,) or (M, N + 1).
        ylabel: quantity and unit.
        path: where to write the PNG.
        period: time between two entries, s.

    Returns:
        The path.
    """
    with figure_file(path, 4.6, 2.7) as figure:
        ax = figure.subplots()
        for name, values in series.items():
            mode = mode_of(name, list(series))
            rows, time = _thinned(np.atleast_2d(values), period)
            mean = rows.mean(axis=0)
            if len(rows) > 1:
                low, high = np.quantile(rows, BAND, axis=0)
                ax.fill_between(time, low, high, color=mode.colour, alpha=0.18, linewidth=0)
            ax.plot(time, mean, color=mode.colour, lw=1.7, label=mode.label)
            ax.axhline(float(np.mean(values)), color=mode.colour, lw=0.9, ls=(0, (4, 3)), alpha=0.8)
        ax.set_xlim(0, time[-1])
        ax.set_xlabel("time [s]")
        ax.set_ylabel(ylabel)
        _legend(figure, ax)
    return Path(path)


def distance_bands(
    distances: Sweep, path: str | os.PathLike, period: float = CONTROL_PERIOD
) -> Path:
    """Object-to-goal distance over time: every disturbed execution, and their mean, for each mode
    and sigma.

    Args:
        distances: mode -> sigma in m -> (M, N + 1), m.
        path: where to write the PNG.
        period: time between two entries, s.

    Returns:
        The path.
    """
    sigmas = sorted({sigma for row in distances.values() for sigma in row})
    top = 1.05 * max(float(values.max()) for row in distances.values() for values in row.values())
    with figure_file(path, 0.6 + 2.3 * len(sigmas), 0.5 + 1.35 * len(distances)) as figure:
        axes = figure.subplots(len(distances), len(sigmas), sharex=True, sharey=True, squeeze=False)
        for line, (name, row) in zip(axes, distances.items(), strict=True):
            for ax, sigma in zip(line, sigmas, strict=True):
                if sigma in row:
                    _bundle(ax, row[sigma], mode_of(name, list(distances)).colour, period)
            _row_label(line[-1], mode_of(name, list(distances)))
        for ax, sigma in zip(axes[0], sigmas, strict=True):
            ax.set_title(_sigma(sigma))
        axes[0, 0].set_ylim(0, top)
        figure.supxlabel("time [s]", fontsize=9)
        figure.supylabel("distance to the goal [m]", fontsize=9)
    return Path(path)


def _row_label(ax: Axes, mode: Mode) -> None:
    """Name of the mode to the right of its row."""
    label = mode.label.replace(" (", "\n(")
    style: dict[str, Any] = {
        "rotation": -90,
        "va": "center",
        "ha": "left",
        "color": mix(mode.colour, "black", 0.2),
    }
    ax.annotate(
        label,
        (1.03, 0.5),
        xycoords="axes fraction",
        fontweight="bold",
        multialignment="center",
        **style,
    )


def _bundle(ax: Axes, rows: np.ndarray, colour: str, period: float) -> None:
    """Thin lines of all executions, their mean, and the radius of the goal region."""
    from matplotlib.collections import LineCollection

    rows, time = _thinned(rows, period)
    lines = np.stack([np.broadcast_to(time, rows.shape), rows], axis=-1)  # (M, m, 2)
    ax.add_collection(
        LineCollection(list(lines), colors=colour, linewidths=0.4, alpha=0.35, zorder=2)
    )
    ax.plot(time, rows.mean(axis=0), color=mix(colour, "black", 0.35), lw=1.8, zorder=3)
    ax.axhline(GOAL_RADIUS, color=rendering.GOAL, lw=1.2, ls=(0, (2, 1.5)), zorder=4)
    ax.set_xlim(0, time[-1])


def final_distances(final: Samples, path: str | os.PathLike) -> Path:
    """Final object-to-goal distance: boxes with all samples, for each mode and plant.

    Args:
        final: mode -> sigma in m, or name of the plant -> (M,), m.
        path: where to write the PNG.

    Returns:
        The path.
    """
    plants = list(dict.fromkeys(plant for row in final.values() for plant in row))
    width = 0.82 / len(final)
    # the legend needs its room
    with figure_file(path, max(5.9, 1.4 + 1.5 * len(plants)), 2.8) as figure:
        ax = figure.subplots()
        for rank, (name, row) in enumerate(final.items()):
            mode = mode_of(name, list(final))
            for k, plant in enumerate(plants):
                if plant in row:
                    where = k + (rank - (len(final) - 1) / 2) * width
                    _box(ax, where, np.asarray(row[plant]), 0.8 * width, mode.colour)
            ax.plot([], [], color=mode.colour, lw=6, alpha=0.5, label=mode.label)
        ax.axhline(
            GOAL_RADIUS,
            color=rendering.GOAL,
            lw=1.2,
            ls=(0, (2, 1.5)),
            zorder=1,
            label="goal radius",
        )
        ax.set_xticks(
            range(len(plants)),
            [plant if isinstance(plant, str) else _sigma(plant) for plant in plants],
        )
        ax.tick_params(axis="x", length=0)
        ax.set_xlim(-0.5, len(plants) - 0.5)
        ax.set_ylim(0)
        ax.set_ylabel("final distance to the goal [m]")
        _legend(figure, ax)
    return Path(path)


def _box(ax: Axes, where: float, values: np.ndarray, width: float, colour: str) -> None:
    """A box from quartile to quartile with whiskers to 5 and 95 %, and every sample beside its
    neighbours.
    """
    # golden ratio: even, without random numbers
    spread = (np.arange(len(values)) * 0.618034) % 1 - 0.5
    ax.scatter(
        where + 0.8 * width * spread, values, s=3, color=colour, alpha=0.5, linewidths=0, zorder=2
    )
    ax.boxplot(
        [values],
        positions=[where],
        widths=[width],
        whis=(5, 95),
        showfliers=False,
        manage_ticks=False,
        patch_artist=True,
        boxprops={
            "facecolor": (*mix(colour, "white", 0.4), 0.35),
            "edgecolor": colour,
            "linewidth": 1.0,
        },
        whiskerprops={"color": colour, "linewidth": 1.0},
        capprops={"color": colour, "linewidth": 1.0},
        medianprops={"color": rendering.INK, "linewidth": 1.4},
        zorder=3,
    )


def _sigma(sigma: float) -> str:
    return f"$\\sigma$ = {1e3 * sigma:g} mm"


def _thinned(rows: np.ndarray, period: float) -> tuple[np.ndarray, np.ndarray]:
    """At most about CURVE_POINTS entries of each row (the last one kept), and their times."""
    last = rows.shape[1] - 1
    kept = np.unique(np.linspace(0, last, min(CURVE_POINTS, last + 1)).astype(int))
    return rows[:, kept], period * kept


def _legend(figure: Any, ax: Axes) -> None:
    """A legend in one row above the axis."""
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(
        handles,
        labels,
        loc="outside upper center",
        ncols=len(labels),
        handlelength=1.4,
        columnspacing=1.4,
    )

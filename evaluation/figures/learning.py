"""Figures of learned agents beside plans: success under every protocol, and how agents learn."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.figures.base import figure_file
from evaluation.figures.modes import mode_of
from piec_envs import rendering

CELL = (0.72, 0.27)  # width and height of a cell of the matrix, inches
MARGINS = (2.1, 1.0)  # for the names of rows and columns, inches
CURVES = ("#e69f00", "#882255", "#3b7db8", "#44aa99", "#8b91a0", "#b58a3c")


def success_matrix(
    rates: np.ndarray,
    rows: Sequence[str],
    columns: Sequence[str],
    path: str | os.PathLike,
    groups: Sequence[int] = (),
) -> Path:
    """Success rates as a matrix of coloured cells with their numbers in per cent.

    Args:
        rates: shape (rows, columns), 0 to 1.
        rows: names of the methods.
        columns: names of the protocols.
        path: where to write the PNG.
        groups: rows above which a line parts the methods.

    Returns:
        The path.
    """
    from matplotlib.colors import LinearSegmentedColormap

    colours = LinearSegmentedColormap.from_list("success", ["#f6f2f4", mode_of("caging").colour])
    size = [
        margin + cell * count
        for margin, cell, count in zip(MARGINS, CELL, rates.shape[::-1], strict=True)
    ]
    with figure_file(path, *size) as figure:
        ax = figure.subplots()
        ax.imshow(rates, cmap=colours, vmin=0, vmax=1, aspect="auto")
        for (i, k), rate in np.ndenumerate(rates):
            ax.text(
                k,
                i,
                f"{100 * rate:.0f}",
                ha="center",
                va="center",
                color="white" if rate > 0.55 else rendering.INK,
            )
        for row in groups:
            ax.axhline(row - 0.5, color="white", lw=4)
        ax.set_xticks(range(len(columns)), columns, rotation=35, ha="left", rotation_mode="anchor")
        ax.set_yticks(range(len(rows)), rows)
        ax.xaxis.tick_top()
        ax.tick_params(length=0)
        ax.grid(False)
        ax.spines[:].set_visible(False)
    return Path(path)


def learning_curves(
    curves: Mapping[str, Sequence[Sequence[Mapping[str, Any]]]],
    repeat: int,
    path: str | os.PathLike,
) -> Path:
    """Success rate and distance to the goal region of agents while they learn, one line for each
    training.

    Args:
        curves: label -> trainings -> evaluations on the way, with "steps", "success_rate" and "d2g"
            (m).
        repeat: control steps of an action.
        path: where to write the PNG.

    Returns:
        The path.
    """
    with figure_file(path, 8.4, 3.0) as figure:
        left, right = figure.subplots(1, 2)
        for rank, (label, trainings) in enumerate(curves.items()):
            for number, curve in enumerate(trainings):
                steps = [repeat * entry["steps"] / 1e6 for entry in curve]
                style: dict[str, Any] = {"color": CURVES[rank % len(CURVES)], "lw": 1.5}
                left.plot(steps, [100 * entry["success_rate"] for entry in curve], **style)
                right.plot(
                    steps,
                    [1e3 * entry["d2g"] for entry in curve],
                    label=label if number == 0 else None,
                    **style,
                )
        left.set_ylabel("success from drawn starts [%]")
        right.set_yscale("symlog", linthresh=10)
        right.set_ylabel("distance to the goal region [mm]")
        for ax in (left, right):
            ax.set_xlabel("control steps [million]")
            ax.set_ylim(bottom=0)
            ax.set_xscale("log")  # off-policy learners take a tenth of the steps
        figure.legend(loc="outside lower center", ncols=min(len(curves), 5))
    return Path(path)

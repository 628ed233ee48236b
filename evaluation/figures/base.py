"""What all figures share: the look, panels, colour bars and the file."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.tables import write_atomic
from piec_envs import (
    CAGING_SCALE,
    rendering,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.image import AxesImage

DPI = 150
CAGING = f"caging = {CAGING_SCALE:g} T"  # label of colour bars
GREY = "#8b91a0"
TITLE_LINE = 15.0  # height of the second line above a panel, points
# object paths without disturbance, and mean of the disturbed ones
NOMINAL = "#2f6fb7"
MEAN = "#c9302c"

# Matplotlib settings of every figure, in force while it is drawn alone.
LOOK: Any = {
    "font.family": "DejaVu Sans",
    "font.size": 9.0,
    "axes.titlesize": 10.0,
    "axes.labelsize": 9.0,
    "axes.edgecolor": "#5b6170",
    "axes.labelcolor": rendering.INK,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.grid.axis": "y",
    "axes.axisbelow": True,
    "grid.color": "#e4e6eb",
    "grid.linewidth": 0.7,
    "xtick.color": "#5b6170",
    "ytick.color": "#5b6170",
    "xtick.labelsize": 8.0,
    "ytick.labelsize": 8.0,
    "text.color": rendering.INK,
    "legend.frameon": False,
    "legend.fontsize": 8.5,
}


@contextmanager
def figure_file(path: str | os.PathLike, width: float, height: float) -> Iterator[Figure]:
    """A figure, drawn and written as PNG when the block ends.

    Args:
        path: where to write.
        width, height: of the figure, inches.

    Yields:
        The figure, empty.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    with matplotlib.rc_context(LOOK):
        layout = ConstrainedLayoutEngine(wspace=0.03, w_pad=0.06, h_pad=0.05)
        figure = Figure((width, height), dpi=DPI, layout=layout, facecolor="white")
        FigureCanvasAgg(figure)
        yield figure
        content = io.BytesIO()
        figure.savefig(content, format="png", metadata={"Software": None})
    write_atomic(path, content.getvalue())


def panel_title(ax: Axes, name: str, note: str, colour: Any = rendering.INK) -> None:
    """Two lines above a panel, so that they do not run into those of its neighbours.

    Args:
        ax: the panel.
        name: in bold; "" leaves it out.
        note: below it, plain; "" keeps its place.
        colour: of the name.
    """
    ax.set_title(note or " ", loc="left", fontsize=8.5, pad=3.0)
    if name:
        place: dict[str, Any] = {
            "xycoords": "axes fraction",
            "textcoords": "offset points",
            "va": "bottom",
        }
        ax.annotate(
            name, (0, 1), (0, TITLE_LINE), color=colour, fontweight="bold", fontsize=10, **place
        )


def show_scene(ax: Axes, box: np.ndarray) -> None:
    """Turn an axis into a window on the plane, without frame and with equal scales.

    Args:
        ax: which.
        box: least and largest x, then y, shape (2, 2), m.
    """
    ax.set_axis_off()
    # at the top of its place, so that the layout knows where titles end
    ax.set_aspect("equal", anchor="N")
    ax.set_xlim(*box[0])
    ax.set_ylim(*box[1])


def colour_bar(
    figure: Figure,
    image: AxesImage,
    axes: Sequence[Axes] | np.ndarray,
    label: str,
    extend: Any = "max",
) -> None:
    """One colour bar at the right of several axes.

    Args:
        figure: or subfigure.
        image: whose colours it explains.
        axes: beside which it stands, of any shape.
        label: what the colours mean.
        extend: the ends beyond which values may lie: "neither", "min", "max" or "both".
    """
    axes = np.asarray(axes)
    rows = 1 if axes.ndim == 1 else len(axes)
    place: dict[str, Any] = {
        "shrink": 0.8 / rows**0.5,
        "aspect": 22 * rows**0.5,
        "pad": 0.01,
        "panchor": False,
    }
    bar = figure.colorbar(image, ax=axes, extend=extend, **place)  # the axes keep their anchors
    bar.set_label(label, fontsize=8.5)
    bar.outline.set_visible(False)


def mix(colour: str, other: str, share: float) -> tuple[float, float, float]:
    """A colour between two.

    Args:
        colour, other: as Matplotlib takes them.
        share: of `other`, in [0, 1].

    Returns:
        Red, green and blue, in [0, 1].
    """
    from matplotlib.colors import to_rgb

    r, g, b = (
        (1 - share) * x + share * y for x, y in zip(to_rgb(colour), to_rgb(other), strict=True)
    )
    return r, g, b

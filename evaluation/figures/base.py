"""What all figures share: the table of modes, the look, the view and the file."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.tables import write_atomic
from piec_envs import (
    CAGING_SCALE,
    CONTROL_PERIOD,
    GOAL_RADIUS,
    Object,
    Robot,
    get_object,
    get_robot,
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


@dataclass(frozen=True)
class Mode:
    """How figures name and colour one kind of plan.

    Args:
        label: its name in legends and titles.
        colour: safe for the common kinds of colour blindness.
    """

    label: str
    colour: str


MODES = {
    "contact": Mode("contact (mode 1)", "#e69f00"),
    "proximity": Mode("proximity (mode 2)", "#3b7db8"),
    "caging": Mode("caging (mode 3)", "#882255"),
    "adversarial": Mode("adversarial (mode 4)", "#44aa99"),
    "Point": Mode("Point", "#8b91a0"),
    "Link": Mode("Link", "#3b7db8"),
    "WAContact": Mode("WAContact", "#e69f00"),
    "WACaging": Mode("WACaging", "#882255"),
}
_OTHERS = ("#555b6b", "#b58a3c", "#5f7fa6", "#a3667f", "#7d9c8f")


def mode_of(name: str, among: Sequence[str] = ()) -> Mode:
    """The row of a mode; a name that is no mode is its own label, in a muted colour.

    Args:
        name: of the mode.
        among: all names of the figure, so that two strangers differ in colour.

    Returns:
        Label and colour.
    """
    if name in MODES:
        return MODES[name]
    strangers = [other for other in among if other not in MODES]
    return Mode(
        name.replace("_", " "),
        _OTHERS[strangers.index(name) % len(_OTHERS) if name in strangers else 0],
    )


@dataclass(frozen=True, eq=False)
class Trajectory:
    """One execution of a plan and, where there are any, disturbed executions of the same plan.

    Args:
        mode: key of MODES, or any name.
        robot_name: row of the table of robots.
        object_name: row of the table of objects.
        goal: centre of the goal region, shape (2,), m.
        q_r: joint positions, shape (N + 1, n), rad or m.
        pose: object x, y, angle, shape (N + 1, 3), m and rad.
        contact: links in contact, shape (N + 1, links); None where not known.
        disturbed: object poses of M disturbed executions, shape (M, N + 1, 3); None without any.
        reference: path to be tracked, shape (m, 2), m; None for a goal task.
        period: time between two entries, s: longer than a control step in thinned executions.
        loose: position and quaternion of the object's k loose bodies, shape (N + 1, k, 7); None
            where it has none, or they are not known.
    """

    mode: str
    robot_name: str
    object_name: str
    goal: np.ndarray
    q_r: np.ndarray
    pose: np.ndarray
    contact: np.ndarray | None = None
    disturbed: np.ndarray | None = None
    reference: np.ndarray | None = None
    period: float = CONTROL_PERIOD
    loose: np.ndarray | None = None

    @property
    def robot(self) -> Robot:
        """The robot."""
        return get_robot(self.robot_name)

    @property
    def object(self) -> Object:
        """The object."""
        return get_object(self.object_name)

    @property
    def steps(self) -> int:
        """N, the number of steps."""
        return len(self.pose) - 1

    @property
    def first_contact(self) -> int | None:
        """Step of the first contact; None if there is none or contacts are not known."""
        if self.contact is None or not self.contact.any():
            return None
        return int(self.contact.any(axis=1).argmax())

    @property
    def inside(self) -> np.ndarray:
        """Whether the object of each disturbed execution is in the goal region, shape (M, N
        + 1).
        """
        disturbed = self.pose[None] if self.disturbed is None else self.disturbed
        return np.hypot(*np.moveaxis(disturbed[..., :2] - self.goal, -1, 0)) <= GOAL_RADIUS


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


def bounds(
    trajectories: Sequence[Trajectory], frames: Sequence[Sequence[int]], margin: float = 0.05
) -> np.ndarray:
    """Box around what is drawn of some trajectories.

    Args:
        trajectories: what is drawn.
        frames: for each of them the steps at which its robot is drawn.
        margin: space around it, m.

    Returns:
        ((x_min, x_max), (y_min, y_max)), m.
    """
    points = []
    for trajectory, steps in zip(trajectories, frames, strict=True):
        reach = trajectory.object.bounding_radius
        for step in steps:
            points += rendering.arm_outlines(trajectory.robot, trajectory.q_r[step])
        for path in (
            trajectory.pose,
            trajectory.pose if trajectory.disturbed is None else trajectory.disturbed,
        ):
            points += [path[..., :2].reshape(-1, 2) + shift for shift in (-reach, reach)]
        points += [] if trajectory.reference is None else [trajectory.reference]
        points += [trajectory.goal[None] + shift for shift in (-GOAL_RADIUS, GOAL_RADIUS)]
    cloud = np.concatenate(points)  # (m, 2)
    return np.stack([cloud.min(axis=0) - margin, cloud.max(axis=0) + margin], axis=1)


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

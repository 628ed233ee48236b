"""Animations: frames into one GIF or MP4 file, and disturbed executions side by side."""

from __future__ import annotations

import importlib.util
import os
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.figures.base import LOOK, mix, show_scene
from evaluation.figures.modes import mode_of
from evaluation.figures.trajectory import Trajectory, bounds
from piec_envs import InvalidParameterError, MissingDependencyError, rendering, robot_frames

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COLOURS = 128  # of a GIF, the same in all frames, so that what stands still costs nothing
WIDTH = 900  # pixels
TITLE = 46  # height of the titles, pixels
LAST = 20  # times that the last frame is shown
SUFFIXES = (".gif", ".mp4")


def animation(
    frames: Iterable[np.ndarray] | str | os.PathLike, path: str | os.PathLike, fps: float = 20.0
) -> Path:
    """Write frames as an animation.

    Args:
        frames: pictures of shape (height, width, 3), uint8, or a folder of PNG files in order of
            name.
        path: where to write; .gif, or .mp4 where imageio-ffmpeg is installed.
        fps: frames per second.

    Returns:
        The path.

    Raises:
        InvalidParameterError: if there is no frame, or the suffix is neither.
        MissingDependencyError: for .mp4 without imageio-ffmpeg.
    """
    import imageio.v3 as imageio

    target = Path(path)
    if target.suffix not in SUFFIXES:
        raise InvalidParameterError(
            f"an animation ends in one of {', '.join(SUFFIXES)}, got {target.name!r}"
        )
    if target.suffix == ".mp4" and importlib.util.find_spec("imageio_ffmpeg") is None:
        raise MissingDependencyError("imageio_ffmpeg", "video")
    if isinstance(frames, str | os.PathLike):
        frames = (imageio.imread(file)[..., :3] for file in sorted(Path(frames).glob("*.png")))
    pictures = list(frames)
    if not pictures:
        raise InvalidParameterError("an animation needs at least one frame")
    target.parent.mkdir(parents=True, exist_ok=True)
    temporary = target.with_name(f".{os.getpid()}.{target.name}")
    if target.suffix == ".gif":
        imageio.imwrite(
            temporary, _few_colours(pictures), duration=1000 / fps, loop=0, plugin="pillow"
        )
    else:
        imageio.imwrite(temporary, np.stack(pictures), fps=fps, plugin="FFMPEG", macro_block_size=2)
    os.replace(temporary, target)
    return target


def _few_colours(pictures: Sequence[np.ndarray]) -> np.ndarray:
    """The pictures in COLOURS colours that all of them share, rare ones among them, without
    dithering.
    """
    from PIL import Image

    sample = np.concatenate([pictures[k] for k in np.linspace(0, len(pictures) - 1, 5).astype(int)])
    palette = Image.fromarray(sample).quantize(COLOURS, Image.Quantize.FASTOCTREE)
    reduced = (
        Image.fromarray(picture).quantize(palette=palette, dither=Image.Dither.NONE)
        for picture in pictures
    )
    table = np.asarray(palette.getpalette(), dtype=np.uint8).reshape(-1, 3)  # (COLOURS, 3)
    # white stays white
    table = np.where(table.min(axis=1, keepdims=True) > 248, 255, table).astype(np.uint8)
    return np.stack([table[np.asarray(picture)] for picture in reduced])


def animate_rollouts(
    plans: Sequence[Trajectory],
    path: str | os.PathLike,
    fps: float = 20.0,
    every: int | None = None,
) -> Path:
    """Side by side, the disturbed objects of each plan as a cloud that moves with the arm.

    Args:
        plans: executions with disturbed ones, of equal length.
        path: where to write, .gif or .mp4.
        fps: frames per second.
        every: steps between two frames; None makes about 100 frames.

    Returns:
        The path.
    """
    every = every or max(1, plans[0].steps // 100)
    return animation(rollout_frames(plans, every), path, fps)


def rollout_frames(plans: Sequence[Trajectory], every: int) -> Iterator[np.ndarray]:
    """The frames of `animate_rollouts`; the last one stands for a while.

    Args:
        plans: executions with disturbed ones, of equal length.
        every: steps between two frames.

    Yields:
        Pictures, shape (height, WIDTH, 3), uint8.
    """
    import matplotlib
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    box = bounds(
        plans, [range(0, plan.steps + 1, max(1, plan.steps // 20)) for plan in plans], margin=0.04
    )
    ratio = (box[1, 1] - box[1, 0]) / (box[0, 1] - box[0, 0])
    height = 2 * np.ceil((WIDTH / len(plans) * ratio + TITLE) / 2)  # even, as video needs it
    with matplotlib.rc_context(LOOK):
        figure = Figure((WIDTH / 100, height / 100), dpi=100, facecolor="white")
        FigureCanvasAgg(figure)
        figure.subplots_adjust(left=0, right=1, bottom=0, top=1 - TITLE / height, wspace=0)
        axes = figure.subplots(1, len(plans), squeeze=False)[0]
        panels = [_Panel(ax, plan, box) for ax, plan in zip(axes, plans, strict=True)]
        clock = figure.text(0.99, 0.99, "", ha="right", va="top")
        frame = np.zeros(0)
        for step in [*range(0, plans[0].steps, every), plans[0].steps]:
            for panel in panels:
                panel.show(step)
            clock.set_text(f"{plans[0].period * step:.0f} s")
            frame = rendering.pixels(figure)
            yield frame
        yield from [frame] * LAST


class _Panel:
    """One plan of an animation: what stands still is drawn once, what moves is updated.

    Args:
        ax: where to draw.
        plan: with disturbed executions.
        box: the visible part of the plane.
    """

    def __init__(self, ax: Axes, plan: Trajectory, box: np.ndarray):
        from matplotlib.collections import PolyCollection
        from matplotlib.colors import to_rgba

        mode = mode_of(plan.mode)
        face = mix("white", mode.colour, 0.3)
        self.plan = plan
        self.outlines = [shape.outline(6) for shape in plan.object.shapes]
        self.turning = [j + 1 for j, joint in enumerate(plan.robot.joints) if joint.axis[2] != 0]
        self.cloud = PolyCollection(
            [],
            facecolor=to_rgba(rendering.OBJECT, 0.12),
            edgecolor=mix(rendering.OBJECT, "black", 0.35),
            lw=0.4,
        )
        self.links = PolyCollection([], facecolor=face, edgecolor=rendering.INK, lw=0.8)
        # Mixed with white instead of transparent: overlapping parts stay even.
        pale: dict[str, Any] = {
            "facecolor": mix("white", mode.colour, 0.3 * rendering.PALE),
            "edgecolor": mix("white", rendering.INK, rendering.PALE),
        }
        self.scenery = PolyCollection([], lw=0.8, **pale)
        for order, item in enumerate((self.scenery, self.cloud, self.links)):
            ax.add_collection(item, autolim=False)
            item.set_zorder(2 + order)
        # pale parts lie below the object
        top = 6.0 if plan.robot.whole_name == plan.robot.name else 2.5
        self.joints = ax.scatter(
            [], [], s=14, facecolor="white", edgecolor=rendering.INK, linewidths=0.7, zorder=top
        )
        self.base = ax.scatter([], [], s=34, color=rendering.INK, zorder=top)
        self.ends = ax.scatter([], [], s=4, color=rendering.INK, linewidths=0, alpha=0.7, zorder=7)
        rendering.draw_goal(ax, plan.goal, linewidth=1.6)
        place: dict[str, Any] = {"x": 0.03, "va": "bottom", "transform": ax.transAxes}
        ax.text(
            y=1.06,
            s=mode.label,
            color=mix(mode.colour, "black", 0.2),
            fontweight="bold",
            fontsize=9.5,
            **place,
        )
        self.note = ax.text(y=0.985, s="", fontsize=8.5, **place)
        show_scene(ax, box)

    def show(self, step: int) -> None:
        """Move everything to a step."""
        plan = self.plan
        q = self.plan.q_r[step]
        # (M, 3)
        poses = plan.pose[None, step] if plan.disturbed is None else plan.disturbed[:, step]
        self.links.set_verts(
            [outline for link in rendering.link_outlines(plan.robot, q) for outline in link]
        )
        self.scenery.set_verts(rendering.scenery_outlines(plan.robot, q))
        if plan.robot.base_dof:
            self.base.set_offsets(rendering.base_position(plan.robot, q))
        self.joints.set_offsets(robot_frames(plan.robot.name, q)[self.turning, :2])
        self.cloud.set_verts(
            [outline for shape in self.outlines for outline in _placed(shape, poses)]
        )
        self.ends.set_offsets(poses[:, :2])
        self.note.set_text(f"{plan.inside[:, step].sum()} of {len(poses)} in the goal")


def _placed(outline: np.ndarray, poses: np.ndarray) -> np.ndarray:
    """An outline (m, 2) at every pose (M, 3), shape (M, m, 2)."""
    c = np.cos(poses[:, 2])
    s = np.sin(poses[:, 2])
    turn = np.stack([np.stack([c, -s], axis=-1), np.stack([s, c], axis=-1)], axis=-2)  # (M, 2, 2)
    return np.einsum("bij,mj->bmi", turn, outline) + poses[:, None, :2]

"""Figures: files are written whole, have the expected size, repeat bit for bit, and never load
pyplot.
"""

from __future__ import annotations

import subprocess
import sys
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import imageio.v3 as imageio
import numpy as np
import pytest
from trajectories import GOAL, PLANS, STEPS

from evaluation import figures
from evaluation.figures.mismatch import end_box
from evaluation.figures.modes import MODES, mode_of
from evaluation.metrics import Interval
from evaluation.studies.annulus import Annulus
from evaluation.studies.contact_methods import METHODS
from evaluation.tables import Estimate
from piec_envs.errors import RenderingError
from piec_envs.escape.grid import GridField
from piec_envs.escape.obstacle import ObstacleField
from piec_envs.rendering.space import SpaceFrames
from piec_envs.world.objects import get_object

ROOT = Path(__file__).resolve().parents[2]
SERIES = {plan.mode: np.linalg.norm(plan.disturbed[..., :2] - GOAL, axis=-1) for plan in PLANS}
SWEEP = {mode: {0.001: rows, 0.005: 2 * rows} for mode, rows in SERIES.items()}
FINAL = {mode: {sigma: rows[:, -1] for sigma, rows in row.items()} for mode, row in SWEEP.items()}

RING = Annulus()
SOLVED = ObstacleField(RING.walls, RING.radius, resolution=64)
PANEL = figures.ObstaclePanel(
    title="hard wall",
    field_map=SOLVED.solve(),
    outlines=(RING.outline(RING.outer), RING.outline(RING.inner)),
    radius=RING.radius,
    star=np.array(RING.centre),
    point=("A", np.zeros(2)),
    paths=(SOLVED.escape_path(np.zeros(2)),),
)

EXACT = GridField(resolution=64, threads=1)
COARSE = GridField(resolution=32, threads=1)
FIELDS = {"exact": EXACT, "coarse": COARSE}
CURLED = np.array([[0.1, 1.15, 1.89, 1.29], [1.9, -0.81, -2.18, -0.96]])
WITHIN = np.array([[0.34, 0.28], [0.05, 0.43]])

EXECUTED = [
    [
        figures.Executed(name, name, run)
        for name, run in zip(("square", "hexagon"), plan.disturbed, strict=False)
    ]
    for plan in PLANS
]
ROW = figures.Robustness(
    Interval(0.6, 0.2, 0.9),
    Interval(1.0, 1.0, 1.0),
    Estimate(0.1, 0.08, 0.2),
    Estimate(0.0, 0.0, 0.0),
)
ROBUST = {
    name: {plan.mode: ROW for plan in PLANS}
    for name in ("friction-0.00", "friction-1.00", "shape-square")
}

JUG = ("franka_capsules", "water_jug", np.array([0.1, 0.3, 0.0]), np.array([0.3, -2.0, 1.5]))
POSTURES = [figures.PosturePanel(*JUG, label=f"a start with a long name, {k}") for k in range(4)]
DOTS = np.array([[0.34, 0.009], [0.3401, 0.0091]])  # plans that are alike

DRAW = {
    "keyframes": lambda path: figures.keyframes(PLANS, path),
    "trajectories": lambda path: figures.trajectories(PLANS, path),
    "field_strip": lambda path: figures.field_strip(PLANS[2], path, steps=[30, STEPS]),
    "overview": lambda path: figures.overview(PLANS, path),
    "contact_fractions": lambda path: figures.contact_fractions(
        {plan.mode: plan.contact.mean(axis=0) for plan in PLANS}, path
    ),
    "over_time": lambda path: figures.over_time(SERIES, "distance [m]", path),
    "distance_bands": lambda path: figures.distance_bands(SWEEP, path),
    "final_distances": lambda path: figures.final_distances(FINAL, path),
    "mismatch_paths": lambda path: figures.mismatch_paths(PLANS, EXECUTED, path),
    "shape_mismatches": lambda path: figures.shape_mismatches(
        get_object("circle"), [get_object("square"), get_object("three_discs")], path
    ),
    "robustness": lambda path: figures.robustness(ROBUST, path),
    "escape_times": lambda path: figures.escape_times([PANEL], path),
    "field_comparison": lambda path: figures.field_comparison(FIELDS, CURLED, WITHIN, path),
    "posture_row": lambda path: figures.posture_row(POSTURES, path),
    "posture_grid": lambda path: figures.posture_grid([POSTURES[:2], POSTURES[2:]], path),
    "value_dots": lambda path: figures.value_dots(
        {name: [np.array([[0.44, 0.0], [0.43, 1.0]])] * 2 for name in ("CMA-ES", "SQP")},
        ["here", "there"],
        path,
    ),
    "tradeoff": lambda path: figures.tradeoff(
        {1.0: DOTS, 50.0: 1.001 * DOTS, 100.0: 3 * DOTS}, path, limit=0.03
    ),
    "error_map": lambda path: figures.error_map(EXACT, {"coarse": COARSE}, CURLED, path),
}


@pytest.mark.parametrize("name", DRAW)
def test_figure_is_written(name, tmp_path, monkeypatch):
    texts = drawn_texts(monkeypatch)
    path = DRAW[name](tmp_path / "made" / f"{name}.png")
    picture = imageio.imread(path)
    assert picture.ndim == 3 and min(picture.shape[:2]) > 100
    assert 0.01 < (picture[..., :3] < 250).any(axis=-1).mean() < 0.9  # neither blank nor full
    assert [file.name for file in path.parent.iterdir()] == [path.name]  # no temporary file is left
    check_apart(list(texts.values()))


def drawn_texts(monkeypatch):
    """The texts that are drawn from now on; those along contours and walls, which they lie on, left
    out.
    """
    from matplotlib.text import Text

    texts = {}
    draw = Text.draw

    def keep(self, renderer):
        draw(self, renderer)
        if self.get_visible() and self.get_text().strip() and self.get_rotation_mode() != "anchor":
            texts[id(self)] = self

    monkeypatch.setattr(Text, "draw", keep)
    return texts


def check_apart(texts):
    """Check that no text is cut off by the edge of its figure, and that none lies on another."""
    boxes = [
        (text.get_text(), np.reshape(text.get_window_extent().extents, (2, 2))) for text in texts
    ]
    size = np.array(texts[0].get_figure(root=True).bbox.size)
    for text, (low, high) in boxes:
        assert (low > -1).all() and (high < size + 1).all(), f"{text!r} is cut off"
    for (text, (low, high)), (other, (beside_low, beside_high)) in combinations(boxes, 2):
        overlap = np.minimum(high, beside_high) - np.maximum(low, beside_low)
        assert overlap.min() < 1, f"{text!r} lies on {other!r}"


@pytest.mark.parametrize(
    "name",
    [
        "trajectories",
        "final_distances",
        "mismatch_paths",
        "escape_times",
        "field_comparison",
        "error_map",
    ],
)
def test_figures_repeat_bit_for_bit(name, tmp_path):
    first, second = (DRAW[name](tmp_path / f"{k}.png").read_bytes() for k in range(2))
    assert first == second


@pytest.mark.parametrize(
    ("draw", "data"),
    [
        (figures.keyframes, PLANS[:1]),
        (figures.trajectories, [replace(PLANS[0], disturbed=None, contact=None)]),
        (figures.overview, [replace(PLANS[0], mode="rigid-carry", object_name="square")]),
        (figures.trajectories, [replace(PLANS[0], reference=PLANS[0].pose[:, :2], period=1.0)]),
        (figures.distance_bands, {"caging": {0.005: SERIES["caging"]}}),
        (figures.final_distances, {"caging": {"square": SERIES["caging"][:, -1]}}),
        (figures.robustness, {"combined": {"caging": ROW}}),
    ],
    ids=[
        "one plan",
        "no disturbed executions",
        "another mode and object",
        "reference",
        "one panel",
        "name",
        "one row",
    ],
)
def test_one_panel_is_enough(draw, data, tmp_path):
    assert draw(data, tmp_path / "one.png").is_file()


def test_one_field_shown_whole_is_enough(tmp_path):
    path = tmp_path / "one.png"
    assert figures.field_comparison(
        {"exact": EXACT}, CURLED[:1], WITHIN[:1], path, near=None
    ).is_file()
    assert figures.error_map(EXACT, FIELDS, CURLED[:1], path, near=None).is_file()


def test_single_curves_need_no_band(tmp_path):
    assert figures.over_time(
        {"caging": np.linspace(0, 1, 11)}, "caging", tmp_path / "curve.png"
    ).is_file()


def test_one_executed_path_and_one_shape_are_enough(tmp_path):
    assert figures.mismatch_paths(PLANS[:1], [EXECUTED[0][:1]], tmp_path / "paths.png").is_file()
    square = get_object("square")
    assert figures.shape_mismatches(square, [square], tmp_path / "shapes.png").is_file()


def test_the_close_up_contains_the_goal_and_the_true_objects_at_the_end():
    (x_min, x_max), (y_min, y_max) = end_box(list(zip(PLANS, EXECUTED, strict=True)))
    ends = np.stack([GOAL, *(run.pose[-1, :2] for runs in EXECUTED for run in runs)])
    assert (ends - 0.075 > [x_min, y_min]).all() and (ends + 0.075 < [x_max, y_max]).all()
    assert x_max - x_min >= y_max - y_min


def test_enclosed_points_stay_without_colour():
    assert not PANEL.open and np.isinf(PANEL.time).any()
    assert (
        np.isinf(PANEL.time).sum() > np.isinf(PANEL.field_map.T[PANEL.field_map.speed == 1]).sum()
    )
    assert PANEL.longest == SOLVED.solve().T[np.isfinite(SOLVED.solve().T)].max()


PLANAR_MODES = [name for name in MODES if name not in METHODS]


@pytest.mark.parametrize("together", [PLANAR_MODES, list(METHODS)], ids=["planar", "methods"])
def test_modes_of_one_figure_differ_in_colour_strangers_too(together):
    assert len(PLANAR_MODES) == 4 and set(METHODS) < set(MODES)
    names = [*together, "rigid-carry", "whole_arm"]
    assert len({mode_of(name, names).colour for name in names}) == len(names)
    assert mode_of("rigid-carry", names).label == "rigid-carry"


def test_importing_loads_no_matplotlib_and_drawing_no_pyplot(tmp_path):
    code = (
        "import sys, numpy as np; from evaluation import figures; early = 'matplotlib' in "
        "sys.modules\n"
        "figures.over_time({'caging': np.linspace(0, 1, 11)}, 'caging', sys.argv[1])\n"
        "print(early, 'matplotlib.pyplot' in sys.modules)"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "curve.png")]
    result = subprocess.run(command, capture_output=True, text=True, check=True, cwd=ROOT)
    assert result.stdout.split() == ["False", "False"]


def test_postures_without_opengl_are_drawn_in_the_plane_alone(tmp_path, monkeypatch):
    def no_opengl(*args, **kwargs):
        raise RenderingError("no OpenGL here")

    monkeypatch.setattr(SpaceFrames, "scene", no_opengl)
    with pytest.warns(UserWarning, match="in the plane alone: no OpenGL here"):
        flat = figures.posture_scenes(POSTURES[:1], tmp_path / "flat.png")
    monkeypatch.setattr(
        SpaceFrames, "scene", lambda *args, **kwargs: np.zeros((72, 72, 3), dtype=np.uint8)
    )
    both = figures.posture_scenes(POSTURES[:1], tmp_path / "both.png")
    flat_height, both_height = (imageio.imread(path).shape[0] for path in (flat, both))
    assert both_height > 1.5 * flat_height

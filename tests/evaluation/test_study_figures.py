"""Keyframes in space, tracking against caging, and trials under other plants."""

from __future__ import annotations

from contextlib import contextmanager
from dataclasses import replace
from types import SimpleNamespace

import gymnasium as gym
import imageio.v3 as imageio
import numpy as np
import pytest

from evaluation import evaluate, figures
from evaluation.figures import space, tracking, transfer
from evaluation.figures.animation import _few_colours, rollout_frames
from evaluation.figures.base import mix
from evaluation.figures.modes import mode_of
from evaluation.figures.tracking import weight_colours
from evaluation.studies.common import Case
from evaluation.studies.pictures import trajectory, watched
from piec_envs.dynamics.free_bodies import poses_at_start, upright
from piec_envs.errors import RenderingError
from piec_envs.rendering.colours import GOAL as GREEN
from piec_envs.rendering.colours import PALE
from piec_envs.rendering.space import SpaceFrames
from piec_envs.world.objects import get_object
from planners import OpenLoopPolicy

GOAL = np.array([0.2, -0.4])
STEPS = 100
SHARE = np.linspace(0, 1, STEPS + 1)[:, None]
CAGE = np.array([0.41590098, 0.319474, -0.98641672, -2.133729, 0.78505695])


def execution(contact="link", item="circle_119"):
    """A mobile Franka that carries an object to the goal in 100 s."""
    name = "mobile_franka" + ("" if contact == "whole_arm" else f"_{contact}") + "_capsules"
    pose = np.column_stack([[0.35, 0.1] + SHARE * (GOAL - [0.35, 0.1]), SHARE])
    q_r = CAGE + SHARE * [-0.15, -0.5, 0, 0, 0]
    body = get_object(item)
    loose = (
        np.stack([upright(body, poses_at_start(body, row))[1:] for row in pose])
        if body.loose
        else None
    )
    return figures.Trajectory(contact, name, item, GOAL, q_r, pose, period=1.0, loose=loose)


PLANS = [execution("point"), execution("whole_arm", "a4_box_roll_1")]


@pytest.fixture
def drawn(monkeypatch):
    """The figures that are written, in order."""
    kept = []
    for module in (space, tracking, transfer):
        original = module.figure_file

        @contextmanager
        def keep(*args, original=original):
            with original(*args) as figure:
                kept.append(figure)
                yield figure

        monkeypatch.setattr(module, "figure_file", keep)
    return kept


@pytest.fixture
def flat(monkeypatch):
    """A machine without OpenGL."""

    def no_opengl(*args, **kwargs):
        raise RenderingError("no OpenGL here")

    monkeypatch.setattr(SpaceFrames, "scene", no_opengl)


def written(path):
    """The picture of a file that stands alone in its folder and is neither blank nor full."""
    picture = imageio.imread(path)[..., :3]
    assert 0.01 < (picture < 250).any(axis=-1).mean() < 0.98
    assert [file.name for file in path.parent.iterdir()] == [path.name]
    return picture


def test_keyframes_in_space_ask_for_the_states_at_their_times(tmp_path, monkeypatch, drawn):
    asked = []

    def scene(self, robot, name, q, pose, marks, view, loose):
        asked.append((robot.name, name, q, pose, view, loose, len(marks)))
        return np.full((72, 72, 3), 120, dtype=np.uint8)

    monkeypatch.setattr(SpaceFrames, "scene", scene)
    written(figures.space_keyframes(PLANS, tmp_path / "keys.png"))
    steps = [0, 33, 66, 100]
    assert [call[:2] for call in asked] == [
        (plan.robot_name, plan.object_name) for plan in PLANS for _ in steps
    ]
    np.testing.assert_array_equal(
        [call[3] for call in asked], np.concatenate([plan.pose[steps] for plan in PLANS])
    )
    np.testing.assert_array_equal([call[2] for call in asked[4:]], PLANS[1].q_r[steps])
    assert all(call[5] is None for call in asked[:4])
    np.testing.assert_array_equal([call[5] for call in asked[4:]], PLANS[1].loose[steps])
    assert len({(*call[4].centre, call[4].half) for call in asked}) == 1  # one view for all
    assert asked[0][6] == 1 < asked[1][6] < asked[2][6]  # the goal, and a way that grows
    assert len(drawn[0].axes) == 8 and [ax.get_title() for ax in drawn[0].axes[:2]] == [
        "t = 0 s",
        "t = 33 s",
    ]
    assert [drawn[0].axes[k].texts[0].get_text() for k in (0, 4)] == ["point", "whole arm"]


def test_without_opengl_keyframes_are_drawn_in_the_plane(tmp_path, flat):
    shifted = PLANS[1].loose + np.array([0.3, 0, 0, 0, 0, 0, 0])
    pictures = []
    for k, plans in enumerate((PLANS, [PLANS[0], replace(PLANS[1], loose=shifted)])):
        with pytest.warns(UserWarning, match="in the plane: no OpenGL here"):
            pictures.append(
                written(
                    figures.space_keyframes(
                        plans, tmp_path / f"{k}" / "flat.png", times=(0.0, 50.0)
                    )
                )
            )
    rows = np.argwhere((pictures[0] != pictures[1]).any(axis=(1, 2))).ravel()
    # the loose body of the lower row alone
    assert len(rows) and rows.min() > 0.5 * len(pictures[0])


def test_loose_bodies_are_seen_in_keyframes_in_space(tmp_path):
    plan = PLANS[1]
    away = replace(plan, loose=plan.loose + np.array([0.2, 0.1, 0, 0, 0, 0, 0]))
    try:
        SpaceFrames().scene(plan.robot, plan.object_name, plan.q_r[0], plan.pose[0])
    except RenderingError as error:
        pytest.skip(str(error))
    first, second = (
        written(figures.space_keyframes([each], tmp_path / f"{k}" / "keys.png", times=(0.0,)))
        for k, each in enumerate((plan, away))
    )
    assert (first != second).any(axis=2).sum() > 100


def test_weights_are_told_apart_in_order():
    colours = weight_colours([1.0, 0.0, 0.1])
    assert list(colours) == [0.0, 0.1, 1.0] and len(set(colours.values())) == 3
    assert colours[0.0] == mode_of("contact").colour and colours[1.0] == mode_of("caging").colour


def test_tradeoff_shows_plans_and_means(tmp_path, drawn):
    points = {1.0: np.array([[0.5, 0.02], [0.6, 0.04]]), 0.0: np.array([[0.3, 0.01]])}
    written(figures.tradeoff(points, tmp_path / "a.png", limit=0.03))
    (ax,) = drawn[0].axes
    np.testing.assert_allclose(np.transpose(ax.lines[0].get_data()), [[0.3, 10], [0.55, 30]])
    assert [text.get_text() for text in ax.texts] == ["largest error of a success"]
    assert [text.get_text() for text in drawn[0].legends[0].get_texts()] == [
        "$\\lambda$ = 0",
        "$\\lambda$ = 1",
    ]
    offsets = np.concatenate([np.asarray(dots.get_offsets()) for dots in ax.collections])
    assert [0.6, 40] in np.round(offsets, 9).tolist()
    assert ax.lines[1].get_ydata()[0] == pytest.approx(30)


def test_reference_paths_show_ways_and_caging_of_each_weight(tmp_path, drawn):
    reference = PLANS[0].pose[:, :2] + [0.01, 0.0]
    tracked = [
        replace(PLANS[0], reference=reference, pose=PLANS[0].pose + shift) for shift in (0.0, 0.02)
    ]
    caging = np.linspace(0.5, 0.3, STEPS + 1)
    runs = {
        0.0: [figures.Tracked(tracked[0], caging)],
        2.0: [figures.Tracked(tracked[1], caging + 0.1), figures.Tracked(tracked[1], caging + 0.2)],
    }
    written(figures.reference_paths(runs, tmp_path / "refs.png"))
    left, right = drawn[0].axes
    assert len(left.lines) == 1 + 1 + 3  # the reference once, the start, three ways
    np.testing.assert_allclose(np.transpose(left.lines[0].get_data()), reference)
    np.testing.assert_allclose([line.get_ydata() for line in right.lines], [caging, caging + 0.15])
    # a range of two executions
    assert right.lines[0].get_xdata()[-1] == STEPS and len(right.collections) == 1
    labels = [text.get_text() for text in drawn[0].legends[0].get_texts()]
    assert labels == ["reference", "$\\lambda$ = 0", "$\\lambda$ = 2"]


def test_transfer_paths_have_a_panel_for_each_plant(tmp_path, drawn):
    trials = PLANS[0].pose + np.array([0.0, 0.02, 0.1])[:, None, None]
    plans = [
        replace(PLANS[0], mode=name, disturbed=trials[:count])
        for name, count in (("SM1", 2), ("SM2", 3))
    ]
    written(
        figures.transfer_paths([*plans, replace(PLANS[0], mode="SM3")], tmp_path / "transfer.png")
    )
    axes = drawn[0].axes
    assert [ax.get_title(loc="left") for ax in axes] == ["SM1", "SM2", "SM3"]
    assert [ax.get_title(loc="right") for ax in axes] == [
        f"{k} of {n} in the goal" for k, n in ((2, 2), (2, 3), (1, 1))
    ]
    np.testing.assert_array_equal(np.transpose(axes[1].lines[0].get_data()), PLANS[0].pose[:, :2])
    np.testing.assert_allclose(
        np.transpose(axes[1].lines[-2].get_data()), trials.mean(axis=0)[:, :2]
    )
    assert axes[1].lines[-1].get_xydata().tolist() == [[0.35, 0.1]]
    assert [len(ax.lines) for ax in axes] == [1 + 2 * 2 + 2, 1 + 2 * 3 + 2, 2]
    assert all(ax.get_xlim() == axes[0].get_xlim() for ax in axes)


def test_animations_show_pale_parts_and_the_base():
    def grey(plan):
        frame = next(iter(rollout_frames([plan], every=50)))
        face = 255 * np.array(mix("white", mode_of(plan.mode).colour, 0.3 * PALE))
        return (np.abs(frame - face).max(axis=2) < 2).sum()

    assert (
        grey(PLANS[0]) > 5000 > 100 > grey(replace(PLANS[0], robot_name="mobile_franka_capsules"))
    )
    first, second, *_ = rollout_frames([PLANS[0]], every=50)
    assert (first != second).any(axis=2).sum() > 5000


def test_rare_colours_survive_in_few_colours():
    ramp = np.linspace(60, 230, 200 * 200).reshape(200, 200)
    picture = np.stack([ramp, 0.9 * ramp, ramp + 20], axis=-1).astype(np.uint8)
    green = np.array([int(GREEN[k : k + 2], 16) for k in (1, 3, 5)])
    picture[5:12, 5:12] = green
    assert np.abs(_few_colours([picture])[0][8, 8].astype(int) - green).max() < 12


def test_a_watched_execution_has_its_loose_bodies(sweep_plan):
    plan = replace(sweep_plan, path=sweep_plan.path.copy())
    plant = {"object": "a4_box_roll_1", "dynamics": "mujoco"}
    seen = watched(plan, "executed", plant)
    same = evaluate(
        OpenLoopPolicy(plan), plan.env_id, "nominal", 1, 0, {**plant, "escape_field": None}
    )
    np.testing.assert_array_equal(seen.pose, same.pose[0])
    np.testing.assert_array_equal(seen.contact, same.contact[0])
    assert (
        seen.loose.shape == (1001, 1, 7)
        and np.linalg.norm(seen.loose[-1, 0, :2] - seen.loose[0, 0, :2]) > 0.05
    )
    assert seen.object_name == "a4_box_roll_1" and watched(plan, "planned", {}).loose is None


def test_executions_of_tracking_carry_their_reference():
    env_id = "piec_envs/PlanarArmTrack-v0"
    nominal = SimpleNamespace(
        q_r=np.zeros((1, 2, 4)), pose=np.zeros((1, 2, 3)), contact=np.zeros((1, 2, 4), dtype=bool)
    )
    drawn = trajectory(Case("caging", {}, {}, env_id), nominal)
    task = gym.make(env_id, escape_field=None).unwrapped.model.task
    np.testing.assert_array_equal(drawn.reference, task.reference)
    assert trajectory(Case("caging", {}), nominal).reference is None

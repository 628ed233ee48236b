"""Executions of plans as figures and films show them."""

from __future__ import annotations

from dataclasses import replace

import imageio.v3 as imageio
import numpy as np
import pytest
from trajectories import GOAL, PLANS, STEPS

from evaluation import figures
from evaluation.figures.animation import WIDTH, _few_colours, animation, rollout_frames
from evaluation.figures.scenes import keyframe_steps
from evaluation.figures.strip import strip_steps
from evaluation.figures.trajectory import bounds
from piec_envs.errors import InvalidParameterError, MissingDependencyError


def test_steps_start_with_the_first_contact():
    assert PLANS[0].first_contact == 20
    assert keyframe_steps(PLANS[0]) == [0, 20, 33, 46, STEPS]
    assert strip_steps(PLANS[0], 3) == [20, 40, STEPS]
    assert replace(PLANS[0], contact=None).first_contact is None
    assert replace(PLANS[0], contact=np.zeros((STEPS + 1, 4), dtype=bool)).first_contact is None


def test_success_is_counted_at_the_last_step():
    still = replace(PLANS[0], disturbed=np.stack([PLANS[0].pose, PLANS[0].pose + 0.1]))
    assert still.inside[:, -1].tolist() == [True, False]


def test_view_contains_the_goal_and_all_paths():
    (x_min, x_max), (y_min, y_max) = bounds(PLANS, [[STEPS]] * 3)
    points = np.concatenate(
        [GOAL[None], *(plan.disturbed[..., :2].reshape(-1, 2) for plan in PLANS)]
    )
    assert (points > [x_min, y_min]).all() and (points < [x_max, y_max]).all()


def test_animation_of_rollouts(tmp_path):
    path = figures.animate_rollouts(PLANS, tmp_path / "rollouts.gif", every=30)
    frames = imageio.imread(path, index=None)
    assert frames.shape[0] >= 3 and frames.shape[2] == WIDTH
    assert not np.array_equal(frames[0], frames[1])


def test_frames_have_an_even_size():
    frame = next(iter(rollout_frames(PLANS[:2], every=30)))
    assert frame.dtype == np.uint8 and frame.shape[0] % 2 == frame.shape[1] % 2 == 0


def test_animation_takes_a_folder_of_pictures(tmp_path):
    folder = tmp_path / "frames"
    folder.mkdir()
    for k in range(3):
        imageio.imwrite(folder / f"{k}.png", np.full((20, 30, 3), 80 * k, dtype=np.uint8))
    frames = imageio.imread(animation(folder, tmp_path / "movie.gif", fps=10), index=None)
    assert frames.shape == (3, 20, 30, 3)


def test_white_stays_white_in_few_colours():
    frame = next(iter(rollout_frames(PLANS[:1], every=60)))
    assert (_few_colours([frame])[0, 0, :5] == 255).all()


def test_animation_refuses_what_it_cannot_write(tmp_path, monkeypatch):
    with pytest.raises(InvalidParameterError, match=r"\.gif"):
        animation([np.zeros((4, 4, 3), dtype=np.uint8)], tmp_path / "movie.avi")
    with pytest.raises(InvalidParameterError, match="frame"):
        animation([], tmp_path / "movie.gif")
    monkeypatch.setattr("importlib.util.find_spec", lambda name: None)
    with pytest.raises(MissingDependencyError, match="video"):
        animation([np.zeros((4, 4, 3), dtype=np.uint8)], tmp_path / "movie.mp4")

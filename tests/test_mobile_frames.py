"""Pictures of arms on a base that slides, and of arms some of whose parts touch nothing."""

from __future__ import annotations

import gymnasium as gym
import numpy as np
import pytest
from matplotlib.patches import Rectangle

from piec_envs.errors import RenderingError
from piec_envs.model.task import MOBILE, mobile_franka_track
from piec_envs.rendering.colours import PALE
from piec_envs.rendering.drawing import draw_ghost, draw_robot
from piec_envs.rendering.frame import new_axis, pixels
from piec_envs.rendering.outlines import (
    arm_outlines,
    base_position,
    link_outlines,
    scenery_outlines,
)
from piec_envs.rendering.view import View, close_view, episode_view
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot

WHOLE, LINK, POINT = (
    get_robot(f"mobile_franka{kind}_capsules") for kind in ("", "_link", "_point")
)
CAGE = np.array([0.41590098, 0.319474, -0.98641672, -2.133729, 0.78505695])
MOVED = CAGE - [0.3, 0.5, 0.0, 0.0, 0.0]


def brightness(robot, q, at, draw):
    """How bright a grey arm on black is at a point (2,) m, in [0, 1]."""
    figure, ax = new_axis(200)
    ax.add_artist(Rectangle((-3, -3), 6, 6, facecolor="black", zorder=0))
    draw(ax, robot, q, facecolor="white")
    ax.set_xlim(at[0] - 0.4, at[0] + 0.4)
    ax.set_ylim(at[1] - 0.4, at[1] + 0.4)
    return pixels(figure)[98:102, 98:102].mean() / 255


@pytest.mark.parametrize(("draw", "full"), [(draw_robot, 1.0), (draw_ghost, 0.4)])
@pytest.mark.parametrize("q", [CAGE, MOVED], ids=["start", "moved"])
def test_parts_that_touch_nothing_are_pale_and_move_with_the_base(draw, full, q):
    forearm = scenery_outlines(POINT, q)[3].mean(axis=0)
    assert brightness(WHOLE, q, forearm, draw) == pytest.approx(full, abs=0.02)
    assert brightness(POINT, q, forearm, draw) == pytest.approx(PALE * full, abs=0.02)
    assert brightness(LINK, q, forearm, draw) == pytest.approx(PALE * full, abs=0.02)
    tip = link_outlines(POINT, q)[0][0].mean(axis=0)
    assert brightness(POINT, q, tip, draw) > PALE * full + 0.1


def test_outlines_of_the_arm_are_the_same_whatever_touches():
    whole, link = (np.concatenate(arm_outlines(robot, CAGE)) for robot in (WHOLE, LINK))
    assert sorted(whole.tolist()) == sorted(link.tolist()) and not scenery_outlines(WHOLE, CAGE)
    assert close_view(WHOLE, CAGE, get_object("circle_119"), MOBILE.start).half == pytest.approx(
        close_view(LINK, CAGE, get_object("circle_119"), MOBILE.start).half
    )


@pytest.mark.parametrize("task", [MOBILE, mobile_franka_track("left")], ids=["push", "track"])
def test_the_view_stands_still_while_the_base_slides(task):
    views = [episode_view(WHOLE, q, task) for q in np.linspace(CAGE, MOVED, 5)]
    assert all(
        np.array_equal(view.centre, views[0].centre) and view.half == views[0].half
        for view in views
    )
    named = np.vstack([task.start[:2], task.goal, task.reference, *arm_outlines(WHOLE, CAGE)])
    assert (np.abs(named - views[0].centre) < views[0].half).all()


def test_the_view_follows_a_base_that_leaves_without_a_jump():
    way = CAGE + np.linspace(0, 1, 101)[:, None] * [1.5, 1.6, 0.0, 0.0, 0.0]
    views = [episode_view(WHOLE, q, MOBILE) for q in way]
    centres = np.array([view.centre for view in views])
    assert np.abs(np.diff(centres, axis=0)).max() < 0.0161 and np.ptp(centres[:, 0]) > 0.5
    away = [
        np.abs(base_position(WHOLE, q) - view.centre).max()
        for q, view in zip(way, views, strict=True)
    ]
    assert max(away) < views[0].half - 0.49


def test_the_view_of_a_base_that_stands_is_its_workspace():
    robot = get_robot("franka_capsules")
    view = episode_view(robot, robot.home, MOBILE)
    assert (
        isinstance(view, View) and view.half == robot.workspace_radius and (view.centre == 0).all()
    )


def frames(renderer, contact):
    """Pictures of the same state before and after the base has moved, 0.2 m to the right and 0.3 m
    down.
    """
    # the capsules are thicker than the meshes of this cage: a small object is clear of them
    options = {
        "contact": contact,
        "geometry": "capsules",
        "start": CAGE.tolist(),
        "object": "water_jug",
        "escape_field": None,
    }
    env = gym.make(
        "piec_envs/MobileFrankaPush-v0", render_mode="rgb_array", renderer=renderer, **options
    ).unwrapped
    env.reset(seed=0)
    pictures = [env.render()]
    state = env.get_state()
    state.q_r[0, :2] += [0.2, -0.3]
    state.pose[0, :2] = 1.2, 0.9  # out of the way
    env.set_state(state)
    pictures.append(env.render())
    env.close()
    return pictures


def place(picture, green):
    """Mean row and column of what is green (the goal), or red (the edge of the workspace), and how
    many pixels.
    """
    r, g, b = np.moveaxis(picture.astype(int), -1, 0)
    mask = (g > r + 60) & (g > b + 20) if green else (r > g + 90) & (np.abs(g - b) < 40)
    return np.argwhere(mask).mean(axis=0), mask.sum()


@pytest.mark.parametrize("renderer", ["drawing", "mujoco"])
def test_the_goal_stays_where_it_is_and_the_workspace_goes_along(renderer):
    try:
        before, after = frames(renderer, "point")
    except RenderingError as error:
        pytest.skip(str(error))
    (goal, count) = place(before, green=True)
    (same, _) = place(after, green=True)
    assert count > 100 and np.abs(goal - same).max() < 3
    (edge, count) = place(before, green=False)
    (moved, _) = place(after, green=False)
    assert count > 300 and (moved - edge > 15).all()


def test_pale_parts_show_the_table_in_space():
    try:
        whole, point = (
            frames("mujoco", contact)[0].astype(int) for contact in ("whole_arm", "point")
        )
    except RenderingError as error:
        pytest.skip(str(error))
    blue = [(picture[..., 2] > picture[..., 0] + 60).sum() for picture in (whole, point)]
    assert blue[1] < 0.25 * blue[0] and blue[0] > 1000
    shaded = [
        ((picture.max(axis=2) < 170) & (np.ptp(picture, axis=2) < 15)).sum()
        for picture in (whole, point)
    ]
    assert shaded[1] < 0.7 * shaded[0]

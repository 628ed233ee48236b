"""Frames: their shape, what they depend on, and that drawing leaves no traces."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest

from piec_envs.env.config import EnvConfig
from piec_envs.errors import RenderingError, UnknownNameError
from piec_envs.escape.field import choose_field
from piec_envs.geometry.batched import robot_frames
from piec_envs.model.model import Model
from piec_envs.rendering.escape import picture_field
from piec_envs.rendering.field import FIELD_TOP, _filled
from piec_envs.rendering.frame import render_frame
from piec_envs.rendering.outlines import base_position, link_outlines
from piec_envs.rendering.view import close_view
from piec_envs.world.objects import OBJECTS, get_object
from piec_envs.world.robots import ROBOTS, get_robot

ROOT = Path(__file__).resolve().parents[1]
SIZE = 200  # small frames draw in half the time
CURLED = [0.3, 1.6, 1.6, 1.6]
ENCLOSING = [-0.34, 1.4, 1.96, 0.82]  # the point (0.3, 0.1)


def episode(task="planar_arm_push", **options):
    """What a frame is drawn of: a model, a state of it, and what is measured of that."""
    model = Model(EnvConfig(task=task, **options).resolve())
    state = model.begin([0], model.setup.plant)
    return model, state, model.measure(state).last


def test_frame_is_an_image_of_the_asked_size():
    frame = render_frame(*episode(), 0)
    assert frame.shape == (720, 720, 3) and frame.dtype == np.uint8
    assert render_frame(*episode(escape_field=None), 0, size=SIZE).shape == (SIZE, SIZE, 3)


def test_same_state_same_picture():
    trail = np.array([[0.5, 0.3], [0.55, 0.25]])
    assert np.array_equal(*(render_frame(*episode(), 0, trail, size=SIZE) for _ in range(2)))


@pytest.mark.parametrize(
    "change",
    [
        lambda state, measured: state.q_r.__setitem__(0, CURLED),
        lambda state, measured: state.pose.__setitem__((0, 0), 0.4),
        lambda state, measured: measured.contact.__setitem__((0, 1), True),
        lambda state, measured: state.step.__setitem__(0, 500),
    ],
    ids=["robot", "object", "contact", "time"],
)
def test_picture_follows_the_state(change):
    model, state, measured = episode()
    before = render_frame(model, state, measured, 0, size=SIZE)
    change(state, measured)
    assert not np.array_equal(before, render_frame(model, state, measured, 0, size=SIZE))


def test_field_trail_and_reference_are_drawn():
    plain = render_frame(*episode(escape_field=None), 0, size=SIZE)
    trail = np.column_stack([np.linspace(-0.5, 0.5, 20), np.full(20, -0.6)])
    assert not np.array_equal(plain, render_frame(*episode(), 0, size=SIZE))
    assert not np.array_equal(plain, render_frame(*episode(escape_field=None), 0, trail, size=SIZE))
    assert not np.array_equal(
        plain, render_frame(*episode("planar_arm_track", escape_field=None), 0, size=SIZE)
    )


@pytest.mark.parametrize("name", OBJECTS)
def test_every_object_is_drawn(name):
    frame, *others = (
        render_frame(*episode(object=each, escape_field=None, dynamics="mujoco"), 0, size=SIZE)
        for each in (name, *(other for other in OBJECTS if other != name))
    )
    assert not any(np.array_equal(frame, other) for other in others)


def test_loose_bodies_are_drawn_where_they_are():
    model, state, measured = episode(object="a4_box_roll_1", escape_field=None, dynamics="mujoco")
    before = render_frame(model, state, measured, 0, size=SIZE)
    memory = state.memory[0].copy()
    memory[12] -= 0.5  # x of the roll, after the time, four joints and the box
    state.memory[0] = memory
    after = render_frame(model, state, measured, 0, size=SIZE)
    x = np.argwhere((before != after).any(axis=2))[:, 1]
    # it has left one place for the other
    assert np.ptp(x) * 2 * 1.4 * 1.03 / SIZE == pytest.approx(0.6, abs=0.03)


@pytest.mark.parametrize("name", ROBOTS)
def test_outlines_sit_on_their_frames(name):
    robot = get_robot(name)
    q = 0.1 + 0.5 * robot.home
    frames = robot_frames(robot.name, q)
    for link, outlines in zip(robot.links, link_outlines(robot, q), strict=True):
        reach = max(
            float(np.linalg.norm(shape.vertices, axis=1).max()) + shape.radius
            for shape in link.shapes
        )
        offsets = np.concatenate(outlines) - frames[link.frame, :2]
        assert np.linalg.norm(offsets, axis=1).max() == pytest.approx(reach, rel=0.02)
    assert np.isfinite(base_position(robot, q)).all()


def test_picture_of_an_enclosed_place_is_finite_and_dark():
    field = picture_field("planar_arm", choose_field("auto", "planar_arm").speed)
    field_map = field.solve(np.array(ENCLOSING))
    shown = _filled(field_map, field.speed)
    assert np.isfinite(shown).all() and shown.min() >= 0
    inside = shown[np.abs(field_map.y - 0.1).argmin(), np.abs(field_map.x - 0.3).argmin()]
    assert inside == shown.max() == FIELD_TOP


def test_drawing_does_not_touch_pyplot_and_importing_does_not_load_matplotlib():
    code = (
        "import sys, numpy as np, piec_envs, piec_envs.rendering.frame; early = 'matplotlib' in "
        "sys.modules\n"
        "from piec_envs.env.makers import make_model\n"
        "model = make_model('piec_envs/PlanarArmPush-v0'); state = model.reset(0)\n"
        "piec_envs.rendering.frame.render_frame(model, state, model.measure(state).last, 0, "
        "size=100)\n"
        "print(early, 'matplotlib.pyplot' in sys.modules)"
    )
    result = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, cwd=ROOT
    )
    assert result.stdout.split() == ["False", "False"]


def spatial(maker=gym.make, env_id="piec_envs/PlanarArmPush-v0", **options):
    return maker(
        env_id, render_mode="rgb_array", renderer="mujoco", **{"escape_field": None, **options}
    )


@pytest.fixture(scope="module")
def space():
    """An env with frames in space; no test that asks for it runs where there is no OpenGL."""
    env = spatial()
    env.reset(seed=0)
    try:
        env.render()
    except RenderingError as error:
        pytest.skip(str(error))
    yield env
    env.close()


def at(env, pose, q=(0.0, 0.0, 0.0, 0.0)):
    env.reset(seed=0, options={"state": {"pose": pose, "q_r": q}})
    return env.render()


def where(frame, red_first):
    """Mean row and column of the pixels of the object's colour, or of the goal's, and how many they
    are.
    """
    red, green, blue = np.moveaxis(frame.astype(int), -1, 0)
    mask = (
        (red > green + 40) & (green > blue + 40)
        if red_first
        else (green > red + 60) & (green > blue + 20)
    )
    return np.argwhere(mask).mean(axis=0), mask.sum()


@pytest.mark.parametrize("maker", [gym.make, gym.make_vec])
def test_unknown_renderer_is_refused(maker):
    with pytest.raises(UnknownNameError, match="drawing, mujoco"):
        maker("piec_envs/PlanarArmPush-v0", renderer="opengl")


def test_frames_in_space_follow_the_state(space):
    first = at(space, [0.5, 0.4, 0.0])
    assert first.shape == (720, 720, 3) and first.dtype == np.uint8
    moved = at(space, [0.1, 0.4, 0.0])
    bent = at(space, [0.5, 0.4, 0.0], CURLED)
    assert np.array_equal(first, at(space, [0.5, 0.4, 0.0]))
    assert not np.array_equal(first, moved) and not np.array_equal(first, bent)


def test_object_and_goal_stand_where_they_should(space):
    (row, column), count = where(at(space, [0.5, 0.4, 0.0]), red_first=True)
    (moved_row, moved_column), _ = where(at(space, [-0.5, -0.4, 0.0]), red_first=True)
    assert count > 200 and column > 400 and moved_column < 320 and moved_row > row + 50
    (_, column), count = where(at(space, [0.5, 0.4, 0.0]), red_first=False)
    assert count > 100 and 260 < column < 320


def test_loose_bodies_stand_in_space_where_they_are(space):
    env = spatial(object="a4_box_roll_1", dynamics="mujoco").unwrapped
    env.reset(seed=0)
    before = env.render()
    state = env.get_state()
    state.memory[0] = state.memory[0].copy()
    state.memory[0][12] -= 0.5  # x of the roll, after the time, four joints and the box
    env.set_state(state)
    columns = np.argwhere((before != env.render()).any(axis=2))[:, 1]
    assert np.ptp(columns) > 720 * 0.5 / 3
    env.close()


def test_every_row_has_its_frame_and_closing_leaves_the_others(space):
    vector = spatial(
        gym.make_vec,
        "piec_envs/PlanarArmTrack-v0",
        num_envs=2,
        object="square",
        start_noise=[0.05, 0.1],
    )
    vector.reset(seed=0)
    frames = vector.render()
    assert len(frames) == 2 and not np.array_equal(*frames)
    before = at(space, [0.5, 0.4, 0.0])
    vector.close()  # while the other context is the current one
    assert np.array_equal(before, space.render())


@pytest.mark.parametrize("pose", [(0.1, 0.3, 0.0), (-0.35, 0.0, 0.0), (0.0, -0.39, 0.0)], ids=str)
def test_a_static_posture_is_seen_from_nearer(space, pose):
    env = spatial(
        gym.make, "piec_envs/FrankaCage-v0", geometry="capsules", escape_field="grid", pose=pose
    )
    env.reset(seed=0)
    start = env.render()
    env.step(np.array([0.9, 0.2, -0.5]))
    assert start.shape == (720, 720, 3) and not np.array_equal(start, env.render())
    assert where(start, red_first=True)[1] > 1000  # the jug
    env.close()


def test_a_close_view_holds_robot_and_object():
    robot = get_robot("franka_capsules")
    item = get_object("box")
    rng = np.random.default_rng(0)
    for q in rng.uniform(robot.joint_array("lower"), robot.joint_array("upper"), (20, 3)):
        pose = rng.uniform([-0.5, -0.5, -3], [0.5, 0.5, 3])
        centre, half = close_view(robot, q, item, pose)
        shown = np.concatenate(
            [*(o for link in link_outlines(robot, q) for o in link), pose[None, :2]]
        )
        assert (np.abs(shown - centre) < half).all() and half < 1.3


RENDER = (
    "import sys\nif 'early' in sys.argv: import mujoco\n"
    "import gymnasium as gym, piec_envs\n"
    "env = gym.make('piec_envs/PlanarArmPush-v0', render_mode='rgb_array', renderer='mujoco', "
    "escape_field=None)\n"
    "env.reset(seed=0); print(env.render().shape)"
)


def run_python(code, *arguments, **variables):
    kept = {
        name: value
        for name, value in os.environ.items()
        if name not in ("MUJOCO_GL", "PYOPENGL_PLATFORM")
    }
    command = [sys.executable, "-c", code, *arguments]
    return subprocess.run(
        command, capture_output=True, text=True, cwd=ROOT, env={**kept, **variables}
    )


def test_an_env_left_open_ends_in_silence(space):
    result = run_python(RENDER, "early")  # MuJoCo imported first, and no backend chosen
    assert result.returncode == 0 and result.stdout.split("\n")[0] == "(720, 720, 3)"
    assert "Error" not in result.stderr and "ignored" not in result.stderr


def test_without_opengl_the_error_says_what_to_do():
    result = run_python(RENDER, MUJOCO_GL="off")
    last = result.stderr.strip().splitlines()[-1]
    assert result.returncode == 1 and "RenderingError" in last
    assert "'off'" in last and "MUJOCO_GL=egl" in last and "renderer='drawing'" in last

"""What pictures say of ways out: free, through the wall, or none, held against a flood of the free
plane.
"""

from __future__ import annotations

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from piec_envs.escape.samples import robot_distance
from piec_envs.escape.speed import SpeedModel
from piec_envs.geometry.batched import robot_frames
from piec_envs.rendering.escape import (
    ENCLOSED,
    FREE,
    LEAKS,
    Escape,
    draw_escape,
    picture_field,
    runs,
    solve_escape,
    wall_depth,
    way_handles,
)
from piec_envs.rendering.field import FIELD_TOP, field_top
from piec_envs.rendering.frame import new_axis
from piec_envs.world.objects import get_object
from piec_envs.world.robots import get_robot

CIRCLE = get_object("circle")
CAGE = np.array([-0.34, 1.4, 1.96, 0.82])  # around (0.3, 0.1)
NODES = 561  # a side of the flooded plane
SPEED = SpeedModel()


def floods(q, pose, margin):
    """Whether the edge of the workspace is reached from the object, where d > d0 + margin
    is free.
    """
    radius = get_robot("planar_arm").workspace_radius
    axis = np.linspace(-radius, radius, NODES)
    nodes = np.stack(np.meshgrid(axis, axis), axis=-1)
    free = (
        robot_distance("planar_arm", nodes.reshape(-1, 2), q).reshape(NODES, NODES)
        > SPEED.d0 + margin
    )
    free |= np.hypot(*nodes.transpose(2, 0, 1)) >= radius
    parts, _ = label(free)
    j, i = np.rint((pose[:2] + radius) / (axis[1] - axis[0])).astype(int)
    return parts[i, j] > 0 and parts[i, j] == parts[0, 0]


@settings(max_examples=40)
@given(
    st.floats(-3.1, 3.1),
    st.lists(st.floats(0.8, 2.2), min_size=3, max_size=3),
    st.lists(st.floats(-0.2, 0.2), min_size=2, max_size=2),
)
def test_what_is_enclosed_is_what_a_flood_does_not_leave(turn, curl, shift):
    q = np.array([turn, *curl])
    pose = np.array([*robot_frames("planar_arm", q)[:, :2].mean(axis=0) + shift, 0.0])
    escape = solve_escape("planar_arm", CIRCLE, pose, q)
    # either side of what two grids may see otherwise
    wide = floods(q, pose, 0.015)
    narrow = floods(q, pose, -0.015)
    if wide == narrow and robot_distance("planar_arm", pose[None, :2], q)[0] > SPEED.d0 + 0.015:
        assert escape.enclosed != wide
        # the only way leads through the wall
        assert wide or (escape.walled.any() and escape.caging > 0.4)


def test_the_way_out_of_a_cage_is_dashed_and_a_free_one_is_not():
    caged = solve_escape("planar_arm", CIRCLE, np.array([0.3, 0.1, 0.0]), CAGE)
    free = solve_escape("planar_arm", CIRCLE, np.array([-0.6, -0.4, 0.0]), CAGE)
    assert caged.enclosed and not free.enclosed and not free.walled.any()
    for escape, styles in ((caged, ["--"]), (free, ["-"])):
        _, ax = new_axis(100)
        draw_escape(ax, escape)
        assert [line.get_linestyle() for line in ax.lines] == styles


def test_only_the_part_in_the_wall_is_dashed_where_there_is_a_free_way():
    caged = solve_escape("planar_arm", CIRCLE, np.array([0.3, 0.1, 0.0]), CAGE)
    leaky = Escape(caged.field_map, caged.way, caged.walled, False, caged.caging)
    _, ax = new_axis(100)
    draw_escape(ax, leaky)
    assert [line.get_linestyle() for line in ax.lines] == ["-", "--", "-"]
    depth = wall_depth(picture_field("planar_arm", SPEED), caged.way, CAGE)
    assert (depth[caged.walled] >= 0).all() and depth[~caged.walled].max() < 0.01  # m
    first = [line.get_xydata()[0] for line in ax.lines[1:]]
    assert np.allclose(first, [line.get_xydata()[-1] for line in ax.lines[:-1]])  # without gaps
    assert [handle.get_label() for handle in way_handles([caged, leaky])] == [FREE, LEAKS, ENCLOSED]


def test_a_hard_wall_leaves_an_enclosed_object_without_a_way():
    escape = solve_escape(
        "planar_arm", CIRCLE, np.array([0.3, 0.1, 0.0]), CAGE, SpeedModel(leak=0.0)
    )
    assert escape.enclosed and len(escape.way) == 1 and np.isinf(escape.caging)
    _, ax = new_axis(100)
    draw_escape(ax, escape)


@given(st.lists(st.floats(0.0, 5.0) | st.just(np.inf), max_size=6))
def test_colours_reach_up_to_all_captions(values):
    top = field_top(values)
    assert all(value <= top + 1e-6 for value in values if np.isfinite(value)) and top >= FIELD_TOP
    assert top == FIELD_TOP or top - 0.2 < max(value for value in values if np.isfinite(value))


@given(st.lists(st.booleans(), min_size=1, max_size=12))
def test_runs_cover_all_flags_once(flags):
    stretches = runs(np.array(flags))
    assert np.concatenate([np.arange(len(flags))[run] for run in stretches]).tolist() == list(
        range(len(flags))
    )
    assert [flags[run.start] for run in stretches] == [
        flags[0] ^ bool(k % 2) for k in range(len(stretches))
    ]
    assert all(len(set(flags[run])) == 1 for run in stretches)

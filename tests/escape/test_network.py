"""The compiled learned field: laws that hold whatever its weights are."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from piec_envs.errors import InvalidStateError, WeightsError
from piec_envs.escape import SpeedModel, make_field
from piec_envs.escape.network import NetworkField
from piec_envs.escape.samples import draw_configurations, robot_distance
from piec_envs.escape.weights import INPUTS
from piec_envs.world.robots import ROBOTS, get_robot

ROOT = Path(__file__).resolve().parents[2]
ALL_ROBOTS = [*ROBOTS, "sliding_arm"]
SIZES = [(4, 1), (8, 2), (64, 2), (32, 4)]  # width, depth
Q = np.array([0.3, 0.9, 1.1, 0.7])
R = 1.4
U_BAR = 0.05


def draw(robot_name, rows, k, seed=0, clearance=0.01):
    """Configurations, half of them curled, and points inside the disc and outside the robot.

    They are clear of the parts that touch nothing, too: the angles that a point sees are singular
    on the skeleton.
    """
    rng = np.random.default_rng(seed)
    robot = get_robot(robot_name)
    q = np.concatenate(
        [draw_configurations(robot_name, kind, rows, rng) for kind in ("curled", "uniform")]
    )
    q = q[rng.permutation(len(q))[:rows]]
    points = np.empty((rows, k, 2))
    for row, places in zip(q, points, strict=True):
        for i in range(k):
            while True:
                angle = rng.uniform(0, 2 * np.pi)
                radius = rng.uniform(0.0, 0.98 * robot.workspace_radius)
                places[i] = row[: robot.base_dof] if robot.base_dof else 0.0
                places[i] += radius * np.array([np.cos(angle), np.sin(angle)])
                if robot_distance(robot.whole_name, places[i : i + 1], row)[0] > clearance:
                    break
    return q, points


def relative(found, true):
    """Error of vectors along the last axis, relative to their norms, or to a tenth of the mean
    norm.
    """
    size = np.linalg.norm(true, axis=-1)
    return np.linalg.norm(found - true, axis=-1) / np.maximum(size, 0.1 * size.mean())


@pytest.mark.parametrize("any_robot", ALL_ROBOTS, indirect=True)
@pytest.mark.parametrize("inputs", INPUTS)
@pytest.mark.parametrize(("width", "depth"), SIZES)
def test_kernel_is_its_readable_twin(any_robot, inputs, width, depth, random_weights):
    torch = pytest.importorskip("torch")
    from piec_envs.escape.training.reference import FieldModule, Geometry

    weights = random_weights(inputs, width, depth, any_robot)
    q, points = draw(any_robot, 40, 3)
    p = torch.tensor(points.reshape(-1, 2), requires_grad=True)
    rows = torch.tensor(np.repeat(q, 3, axis=0), requires_grad=True)
    field = NetworkField(any_robot, weights, threads=1)
    geometry = Geometry(any_robot, inputs, SpeedModel())
    T = geometry.time(FieldModule.of(weights).double(), p, rows)
    slopes = torch.autograd.grad(T.sum(), (p, rows))
    seen = geometry.describe(p, rows).detach().numpy().reshape(40, 3, -1)
    np.testing.assert_allclose(field.describe(points, q), seen, rtol=1e-5, atol=1e-6)
    found = field.gradients(points, q)
    assert relative(found[0].reshape(-1, 1), T.detach().numpy()[:, None]).max() < 1e-5
    for answer, slope in zip(found[1:], slopes, strict=True):
        error = relative(answer.reshape(len(p), -1), slope.numpy())
        # links that nearly touch magnify rounding
        assert np.quantile(error, 0.98) < 1e-5 and error.max() < 1e-4


@pytest.mark.parametrize("any_robot", ALL_ROBOTS, indirect=True)
@pytest.mark.parametrize("inputs", INPUTS)
def test_gradients_are_finite_differences(any_robot, inputs, random_weights):
    field = NetworkField(any_robot, random_weights(inputs, robot=any_robot))
    h = 1e-3
    q, points = draw(any_robot, 60, 2)
    T, dT_dp, dT_dq = field.gradients(points, q)
    assert (field.query(points, q) == T).all() and (
        field.point_gradients(points, q)[1] == dT_dp
    ).all()
    slope_p = [
        (field.query(points + e, q) - field.query(points - e, q)) / (2 * h) for e in h * np.eye(2)
    ]
    # single precision: times vary less with the joints than with the point
    steps = 2 * h * np.eye(q.shape[1])
    slope_q = [(field.query(points, q + e) - field.query(points, q - e)) / (4 * h) for e in steps]
    for found, slope in ((dT_dp, slope_p), (dT_dq, slope_q)):
        error = relative(found, np.stack(slope, axis=-1))
        # rounding, and a few kinks
        assert np.median(error) < 2e-3 and np.quantile(error, 0.95) < 0.02


@settings(max_examples=30)
@given(st.integers(1, 70), st.integers(1, 5), st.integers(1, 4), st.sampled_from(INPUTS))
def test_a_row_of_a_batch_is_the_single_query_bit_for_bit(random_weights, rows, k, threads, inputs):
    weights = random_weights(inputs)
    q, points = draw("planar_arm", 70, 5)
    q = q[:rows]
    points = points[:rows, :k]
    batch = NetworkField("planar_arm", weights, threads=threads).gradients(points, q)
    single = NetworkField("planar_arm", weights, threads=1)
    for row in {0, rows // 2, rows - 1}:
        for answer, alone in zip(batch, single.gradients(points[row], q[row]), strict=True):
            assert (answer[row] == alone).all()
        for i in range(k):
            assert (single.query(points[row, i : i + 1], q[row]) == batch[0][row, i]).all()


def test_empty_batches(random_weights):
    field = NetworkField("planar_arm", random_weights())
    assert [a.shape for a in field.gradients(np.empty((0, 3, 2)), np.empty((0, 4)))] == [
        (0, 3),
        (0, 3, 2),
        (0, 3, 4),
    ]
    assert [a.shape for a in field.gradients(np.empty((0, 2)), Q)] == [(0,), (0, 2), (0, 4)]


def test_turning_the_arm_and_the_points_changes_nothing(random_weights):
    field = NetworkField("planar_arm", random_weights(width=32))
    q, points = draw("planar_arm", 100, 3)
    T, dT_dp, dT_dq = field.gradients(points, q)
    for angle in (0.7, -2.0, np.pi):
        turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        turned = field.gradients(points @ turn.T, q + np.array([angle, 0, 0, 0]))
        np.testing.assert_allclose(turned[0], T, rtol=1e-5)
        assert (
            relative(turned[1], dT_dp @ turn.T).max() < 1e-4
            and relative(turned[2], dT_dq).max() < 1e-4
        )


@pytest.mark.parametrize("inputs", INPUTS)
def test_time_is_zero_from_the_circle_on(inputs, random_weights):
    field = NetworkField("planar_arm", random_weights(inputs))
    angle = np.linspace(0, 2 * np.pi, 12)
    ring = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.concatenate([R * (1 + 1e-12) * ring, 1.1 * R * ring, 1e6 * ring])
    for answer in field.gradients(points, Q):
        assert (answer == 0).all()
    assert (field.query(0.999 * R * ring, Q) > 0).all()


@pytest.mark.parametrize("rise", [1.0, 30.0])
def test_time_is_never_below_the_free_straight_line(rise, random_weights):
    q, points = draw("planar_arm", 200, 5, clearance=-1.0)
    bound = (R - np.hypot(*points.transpose(2, 0, 1))) / U_BAR
    T = NetworkField("planar_arm", random_weights(rise=rise)).query(points, q)
    assert (bound <= T).all() and np.isfinite(T).all()


@pytest.mark.parametrize("inputs", INPUTS)
def test_answers_are_finite_on_the_skeleton_itself(inputs, random_weights):
    field = NetworkField("planar_arm", random_weights(inputs))
    points = np.zeros((4, 2))
    points[:, 0] = 0.0, 0.4, 0.6, 1.2  # the base, a joint, a link and the wrist of the straight arm
    assert all(np.isfinite(answer).all() for answer in field.gradients(points, np.zeros(4)))
    q, _ = draw("planar_arm", 200, 1)
    along = np.linspace(-0.01, 0.41, 100)[None, :, None] * np.stack(
        [np.cos(q[:, :1]), np.sin(q[:, :1])], axis=-1
    )
    for aside in (0.0, 1e-7, 1e-5):
        assert all(np.isfinite(answer).all() for answer in field.gradients(along + aside, q))
        if inputs == "skeleton":
            # sines below 1, lengths below 2 m
            assert np.abs(field.describe(along + aside, q)).max() < 2


def test_bad_questions_are_refused(random_weights):
    field = NetworkField("planar_arm", random_weights())
    for points, q in (
        (np.full((1, 2), np.nan), Q),
        (np.zeros((1, 2)), np.full(4, np.inf)),
        (np.zeros((1, 3)), Q),
        (np.zeros(2), Q),
        (np.zeros((1, 2)), Q[:3]),
        (np.zeros((2, 1, 2)), np.stack([Q] * 3)),
    ):
        for ask in (field.query, field.point_gradients, field.gradients):
            with pytest.raises(InvalidStateError, match=r"finite|must be"):
                ask(points, q)


def test_a_map_holds_the_networks_values_and_a_path_falls_to_the_circle(random_weights):
    field = NetworkField("planar_arm", random_weights(rise=0.2))
    drawn = field.solve(Q)
    nodes = np.stack(np.meshgrid(drawn.x, drawn.y), axis=-1)
    np.testing.assert_array_equal(drawn.T.ravel(), field.query(nodes.reshape(-1, 2), Q))
    assert drawn.T.max() > 1.2 * R / U_BAR and (drawn.speed > 0).all()
    _, points = draw("planar_arm", 8, 1, clearance=0.05)
    for point in points[:, 0]:
        path = field.escape_path(point, Q)
        T = field.query(path, Q)
        assert (path[0] == point).all() and len(path) > 2
        assert (np.diff(T) < 0).all() and T[-1] == 0
        assert np.hypot(*path[-1]) == pytest.approx(R)


def test_a_field_of_a_file_is_remade_from_its_spec(random_weights, tmp_path):
    file = random_weights("raw").save(tmp_path / "my.npz")
    field = make_field("network", weights=str(file))
    spec = json.loads(json.dumps(field.spec()))
    assert spec == {"name": "network", "robot_name": "planar_arm", "weights": str(file)}
    points = np.array([[0.4, 0.3], [-0.5, 0.8]])
    assert make_field(**spec) is field
    assert (NetworkField("planar_arm", file).query(points, Q) == field.query(points, Q)).all()
    with pytest.raises(WeightsError, match="save them"):
        NetworkField("planar_arm", field.weights).spec()


NO_TORCH = """
import sys
sys.modules["torch"] = None
import numpy as np, piec_envs
from piec_envs.errors import MissingDependencyError
from piec_envs.escape import make_field
from piec_envs.escape.training import RECIPES, train_field
print(make_field("network", weights=sys.argv[1]).query(np.array([[0.4, 0.3]]), np.zeros(4))[0])
try:
    train_field("network", progress=False)
except MissingDependencyError as error:
    print(error)
from evaluation.cli import main
print(main(["train-field", "--out", sys.argv[2]]))
"""


def test_asking_needs_no_torch_and_training_says_that_it_does(random_weights, tmp_path):
    file = random_weights().save(tmp_path / "my.npz")
    command = [sys.executable, "-c", NO_TORCH, str(file), str(tmp_path / "out")]
    done = subprocess.run(
        command,
        capture_output=True,
        text=True,
        cwd=ROOT,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 0, done.stderr
    lines = done.stdout.splitlines()
    assert (
        float(lines[0])
        == make_field("network", weights=str(file)).query(np.array([[0.4, 0.3]]), np.zeros(4))[0]
    )
    assert "extra 'learn'" in lines[1] and lines[-1] == "2"
    assert "piec train-field: error: 'torch' is not installed" in done.stderr
    assert not (tmp_path / "out").exists()

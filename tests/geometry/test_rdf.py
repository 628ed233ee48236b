"""The robot distance field: against the exact distance, its readable twin, differences; and its
file.
"""

from __future__ import annotations

import json

import numpy as np
import pytest

from piec_envs.errors import (
    DistanceFieldError,
    InvalidParameterError,
    InvalidStateError,
    UnknownNameError,
)
from piec_envs.geometry.convex import convex_hull
from piec_envs.geometry.rdf import panda_distance_field, panda_shapes
from piec_envs.geometry.rdf.file import load_shapes, save_shapes
from piec_envs.geometry.rdf.fit import exact_distance, fit_shape, spread_points
from piec_envs.geometry.rdf.shape import arm_reference, bernstein, bernstein_slope, evaluate
from piec_envs.world.robots.panda import BODIES, LOWER, UPPER, mesh_of, mesh_vertices

LOW_DEGREE = 6


@pytest.fixture(scope="module")
def field():
    return panda_distance_field()


def draw(rows, k, seed=0):
    rng = np.random.default_rng(seed)
    return rng.uniform([-0.8, -0.8, -0.4], [0.8, 0.8, 1.2], (rows, k, 3)), rng.uniform(
        LOWER, UPPER, (rows, 7)
    )


def test_basis_sums_to_one_and_has_the_slope_of_its_differences():
    u = np.linspace(0.01, 0.99, 20)
    h = 1e-6
    np.testing.assert_allclose(bernstein(9, u).sum(axis=-1), 1)
    difference = (bernstein(9, u + h) - bernstein(9, u - h)) / (2 * h)
    np.testing.assert_allclose(bernstein_slope(9, u), difference, atol=1e-8)


@pytest.mark.parametrize("name", ["link1", "link7", "hand", "finger"])
def test_a_body_is_met_within_2_mm_on_average(name):
    shape = panda_shapes()[name]
    hull = convex_hull(mesh_vertices("left finger" if name == "finger" else name))
    points = spread_points(shape.box, 8000, np.random.default_rng(1))
    true = exact_distance(hull, points)
    d, slope = evaluate(shape.weights, shape.box, points)
    error = np.abs(d - true)
    norm = np.linalg.norm(slope, axis=1)
    near = (true > 0) & (true < 0.2)
    inside = true <= 0
    assert error.max() < shape.slack
    assert error[near].mean() < 0.5e-3 and error[inside].mean() < 1.5e-3
    spread = np.arange(8000) < 4000  # the others crowd at the surface
    assert np.mean(np.abs(norm[near & spread] - 1) < 0.05) > 0.9
    assert shape.error["outside"] == pytest.approx(error[near].mean(), rel=0.2)


def test_kernels_match_their_readable_twin(field):
    points, q = draw(3, 60)
    for d, twin in zip(
        field.gradients(points, q),
        zip(
            *(
                arm_reference(panda_shapes(), field.bodies, p, row)
                for p, row in zip(points, q, strict=True)
            ),
            strict=True,
        ),
        strict=True,
    ):
        np.testing.assert_allclose(d, np.stack(twin), atol=1e-7)


def test_gradients_match_differences(field):
    points, q = draw(5, 60, seed=1)
    d, in_p, in_q = field.gradients(points, q)
    np.testing.assert_allclose(d, field.distance(points, q), atol=1e-12)
    h = 1e-5
    for axis, step in enumerate(h * np.eye(3)):
        difference = (field.distance(points + step, q) - field.distance(points - step, q)) / (2 * h)
        # the rest lies on a ridge
        assert np.quantile(np.abs(difference - in_p[..., axis]), 0.97) < 1e-4
    for joint, step in enumerate(h * np.eye(7)):
        difference = (field.distance(points, q + step) - field.distance(points, q - step)) / (2 * h)
        assert np.quantile(np.abs(difference - in_q[..., joint]), 0.97) < 1e-4


def test_far_away_the_way_to_the_box_is_added(field):
    points, q = draw(1, 50, seed=2)
    far = 20 * points
    d, in_p, _ = field.gradients(far, q)
    exact = np.linalg.norm(far, axis=-1)
    assert (np.abs(d - exact) < 1.2).all()
    assert np.median(np.abs(np.linalg.norm(in_p, axis=-1) - 1)) < 0.01


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_are_those_of_single_queries_bit_for_bit(field, threads):
    points, q = draw(7, 5)
    batch = panda_distance_field(threads=threads).gradients(points, q)
    for row in range(7):
        for a, b in zip(batch, field.gradients(points[row], q[row]), strict=True):
            assert (a[row] == b).all()


def test_bodies_can_be_chosen(field):
    points, q = draw(2, 40)
    each = [panda_distance_field(bodies=(body,)).distance(points, q) for body in BODIES]
    np.testing.assert_allclose(
        panda_distance_field(bodies=BODIES).distance(points, q), np.min(each, axis=0), atol=1e-9
    )
    np.testing.assert_allclose(field.distance(points, q), np.min(each[1:], axis=0), atol=1e-9)


def test_what_is_refused(field):
    points, q = draw(2, 4)
    for bad in ((points[0], q), (points[..., :2], q), (points, q[:, :3]), (points * np.nan, q)):
        with pytest.raises(InvalidStateError, match="points"):
            field.distance(*bad)
    with pytest.raises(InvalidParameterError, match="degree must be from 4 to 24, got 40"):
        panda_distance_field(degree=40)
    with pytest.raises(UnknownNameError, match="link9"):
        panda_distance_field(bodies=("link9",))


@pytest.fixture(scope="module")
def saved(tmp_path_factory):
    shapes = {name: fit_shape(mesh_vertices(body), LOW_DEGREE) for name, body in _meshes().items()}
    return shapes, save_shapes(tmp_path_factory.mktemp("rdf") / "field.npz", shapes)


def _meshes():
    return {mesh_of(body): body for body in BODIES}


def test_a_file_holds_what_was_fitted(saved):
    shapes, path = saved
    loaded = load_shapes(path, LOW_DEGREE)
    assert list(loaded) == list(shapes) and [item.name for item in path.parent.iterdir()] == [
        path.name
    ]
    for name, shape in shapes.items():
        assert (loaded[name].weights == shape.weights).all() and loaded[name].slack == shape.slack
        assert loaded[name].error == shape.error


def rewrite(path, target, **changes):
    """A copy of the file with other arrays or another description."""
    with np.load(path) as data:
        arrays = {name: data[name] for name in data.files}
    meta = json.loads(arrays.pop("meta").tobytes()) | {
        k: v for k, v in changes.items() if k not in arrays
    }
    arrays |= {k: v for k, v in changes.items() if k in arrays}
    np.savez(target, meta=np.frombuffer(json.dumps(meta).encode(), dtype=np.uint8), **arrays)
    return target


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "other"}, "format is 'other'"),
        ({"degree": 7}, "degree is 7, but 6"),
        ({"meshes": {"link0": "0"}}, "meshes is"),
        ({"recipe": {"margin": 1.0}}, "recipe is"),
        ({"slack": np.zeros(10)}, "arrays is"),
        ({"shapes": ["link0"]}, "is needed"),
        ({"error": None}, "broken"),
    ],
)
def test_another_file_is_refused(saved, tmp_path, changes, message):
    with pytest.raises(DistanceFieldError, match=message):
        load_shapes(rewrite(saved[1], tmp_path / "other.npz", **changes), LOW_DEGREE)


def test_a_broken_or_missing_file_is_refused(saved, tmp_path):
    data = saved[1].read_bytes()
    for content in (
        b"",
        b"not a file",
        data[: len(data) // 2],
        data[:100] + b"?" * 50 + data[150:],
    ):
        (tmp_path / "broken.npz").write_bytes(content)
        with pytest.raises(DistanceFieldError, match=r"broken.npz"):
            load_shapes(tmp_path / "broken.npz")
    with pytest.raises(DistanceFieldError, match="missing"):
        load_shapes(tmp_path / "missing.npz")


def test_the_cache_is_filled_mended_and_may_be_closed(tmp_path, monkeypatch):
    monkeypatch.setenv("PIEC_CACHE", str(tmp_path / "cache"))
    path = tmp_path / "cache" / f"panda-rdf-{LOW_DEGREE}.npz"
    panda_shapes.cache_clear()
    first = panda_shapes(LOW_DEGREE)
    assert path.is_file()
    path.write_bytes(b"broken")
    panda_shapes.cache_clear()
    again = panda_shapes(LOW_DEGREE)
    assert all((first[name].weights == again[name].weights).all() for name in first)
    load_shapes(path, LOW_DEGREE)
    (tmp_path / "file").write_text("a file is no folder")
    monkeypatch.setenv("PIEC_CACHE", str(tmp_path / "file" / "below"))
    panda_shapes.cache_clear()
    assert len(panda_shapes(LOW_DEGREE)) == 10
    panda_shapes.cache_clear()

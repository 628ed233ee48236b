"""Files of learned fields: what is saved is read again, and everything else is refused."""

from __future__ import annotations

import dataclasses
import json
import zipfile
from importlib.resources import files

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from piec_envs.errors import WeightsError
from piec_envs.escape import SpeedModel, make_field
from piec_envs.escape import weights as module
from piec_envs.escape.training import RECIPES
from piec_envs.escape.weights import ARRAYS, FieldWeights, find_weights, has_weights
from piec_envs.world.robots import ROBOTS, get_robot

SHIPPED = sorted(path for path in (files("piec_envs") / "assets" / "fields").glob("*.npz"))


@pytest.fixture
def pair(random_weights, tmp_path):
    """A saved file and its sidecar."""
    file = random_weights().save(tmp_path / "new" / "field.npz")
    return file, file.with_suffix(".json")


def rewrite(sidecar, **changes):
    """Change entries of a sidecar; None leaves one out."""
    meta = {**json.loads(sidecar.read_text()), **changes}
    sidecar.write_text(
        json.dumps({name: value for name, value in meta.items() if value is not None})
    )


def reread(arrays, file):
    """Save arrays as they are, pickled ones too, with the digest that fits."""
    np.savez(file, **arrays)
    rewrite(file.with_suffix(".json"), arrays=module.array_digest(arrays))
    return FieldWeights.load(file)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_what_ships_is_whole_and_says_how_it_was_trained(path):
    weights = FieldWeights.load(path)
    name = path.stem.removeprefix(f"{weights.robot}-")
    assert weights.robot in ROBOTS and name in RECIPES and has_weights(weights.robot, name)
    assert {"method", "iterations"} <= set(weights.recipe) and "piec-envs" in weights.versions
    assert weights.record["seconds"] > 0 and weights.record["held_out"][-1]["median"] < 0.05
    assert weights.speed == SpeedModel()
    q = get_robot(weights.robot).home
    assert (
        make_field("network", weights.robot, weights=name).query(np.full((1, 2), 0.3), q) > 0
    ).all()


@pytest.mark.parametrize("inputs", ["skeleton", "raw"])
def test_what_is_saved_is_read_again(inputs, random_weights, tmp_path):
    speed = SpeedModel(leak=0.1)
    weights = random_weights(inputs, 12, 3, seed=7, speed=speed, record={"seconds": 1.5})
    file = weights.save(tmp_path / "deep" / "down" / "field")
    again = FieldWeights.load(file.with_suffix(""))
    assert file.name == "field.npz" and {path.name for path in file.parent.iterdir()} == {
        "field.npz",
        "field.json",
    }
    for item in dataclasses.fields(FieldWeights):
        if item.name != "arrays":
            assert getattr(again, item.name) == getattr(weights, item.name)
    for name in ARRAYS:
        assert again.arrays[name].dtype == np.float32
        np.testing.assert_array_equal(again.arrays[name], weights.arrays[name])


def test_a_failed_write_leaves_the_old_file_and_nothing_else(pair, random_weights, monkeypatch):
    file, sidecar = pair
    before = file.read_bytes(), sidecar.read_bytes()

    def fail(stream, **arrays):
        stream.write(b"half")
        raise OSError("No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(module.np, "savez_compressed", fail)
        with pytest.raises(OSError, match="No space"):
            random_weights(seed=1).save(file)
    with pytest.raises(TypeError):
        random_weights(record={"not": {"JSON"}}).save(file)
    assert {path.name for path in file.parent.iterdir()} == {"field.npz", "field.json"}
    assert (file.read_bytes(), sidecar.read_bytes()) == before


@settings(max_examples=200, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.integers(0, 10**6), st.integers(1, 255))
def test_a_damaged_file_is_refused_or_whole(pair, place, flip):
    """Whatever byte is wrong, it is WeightsError, or the arrays are what they were."""
    file, _ = pair
    good = file.read_bytes()
    bad = bytearray(good)
    bad[place % len(bad)] ^= flip
    true = FieldWeights.load(file).arrays
    try:
        file.write_bytes(bad)
        found = FieldWeights.load(file).arrays
        assert all((found[name] == true[name]).all() for name in ARRAYS)
    except WeightsError as error:
        assert "field.npz" in str(error)
    finally:
        file.write_bytes(good)


@pytest.mark.parametrize("kept", [0, 10, 0.5, 0.99])
@pytest.mark.parametrize("which", [0, 1])
def test_a_truncated_file_is_refused(pair, kept, which):
    whole = pair[which].read_bytes()
    pair[which].write_bytes(whole[: kept if isinstance(kept, int) else int(kept * len(whole))])
    with pytest.raises(WeightsError, match=r"field.npz.*broken"):
        FieldWeights.load(pair[0])


def test_a_missing_file_is_refused(pair, tmp_path):
    pair[1].unlink()
    with pytest.raises(WeightsError, match=r"field.json"):
        FieldWeights.load(pair[0])
    with pytest.raises(WeightsError, match="nowhere"):
        FieldWeights.load(tmp_path / "nowhere.npz")
    with pytest.raises(WeightsError, match=r"'nowhere'.*neither a file nor.*piec train-field"):
        find_weights("planar_arm", "nowhere")


def test_files_that_do_not_belong_together_are_refused(pair, random_weights, tmp_path):
    other = random_weights(seed=1).save(tmp_path / "other.npz")
    pair[0].write_bytes(other.read_bytes())
    with pytest.raises(WeightsError, match="does not hold the weights"):
        FieldWeights.load(pair[0])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"format": "piec-field-0"}, "format 'piec-field-0', but 'piec-field-1' is needed"),
        ({"format": None}, "broken.*format"),
        ({"robot": "planar_leg"}, "unknown robot 'planar_leg'.*Did you mean 'planar_arm'"),
        ({"robot": ["planar_arm"]}, "field.npz"),
        ({"geometry": "0" * 64}, "another geometry of the robot 'planar_arm'"),
        ({"inputs": "pictures"}, "kind of inputs 'pictures'"),
        ({"inputs": "raw"}, r"mean must be finite, of shape \(6,\)"),
        ({"arrays": 3}, "does not hold the weights"),
        ({"speed": {"leek": 1}}, "leek"),
        ({"speed": {"leak": 2.0}}, "leak"),
        ({"recipe": None}, "broken.*recipe"),
    ],
    ids=str,
)
def test_a_foreign_or_incomplete_sidecar_is_refused(pair, changes, message):
    rewrite(pair[1], **changes)
    with pytest.raises(WeightsError, match=message):
        FieldWeights.load(pair[0])
    with pytest.raises(WeightsError):
        make_field("network", weights=str(pair[0]))


@pytest.mark.parametrize("text", ["", "[]", "3", "null", "{", "\xff", "[" * 100_000])
def test_a_sidecar_that_is_no_object_is_refused(pair, text):
    pair[1].write_bytes(text.encode("latin-1"))
    with pytest.raises(WeightsError, match=r"field.npz"):
        FieldWeights.load(pair[0])


def test_nothing_is_unpickled(pair, random_weights):
    class Trap:
        def __reduce__(self):
            return pytest.fail, ("it was unpickled",)

    good = dict(random_weights().arrays)
    assert (reread(good, pair[0]).arrays["w"] == good["w"]).all()
    np.savez(pair[0], **{**good, "w": np.array([Trap()], dtype=object)})
    with pytest.raises(WeightsError, match="allow_pickle"):
        FieldWeights.load(pair[0])


def test_files_of_another_kind_are_refused(pair):
    np.save(pair[0].open("wb"), np.zeros(3))
    with pytest.raises(WeightsError, match="no weight file"):
        FieldWeights.load(pair[0])
    with zipfile.ZipFile(pair[0], "w") as file:
        file.writestr("readme.txt", "nothing")
    with pytest.raises(WeightsError, match="no weight file"):
        FieldWeights.load(pair[0])


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("w", lambda a: a * np.nan, "w must be finite"),
        ("b_out", lambda a: a + np.inf, "b_out must be finite"),
        (
            "w_in",
            lambda a: a[:, :-1],
            r"w_in must be finite, of shape \(8, 45\); got shape \(8, 44\)",
        ),
        ("b", lambda a: a[None], "must be finite, of shape"),
        ("w_out", lambda a: a[:, None], "w_out"),
        ("scale", lambda a: 0 * a, "scale must be above 0"),
        ("mean", lambda a: a[0], "mean"),
    ],
)
def test_weights_that_cannot_work_are_refused(pair, random_weights, name, change, message):
    arrays = dict(random_weights().arrays)
    arrays[name] = change(arrays[name])
    with pytest.raises(WeightsError, match=message):
        random_weights(arrays=arrays)
    with pytest.raises(WeightsError, match=message):
        reread(arrays, pair[0])


def test_shapes_that_the_kernel_does_not_take_are_refused(random_weights):
    with pytest.raises(WeightsError, match="multiple of 4, got 6"):
        random_weights(width=6)
    with pytest.raises(WeightsError, match="w_out are missing"):
        arrays = {name: array for name, array in random_weights().arrays.items() if name != "w_out"}
        random_weights(arrays=arrays)


@pytest.mark.parametrize("any_robot", ["sliding_arm"], indirect=True)
def test_another_robots_weights_are_refused(any_robot, random_weights):
    with pytest.raises(WeightsError, match="for the robot 'planar_arm', not for 'sliding_arm'"):
        find_weights(any_robot, random_weights())


def test_changed_geometry_is_refused(pair, monkeypatch):
    longer = dataclasses.replace(get_robot("planar_arm"), workspace_radius=1.5)
    monkeypatch.setattr(module, "get_robot", lambda name: longer)
    with pytest.raises(WeightsError, match="another geometry"):
        FieldWeights.load(pair[0])

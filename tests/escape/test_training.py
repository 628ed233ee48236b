"""Training of escape fields: every recipe runs, repeats itself and survives a kill; its parts obey
their laws.
"""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from piec_envs.errors import InvalidParameterError, UnknownNameError, WeightsError  # noqa: E402
from piec_envs.escape.training import (  # noqa: E402
    RECIPES,
    get_recipe,
    heldout,
    train_field,
    trainer,
)
from piec_envs.escape.training.checkpoint import read_checkpoint  # noqa: E402
from piec_envs.escape.training.recipes import (  # noqa: E402
    Bellman,
    Extended,
    Fitted,
    Labelled,
    Residual,
)
from piec_envs.escape.training.trainer import Training, learning_rate  # noqa: E402
from piec_envs.escape.weights import FieldWeights  # noqa: E402

ROOT = Path(__file__).resolve().parents[2]
ARM = "planar_arm"
R = 1.4
U_BAR = 0.05
SMALL = {"width": 8, "depth": 2, "iterations": 5, "batch": 32, "learning_rate": 0.01}
KINDS = {
    Residual: {"configurations": 8, "boundary": 8},
    Fitted: {"configurations": 6, "points": 8},
    Labelled: {"resolution": 40},
    Bellman: {"directions": 4, "first_directions": 8, "descent_steps": 4, "last_factor": 2},
}


def settings_of(name, **changes):
    """Numbers that make a recipe of the table tiny."""
    recipe = RECIPES[name]
    found = dict(SMALL)
    for kind, numbers in KINDS.items():
        found.update(numbers if isinstance(recipe, kind) else {})
    if isinstance(recipe, Bellman):
        found.update(rounds=min(recipe.rounds, 1), lengths=recipe.lengths[::2])
    if isinstance(recipe, Extended):
        found.update(ramp=min(recipe.ramp, 0.02))
    return {**found, **changes}


def tiny(name, **changes):
    return dataclasses.replace(RECIPES[name], **settings_of(name, **changes))


def assert_equal(found, true):
    for name, array in true.arrays.items():
        np.testing.assert_array_equal(found.arrays[name], array, err_msg=name)


@pytest.fixture(autouse=True)
def small_machine(monkeypatch):
    """One torch thread, since sums depend on their number, and a small held-out set."""
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    for name, value in {"CONFIGURATIONS": 3, "POINTS": 10, "RESOLUTION": 40}.items():
        monkeypatch.setattr(heldout, name, value)
    yield
    torch.set_num_threads(before)


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_goes_on_from_every_stop_to_the_weights_of_an_unbroken_run(name, tmp_path):
    recipe = tiny(name)
    file = tmp_path / "a.checkpoint.npz"
    unbroken = Training(recipe, ARM, 3, threads=1).run(progress=False)
    total = sum(Training(recipe, ARM, 3, threads=1).loss.lengths)
    for stop in (1, 3, 5, 7, 10, 14, total):
        training = Training(recipe, ARM, 3, file, threads=2)
        weights = training.run(progress=False, stop_at=stop)
        assert training.iteration == min(stop, total)
    assert_equal(weights, unbroken)
    assert weights.record["held_out"] == unbroken.record["held_out"]
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
    # nothing is left to do
    assert_equal(Training(recipe, ARM, 3, file).run(progress=False), unbroken)


@pytest.mark.parametrize("name", RECIPES)
def test_a_recipe_lessens_its_loss_and_repeats_itself(name):
    recipe = tiny(name, iterations=60, batch=128)
    first, again = (
        train_field(recipe, ARM, 1, progress=False, threads=threads) for threads in (1, 2)
    )
    assert_equal(again, first)
    other = train_field(dataclasses.replace(recipe, iterations=1), ARM, 2, progress=False)
    assert not np.array_equal(other.arrays["w_in"], first.arrays["w_in"])
    loss = [row["loss"] for row in first.record["held_out"]]
    assert np.mean(loss[-3:]) < 0.9 * loss[0]
    assert all(np.isfinite(array).all() for array in first.arrays.values())
    assert (
        first.recipe["method"] == type(recipe).__name__ and first.seed == 1 and first.robot == ARM
    )


KILLED = """
import dataclasses, json, os, signal, sys
import torch
torch.set_num_threads(1)
from piec_envs.escape.training import RECIPES, train_field, trainer
name, file = sys.argv[1], sys.argv[3]
settings = json.loads(sys.argv[2])
write = trainer.write_checkpoint
settings["lengths"] = tuple(settings["lengths"])
trainer.CHECKPOINT_SECONDS = 0.0
def write_and_die(path, training):
    write(path, training)
    if training.iteration == 8:
        os.kill(os.getpid(), signal.SIGKILL)
trainer.write_checkpoint = write_and_die
recipe = dataclasses.replace(RECIPES[name], **settings)
train_field(recipe, "planar_arm", 5, file, threads=1, progress=False)
"""


def test_a_training_killed_in_the_middle_of_a_round_ends_with_the_same_weights(tmp_path):
    file = tmp_path / "new" / "field.npz"
    command = [sys.executable, "-c", KILLED, "pinn", json.dumps(settings_of("pinn")), str(file)]
    done = subprocess.run(
        command, cwd=ROOT, env={**os.environ, "PYTHONPATH": str(ROOT)}, capture_output=True
    )
    assert done.returncode == -signal.SIGKILL, done.stderr
    assert [path.name for path in file.parent.iterdir()] == ["field.checkpoint.npz"]
    weights = train_field(tiny("pinn"), ARM, 5, file, progress=False)
    assert_equal(weights, train_field(tiny("pinn"), ARM, 5, progress=False))
    assert_equal(FieldWeights.load(file), weights)
    assert {path.name for path in file.parent.iterdir()} == {"field.npz", "field.json"}


@pytest.mark.parametrize("any_robot", ["sliding_arm"], indirect=True)
def test_a_robot_whose_base_slides_is_refused(any_robot):
    with pytest.raises(InvalidParameterError, match="slides"):
        train_field(tiny("network"), any_robot, progress=False)


def test_another_trainings_or_a_broken_checkpoint_is_refused(tmp_path, random_weights):
    file = tmp_path / "a.npz"
    recipe = tiny("pinn")
    training = Training(recipe, ARM, 0, file, threads=1)
    training.run(progress=False, stop_at=7)
    for other in ((tiny("pinn", width=4), ARM, 0), (tiny("network"), ARM, 0), (recipe, ARM, 1)):
        with pytest.raises(WeightsError, match=r"another training.*move it away"):
            Training(*other, file, threads=1)
    elsewhere = Training(recipe, ARM, 0, threads=1)
    elsewhere.robot_name = "another_arm"
    with pytest.raises(WeightsError, match="belongs to another training"):
        read_checkpoint(file, elsewhere)
    good = file.read_bytes()
    rng = np.random.default_rng(0)
    for bad in (
        b"",
        b"nothing",
        good[:100],
        good[:-100],
        random_weights().save(tmp_path / "w.npz").read_bytes(),
    ):
        file.write_bytes(bad)
        with pytest.raises(WeightsError, match=r"is no checkpoint, or is broken.*move it away"):
            Training(recipe, ARM, 0, file, threads=1)
    for _ in range(50):
        damaged = bytearray(good)
        damaged[rng.integers(len(good))] ^= rng.integers(1, 256)
        file.write_bytes(damaged)
        try:
            read_checkpoint(file, training)
        except WeightsError as error:
            assert "a.npz" in str(error)


def test_what_cannot_be_trained_is_refused(tmp_path):
    with pytest.raises(UnknownNameError, match="Did you mean 'pinn'"):
        get_recipe("pin")
    with pytest.raises(UnknownNameError, match="planar_arm"):
        train_field(tiny("pinn"), "planar_leg")
    for device in ("quantum", "cuda:99"):
        with pytest.raises(InvalidParameterError, match=device):
            train_field(tiny("pinn"), device=device)
    for choice in ({"seed": -1}, {"seed": 0.5}, {"threads": 0}):
        with pytest.raises(InvalidParameterError, match=next(iter(choice))):
            train_field(tiny("pinn"), **choice)


@pytest.mark.parametrize(
    ("name", "changes"),
    [
        ("network", {"width": 6}),
        ("network", {"depth": 0}),
        ("network", {"iterations": 1.5}),
        ("network", {"points": 0}),
        ("network", {"learning_rate": -1.0}),
        ("network", {"learning_rate": np.nan}),
        ("pinn", {"rounds": -1}),
        ("pinn", {"lengths": ()}),
        ("pinn", {"lengths": (0.2, 0.1)}),
        ("pinn", {"lengths": (0.0, 0.1)}),
        ("pinn", {"line_step": 0.0}),
        ("pinn-paper", {"boundary": 0}),
        ("pinn-paper", {"band": 0.03}),
        ("pinn-paper-viscous", {"viscosity": -0.01}),
        ("pinn-paper-viscous", {"inputs": "skeleton"}),
        ("pinn-paper-progressive", {"ramp": 1.5}),
        ("pinn-paper-td", {"weight_td": np.nan}),
        ("pinn-paper-td", {"time_step": 0.0}),
    ],
    ids=str,
)
def test_numbers_with_which_nothing_can_be_trained_are_refused(name, changes):
    with pytest.raises(InvalidParameterError, match=next(iter(changes))):
        dataclasses.replace(RECIPES[name], **changes)
    with pytest.raises(UnknownNameError, match="cosine, halving"):
        dataclasses.replace(RECIPES[name], schedule="linear")


def test_learning_rates_fall():
    cosine = RECIPES["network"]
    halving = RECIPES["pinn-paper"]
    rates = [learning_rate(cosine, k, 100) for k in range(100)]
    assert rates[0] == cosine.learning_rate and (np.diff(rates) < 0).all() and rates[-1] > 0
    assert (
        learning_rate(halving, 1999, 20_000) == 1e-3
        and learning_rate(halving, 4000, 20_000) == 2.5e-4
    )


def test_checkpoints_are_written_now_and_then(tmp_path, monkeypatch):
    written = []
    monkeypatch.setattr(trainer, "CHECKPOINT_SECONDS", 0.0)
    monkeypatch.setattr(
        trainer, "write_checkpoint", lambda path, training: written.append(training.iteration)
    )
    train_field(tiny("network"), file=tmp_path / "a.npz", progress=False)
    assert written == [1, 2, 3, 4, 5, 5]

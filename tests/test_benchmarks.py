"""The benchmarks that stand beside the packages load, and find what they measure."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from piec_envs.escape.samples import robot_distance

FILES = sorted((Path(__file__).parents[1] / "benchmarks").glob("*.py"))


def loaded(file: Path) -> ModuleType:
    spec = importlib.util.spec_from_file_location(file.stem, file)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("file", FILES, ids=lambda file: file.stem)
def test_a_benchmark_loads(file):
    assert loaded(file).__doc__


def test_pressed_points_stand_off_one_link():
    file = next(file for file in FILES if file.stem == "escape_accuracy")
    points, q = loaded(file).pressed_points(3)
    distances = robot_distance("planar_arm", points, q)
    np.testing.assert_allclose(distances, np.tile([0.075, 0.1], (3, 1)), atol=1e-9)

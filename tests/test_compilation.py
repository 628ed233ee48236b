"""Kernels announce their first compilation, once and with an estimate, in scripts as in
commands.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

from piec_envs import compilation

ROOT = Path(__file__).resolve().parents[1]
# Two kernels that are quick to compile, taken for slow ones of ours.
COLD = """
from piec_envs import compilation
from piec_envs.kernels import kernel

compilation.SECONDS = {"pieces:piece": 5.0, "pieces:other": 7.0}
compilation.PACKAGES = ("pieces",)

def piece(x):
    return 2.0 * x

def other(x):
    return 3.0 * x

for function in (piece, other):
    kernel(function)(1.0)
"""


def run(folder: Path, **variables: str) -> list[str]:
    path = os.pathsep.join([str(folder), str(ROOT)])
    env = {**os.environ, "PYTHONPATH": path, "NUMBA_CACHE_DIR": str(folder / "cache"), **variables}
    command = [sys.executable, "-c", "import pieces"]
    return subprocess.run(
        command, capture_output=True, text=True, check=True, env=env
    ).stderr.splitlines()


def test_the_first_compilation_is_announced_once(tmp_path):
    (tmp_path / "pieces.py").write_text(COLD)
    assert run(tmp_path, PIEC_QUIET="1", NUMBA_CACHE_DIR=str(tmp_path / "another")) == []
    assert run(tmp_path) == ["piec_envs: compiling kernels, once; up to about 5 s"]
    assert run(tmp_path) == []  # the cache has them
    # the code of somebody else
    (tmp_path / "pieces.py").write_text(COLD.replace('("pieces",)', '("piec_envs",)'))
    assert run(tmp_path) == []


@pytest.mark.parametrize("name", compilation.SECONDS)
def test_estimates_are_of_kernels_that_there_are(name):
    module, _, function = name.partition(":")
    dispatcher = getattr(import_module(module), function)
    assert compilation.kernel_name(dispatcher) == name
    assert 0 < compilation.SECONDS[name] < 100


def test_what_is_in_the_cache_is_not_estimated(tmp_path, monkeypatch):
    everything = sum(compilation.SECONDS.values())
    for name in compilation.SECONDS:
        import_module(name.partition(":")[0])
    monkeypatch.setattr(compilation, "_kept", lambda name: True)
    assert compilation.estimate("piec_envs.dynamics.contact_rollout:rollout_rows") == 30.0
    assert compilation.estimate("piec_envs.any:other") == 0.5
    monkeypatch.setattr(compilation, "_kept", lambda name: False)
    assert compilation.estimate("piec_envs.dynamics.contact_rollout:rollout_rows") == everything
    monkeypatch.undo()
    assert compilation._kept("piec_envs.not_loaded:kernel")
    for state, expected in (("", False), ("contact_rollout.rollout_rows-30.py311.nbi", True)):
        if state:
            (tmp_path / state).write_bytes(b"")
        module = import_module("piec_envs.dynamics.contact_rollout")
        stats = type(module.rollout_rows.stats)(str(tmp_path), {}, {})
        monkeypatch.setattr(module, "rollout_rows", type("Kernel", (), {"stats": stats}))
        assert compilation._kept("piec_envs.dynamics.contact_rollout:rollout_rows") is expected

"""Every example runs as its first lines say, and is short."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
EXAMPLES = sorted((ROOT / "examples").glob("*.py"))
OPTIONS = {"carry_with_a_mobile_franka.py": ("--geometry", "capsules")}
LEARNING = "train_an_agent.py"  # needs the extra `rl`


@pytest.mark.parametrize("script", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(script, tmp_path):
    if script.name == LEARNING:
        pytest.importorskip("stable_baselines3")
    text = script.read_text(encoding="utf-8")
    assert len(text.splitlines()) < 80
    assert f"python examples/{script.name}" in text
    found = subprocess.run(
        [sys.executable, str(script), "--quick", *OPTIONS.get(script.name, ())],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert found.returncode == 0, found.stderr
    assert found.stdout
    for line in found.stdout.splitlines():
        if "wrote " in line:
            assert (tmp_path / line.rpartition("wrote ")[2]).stat().st_size > 0

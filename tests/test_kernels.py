"""Where compiled functions are kept, and what happens where they cannot be."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from piec_envs.kernels import batch_kernel, kernel

ROOT = Path(__file__).resolve().parents[1]
# Numba keeps code beside the source if it can, else in a home folder. The installation cannot be
# written here, whoever runs this. Importing an environment meets all kernels, and one small one is
# run.
READ_ONLY = """
import os
from numba.core import caching
caching.InTreeCacheLocator.get_cache_path = lambda self: os.path.join(self._py_file, "__pycache__")
import numpy as np, piec_envs.env.makers
from piec_envs.escape import key_points_world
print(key_points_world(np.eye(2), np.array([1.0, 2.0, 0.0])).tolist())
"""


def run_read_only(home: Path, **variables: str) -> subprocess.CompletedProcess:
    """A process whose installation cannot be written, with a home folder that may be none."""
    kept = {
        name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "XDG_"))
    }
    command = [sys.executable, "-c", READ_ONLY]
    env = {**kept, "HOME": str(home), **variables}
    return subprocess.run(command, capture_output=True, text=True, cwd=ROOT, env=env, check=True)


@pytest.mark.parametrize("where", ["nowhere", "nowhere, quiet", "home", "variable"])
def test_a_read_only_installation_works_and_says_what_to_set_where_nothing_is_kept(tmp_path, where):
    file = tmp_path / "file"
    file.write_bytes(b"")
    # no folder can be made below a file
    home = tmp_path / "home" if where == "home" else file / "home"
    variables = {
        "nowhere, quiet": {"PIEC_QUIET": "1"},
        "variable": {"NUMBA_CACHE_DIR": str(tmp_path / "kept")},
    }
    result = run_read_only(home, **variables.get(where, {}))
    assert result.stdout == "[[2.0, 2.0], [1.0, 3.0]]\n"
    lines = [line for line in result.stderr.splitlines() if "NUMBA_CACHE_DIR" in line]
    assert lines == result.stderr.splitlines() and len(lines) == (where == "nowhere")
    assert any(tmp_path.rglob("*._place-*.nbc")) == (where in ("home", "variable"))


def test_a_kernel_for_kernels_alone_refuses_python():
    """It has no entry from Python: Numba would jump to nowhere."""

    @kernel
    def _twice(x):
        return 2 * x

    @batch_kernel
    def fourfold(x):
        return _twice(_twice(x))

    for _ in range(2):  # before it is compiled, and after
        with pytest.raises(TypeError, match="_twice is called by other kernels alone"):
            _twice(1.0)
        assert fourfold(1.0) == 4.0

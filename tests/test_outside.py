"""Robots, objects, tasks, observation terms, planners and dynamics from outside of the package keep
the contracts.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path


def test_one_row_in_each_table_is_enough():
    folder = Path(__file__).parent
    env = {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([str(folder.parent), os.environ.get("PYTHONPATH", "")]),
    }
    run = subprocess.run(
        [sys.executable, "-c", "import outside; outside.check()"],
        capture_output=True,
        text=True,
        cwd=folder,
        env=env,
    )
    assert run.returncode == 0, run.stderr
    assert "all contracts hold" in run.stdout

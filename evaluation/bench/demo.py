"""`piec demo` as users run it: a process of its own, with and without compiled kernels on
the disk.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from evaluation.bench.base import Row, Sizes, row
from piec_envs import EngineError

NOTES = {
    "cold": "a fresh process that compiles all its kernels",
    "warm": "a fresh process, kernels compiled before",
}


def whole_demo(sizes: Sizes) -> list[Row]:
    """Time of `piec demo`, first with an empty cache of kernels and then with the one that this has
    filled.
    """
    rows = []
    with tempfile.TemporaryDirectory(prefix="piec-bench-") as folder:
        cache = {"NUMBA_CACHE_DIR": str(Path(folder) / "kernels")} if "cold" in sizes.demo else {}
        for kind in sizes.demo:
            seconds = _run_demo(Path(folder) / kind, cache, sizes.demo_budget)
            note = ", ".join([NOTES[kind], *sizes.demo_budget])
            rows.append(row(f"piec demo, {kind}", seconds, "s", "", note))
    return rows


def _run_demo(out: Path, cache: dict[str, str], budget: tuple[str, ...]) -> float:
    """Seconds from its start to its end."""
    # the packages of this process, installed or not
    root = str(Path(__file__).resolve().parents[2])
    path = os.pathsep.join([root, *filter(None, [os.environ.get("PYTHONPATH")])])
    command = [
        sys.executable,
        "-m",
        "evaluation.cli",
        "--quiet",
        "demo",
        "--out",
        str(out),
        *budget,
    ]
    begin = time.perf_counter()
    done = subprocess.run(
        command,
        env={**os.environ, "PYTHONPATH": path, **cache},
        capture_output=True,
        text=True,
        check=False,
    )
    if done.returncode:
        raise EngineError(
            f"piec demo ended with code {done.returncode}: {done.stderr.strip()[-500:]}"
        )
    return time.perf_counter() - begin

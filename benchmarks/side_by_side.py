"""Two commits timed side by side: `python benchmarks/side_by_side.py BEFORE AFTER`, two trees of
the repository.

Runs benchmarks/steps.py under either tree in turn, with the same Python, and prints medians and
their ratios.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np

STEPS = Path(__file__).with_name("steps.py")


def times(tree: str) -> dict[str, float]:
    """What the script prints under one tree, by name, us."""
    env = {**os.environ, "PYTHONPATH": str(Path(tree).resolve()), "PIEC_QUIET": "1"}
    done = subprocess.run(
        [sys.executable, str(STEPS)], env=env, cwd=tree, capture_output=True, text=True, check=True
    )
    return json.loads(done.stdout)


def main() -> None:
    """Time both trees in turn and print a table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("before")
    parser.add_argument("after")
    parser.add_argument("--rounds", type=int, default=5)
    args = parser.parse_args()
    found: dict[str, list[dict[str, float]]] = {args.before: [], args.after: []}
    times(args.before), times(args.after)  # compiles
    for _ in range(args.rounds):
        for tree, runs in found.items():
            runs.append(times(tree))
    print("| us | before | after | ratio |\n|---|---|---|---|")
    for name in found[args.after][0]:
        before, after = (float(np.median([run[name] for run in runs])) for runs in found.values())
        print(f"| {name} | {before:.3g} | {after:.3g} | {after / before:.2f} |")


if __name__ == "__main__":
    main()

"""Queries of the learned field, the paper's network in torch beside it, and of the table, on one
core.
"""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec

import numpy as np

from evaluation.bench.base import Row, Sizes, median_seconds, row
from piec_envs import NetworkField, TableField, draw_configurations

BATCHES = {5000: 1.5, 50: 3.0}  # points, and the most microseconds a point may take
TABLED = "franka_capsules"
PAPER_SHAPE = (6, 256, 6)  # inputs, width and depth of the paper's network


def network_queries(sizes: Sizes) -> list[Row]:
    """One point for each configuration; every batch is asked so often that the clock does not
    count.
    """
    rng = np.random.default_rng(0)
    rows = []
    field = NetworkField("planar_arm", threads=1)
    for count, wanted in BATCHES.items():
        q = draw_configurations("planar_arm", "uniform", count, rng)
        points = rng.uniform(-0.9, 0.9, (count, 1, 2))
        ours = _seconds(partial(field.query, points, q), count, sizes.repeats)
        shape = field.weights.arrays["w"].shape
        note = f"one core, {shape[0] + 1} x {shape[1]}, the weights that ship"
        rows.append(
            row(
                f"field, network, {count} points",
                1e6 * ours,
                "us a point",
                f"at most {wanted:g}",
                note,
            )
        )
        if find_spec("torch") is None:
            rows.append(
                {
                    **row(f"torch over network, {count} points", np.nan, "times"),
                    "note": "torch is not installed",
                }
            )
            continue
        theirs = _seconds(_paper_network(points, q), count, sizes.repeats)
        note = f"the paper's 6 x 256 in torch, one thread: {1e6 * theirs:.3g} us a point"
        rows.append(
            row(f"torch over network, {count} points", theirs / ours, "times", "at least 6", note)
        )
    return rows


def table_queries(sizes: Sizes) -> list[Row]:
    """One point for each of many unrelated configurations, values and gradients; the table is made
    first.
    """
    rng = np.random.default_rng(0)
    rows = []
    nodes, spacing = sizes.table
    TableField(TABLED, nodes, spacing)
    field = TableField(TABLED, nodes, spacing, threads=1)
    note = f"one core, {TABLED}, {field.nbytes / 1e6:.0f} MB"
    for count in BATCHES:
        q = draw_configurations(TABLED, "uniform", count, rng)
        points = rng.uniform(-0.7, 0.7, (count, 1, 2))
        for name, ask in (("values", field.query), ("gradients", field.gradients)):
            seconds = _seconds(partial(ask, points, q), count, sizes.repeats)
            rows.append(
                row(f"field, table, {name}, {count} points", 1e6 * seconds, "us a point", note=note)
            )
    return rows


def _seconds(call, count: int, repeats: int) -> float:
    """Median time of a point."""
    often = max(1, 20_000 // count)

    def calls() -> None:
        """Make the call several times."""
        for _ in range(often):
            call()

    return median_seconds(calls, repeats) / (often * count)


def _paper_network(points: np.ndarray, q: np.ndarray):
    """A query of the paper's network in torch: 6 inputs, 6 x 256 with softplus at the end."""
    import torch

    inputs, width, depth = PAPER_SHAPE
    layers: list[torch.nn.Module] = []
    for k in range(depth):
        layers += [torch.nn.Linear(inputs if k == 0 else width, width), torch.nn.SiLU()]
    module = torch.nn.Sequential(*layers, torch.nn.Linear(width, 1), torch.nn.Softplus())

    def query() -> np.ndarray:
        """Ask it on one thread."""
        threads = torch.get_num_threads()
        torch.set_num_threads(1)
        with torch.inference_mode():
            found = module(
                torch.from_numpy(np.concatenate([points[:, 0], q], axis=1).astype(np.float32))
            ).numpy()
        torch.set_num_threads(threads)
        return found

    return query

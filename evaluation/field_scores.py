"""How well an escape field does on the held-out sets, and how fast."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from scipy.stats import rankdata, spearmanr

from evaluation.field_sets import HARD_RATIO, PointSet
from piec_envs import EscapeField

LEAST_SLOPE = 0.5  # s/rad, of the exact |dT/dq| where a cosine means something
GRADIENT_POINTS = 100  # of each configuration of H

Query = Callable[[np.ndarray, np.ndarray], np.ndarray]


def errors(query: Query, chosen: PointSet, only_hard: bool = False) -> dict[str, float]:
    """Relative error of T on a set.

    Args:
        query: T at points (B, k, 2) for configurations (B, n), shape (B, k), s.
        chosen: the set.
        only_hard: whether to leave out points whose T is at most 1.05 T_0.

    Returns:
        "median", "mean" and "p95", the 95th percentile.
    """
    error = np.abs(query(chosen.points, chosen.q) - chosen.T) / chosen.T
    if only_hard:
        error = error[chosen.T / chosen.bound > HARD_RATIO]
    return {
        "median": float(np.median(error)),
        "mean": float(error.mean()),
        "p95": float(np.percentile(error, 95)),
    }


def rank_over_points(query: Query, chosen: PointSet) -> float:
    """Spearman correlation with the truth over the points of each configuration.

    Args:
        query: as in `errors`.
        chosen: the set.

    Returns:
        The mean over configurations.
    """
    found = query(chosen.points, chosen.q)
    return float(np.mean([spearmanr(a, b).statistic for a, b in zip(found, chosen.T, strict=True)]))


def rank_over_configurations(query: Query, chosen: PointSet) -> float:
    """Spearman correlation with the truth at one point over configurations.

    Args:
        query: as in `errors`.
        chosen: the set, of whose points the first counts.

    Returns:
        The correlation; 0 for a field that is the same for all configurations.
    """
    found = query(chosen.points, chosen.q)[:, 0]
    return 0.0 if np.ptp(found) == 0 else float(spearmanr(found, chosen.T[:, 0]).statistic)


def enclosure_auc(query: Query, chosen: PointSet) -> float:
    """Probability that an enclosed configuration gets a larger T than one with a way out.

    Args:
        query: as in `errors`.
        chosen: the set, of whose points the first counts, with configurations of both kinds.

    Returns:
        The area under the ROC curve; ties count half.
    """
    found = query(chosen.points, chosen.q)[:, 0]
    enclosed = ~chosen.reachable[:, 0]
    ranks = rankdata(found)
    count = int(enclosed.sum())
    others = len(found) - count
    return float((ranks[enclosed].sum() - count * (count + 1) / 2) / (count * others))


def gradient_cosine(field: EscapeField, exact: EscapeField, chosen: PointSet) -> float:
    """Median cosine of dT/dq with the exact one, at reachable points that feel the arm.

    Args:
        field: that is judged.
        exact: that is taken for the truth.
        chosen: the set, of whose points the first 100 of each configuration count.

    Returns:
        The cosine; a point counts where the exact |dT/dq| is above 0.5 s/rad.
    """
    points = chosen.points[:, :GRADIENT_POINTS]
    found = field.gradients(points, chosen.q)[2]
    true = exact.gradients(points, chosen.q)[2]
    length = np.linalg.norm(true, axis=-1)
    felt = chosen.reachable[:, :GRADIENT_POINTS] & (length > LEAST_SLOPE)
    product = np.linalg.norm(found, axis=-1) * length
    return float(np.median(((found * true).sum(-1) / np.maximum(product, 1e-12))[felt]))


def query_microseconds(query: Query, chosen: PointSet, batch: int, seconds: float = 0.5) -> float:
    """Time of one point, in batches of one point for each configuration, the least of many.

    Args:
        query: as in `errors`.
        chosen: the set that points are drawn from.
        batch: configurations in a batch.
        seconds: for which batches are timed.

    Returns:
        The time, us.
    """
    rng = np.random.default_rng(0)
    rows = rng.integers(len(chosen.q), size=batch)
    q = chosen.q[rows]
    points = chosen.points[rows, rng.integers(chosen.points.shape[1], size=batch)][:, None]
    query(points, q)
    best = np.inf
    end = time.perf_counter() + seconds
    while time.perf_counter() < end:
        begin = time.perf_counter()
        query(points, q)
        best = min(best, time.perf_counter() - begin)
    return 1e6 * best / batch

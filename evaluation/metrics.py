"""Numbers from evaluations, with honest intervals: n counts distinct executions."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from evaluation.outcome import Evaluation
from piec_envs import InvalidParameterError

CONFIDENCE = 0.95
COVERAGE_RADIUS = 0.03  # m
RESAMPLES = 10_000


class Interval(NamedTuple):
    """An estimate between its bounds."""

    value: float  # the estimate
    low: float  # lower bound
    high: float  # upper bound


def wilson_interval(successes: int, n: int, confidence: float = CONFIDENCE) -> Interval:
    """Success rate with Wilson's score interval, for executions of one plan.

    Args:
        successes: how many succeeded.
        n: of how many distinct executions.
        confidence: of the interval, such as 0.95.

    Returns:
        The rate and its bounds, all in [0, 1].

    Raises:
        InvalidParameterError: unless 0 <= successes <= n and n >= 1.
    """
    if not 0 <= successes <= n or n < 1:
        raise InvalidParameterError(
            f"an interval needs 0 <= successes <= n and n >= 1, got {successes} of {n}"
        )
    z = float(ndtri(0.5 + confidence / 2))
    rate = successes / n
    centre = (rate + z * z / (2 * n)) / (1 + z * z / n)
    half = z / (1 + z * z / n) * np.sqrt(rate * (1 - rate) / n + z * z / (4 * n * n))
    # At the ends the formula meets 0 and 1 but for rounding.
    low = 0.0 if successes == 0 else centre - half
    high = 1.0 if successes == n else centre + half
    return Interval(rate, float(low), float(high))


def bootstrap_interval(values: Any, confidence: float = CONFIDENCE, seed: int = 0) -> Interval:
    """Mean over plans with the percentile bootstrap, plans being drawn with replacement.

    Args:
        values: one number for each plan (its success rate, say), shape (plans,).
        confidence: of the interval.
        seed: of the draws.

    Returns:
        The mean and its bounds; both bounds are the mean where there is one plan.

    Raises:
        InvalidParameterError: if there is no value.
    """
    values = np.asarray(values, dtype=float)
    if values.ndim != 1 or len(values) == 0:
        raise InvalidParameterError(
            f"a bootstrap needs at least one value, got shape {values.shape}"
        )
    draws = np.random.default_rng(seed).integers(len(values), size=(RESAMPLES, len(values)))
    means = values[draws].mean(axis=1)  # (RESAMPLES,)
    low, high = np.quantile(means, [(1 - confidence) / 2, (1 + confidence) / 2])
    return Interval(float(values.mean()), float(low), float(high))


def max_deviation(pose: np.ndarray, nominal: np.ndarray) -> np.ndarray:
    """Largest distance of the object from where the nominal execution has it at the same time.

    Args:
        pose: shape (B, N + 1, 3) or (B, N + 1, 2), m.
        nominal: one for all or one for each, shape (N + 1, 3) or (B, N + 1, 3), or 2 instead of 3,
            m.

    Returns:
        Shape (B,), m.
    """
    offset = pose[..., :2] - nominal[..., :2]
    return np.hypot(offset[..., 0], offset[..., 1]).max(axis=-1)


def coverage(
    pose: np.ndarray, reference: np.ndarray, radius: float = COVERAGE_RADIUS
) -> np.ndarray:
    """Share of the reference's points that the object comes near to at any time.

    Args:
        pose: shape (B, N + 1, 3) or (B, N + 1, 2), m.
        reference: shape (M, 2), m.
        radius: what counts as near, m.

    Returns:
        Shape (B,), in [0, 1].
    """
    covered = []
    for path in pose[..., :2]:  # one episode at a time: (N + 1, M) distances fit in memory
        gap = path[:, None] - reference[None]  # (N + 1, M, 2)
        covered.append((np.hypot(gap[..., 0], gap[..., 1]).min(axis=0) <= radius).mean())
    return np.array(covered)


def summarise(evaluation: Evaluation) -> dict[str, Any]:
    """The numbers of one evaluation that records keep and tables show.

    Args:
        evaluation: of one policy under one protocol, at full time resolution.

    Returns:
        JSON values: executions and episodes; successes among the distinct executions, with rate and
        Wilson interval; how many of them diverged; mean and standard deviation over the executions
        of d2g and goal distance (m); and means over executions and time of the arm's distances (m),
        the tracking error (m; None without a reference), the caging (None without a field) and each
        link's contact.
    """
    kept = evaluation.distinct
    n = len(kept)
    successes = int(evaluation.success[kept].sum())
    rate, low, high = wilson_interval(successes, n)
    final = evaluation.goal_distance[kept, -1]
    caging = None if evaluation.caging is None else evaluation.caging[kept, 1:]
    error = evaluation.tracking_error[kept, 1:]
    return {
        "episodes": evaluation.episodes,
        "n": n,
        "successes": successes,
        "success_rate": rate,
        "success_low": low,
        "success_high": high,
        "diverged": int(evaluation.diverged[kept].sum()),
        "d2g_mean": float(evaluation.d2g[kept].mean()),
        "d2g_std": float(evaluation.d2g[kept].std()),
        "goal_distance_mean": float(final.mean()),
        "goal_distance_std": float(final.std()),
        "goal_distance_max": float(final.max()),
        "mean_distance": float(evaluation.mean_distance[kept, 1:].mean()),
        "min_distance": float(evaluation.min_distance[kept, 1:].mean()),
        "tracking_error": float(error.mean()) if error.any() else None,
        "mean_caging": None if caging is None else float(caging.mean()),
        "final_caging": None if caging is None else float(caging[:, -1].mean()),
        "contact_fraction": [
            float(share) for share in evaluation.contact_fraction[kept].mean(axis=0)
        ],
    }

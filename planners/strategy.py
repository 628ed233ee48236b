"""CMA-ES from the package `cma`, with a random stream of its own."""

from __future__ import annotations

from collections.abc import Sequence

import cma
import numpy as np

# keep a seed's random numbers apart by their use
GUESS_STREAM = 0
NOISE_STREAM = 1
SEARCH_STREAM = 2


def make_strategy(
    start: np.ndarray,
    sigma: float,
    population: int,
    seed: Sequence[int],
    bounds: Sequence[np.ndarray] | None = None,
) -> cma.CMAEvolutionStrategy:
    """A CMA-ES search to ask and tell.

    By default the package draws from NumPy's global generator, so that searches side by side would
    depend on each other and on whatever else draws from it.

    Args:
        start: first mean, shape (d,).
        sigma: first step size.
        population: candidates in each iteration.
        seed: numbers that seed this search's own generator.
        bounds: lower and upper bounds, each of shape (d,); None is unbounded.

    Returns:
        The search, of the package `cma`.
    """
    rng = np.random.default_rng([SEARCH_STREAM, *seed])
    options = {
        "popsize": population,
        "seed": np.nan,  # leaves the global generator alone
        "randn": lambda *size: rng.standard_normal(size),
        "verbose": -9,
    }
    if bounds is not None:
        options["bounds"] = list(bounds)
    return cma.CMAEvolutionStrategy(start, sigma, options)

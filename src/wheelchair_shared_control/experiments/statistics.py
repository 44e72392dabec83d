"""Intervals for rates and for paired differences."""
from typing import NamedTuple

import numpy as np

Z_95 = 1.959963984540054


class Rate(NamedTuple):
    """A share of ``n`` with its 95 % Wilson interval; NaN where n is 0."""

    value: float
    low: float
    high: float
    n: int


def wilson(successes, n):
    """95 % Wilson score interval of ``successes`` out of ``n`` (Wilson 1927) as a ``Rate``."""
    if n == 0:
        return Rate(np.nan, np.nan, np.nan, 0)
    share = successes / n
    centre = share + Z_95**2 / (2 * n)
    spread = Z_95 * np.sqrt(share * (1 - share) / n + Z_95**2 / (4 * n**2))
    scale = 1 + Z_95**2 / n
    low, high = (centre - spread) / scale, (centre + spread) / scale
    # 0 of n and n of n have exact ends; rounding must not move them
    return Rate(share, 0.0 if successes == 0 else low, 1.0 if successes == n else high, n)


def paired_difference(first, second, rng, statistic=np.mean, resamples=4000):
    """Bootstrap of ``statistic(first) - statistic(second)`` over pairs: (value, low, high) at 95 %.

    ``first``, ``second`` (n,): the same episodes under two policies; pairs with a NaN are left out.
    """
    first, second = np.asarray(first, float), np.asarray(second, float)
    valid = np.isfinite(first) & np.isfinite(second)
    first, second = first[valid], second[valid]
    if not len(first):
        return np.nan, np.nan, np.nan
    draws = rng.integers(0, len(first), (resamples, len(first)))
    differences = statistic(first[draws], axis=1) - statistic(second[draws], axis=1)
    low, high = np.percentile(differences, [2.5, 97.5])
    return float(statistic(first, axis=0) - statistic(second, axis=0)), float(low), float(high)


def mean_interval(values, seed=0, resamples=2000):
    """Mean of the finite ``values`` with its 95 % bootstrap interval: (value, low, high), NaN without values."""
    values = np.array([np.nan if value is None else value for value in values], float)
    values = values[np.isfinite(values)]
    if not len(values):
        return np.nan, np.nan, np.nan
    rng = np.random.default_rng(seed)
    means = values[rng.integers(0, len(values), (resamples, len(values)))].mean(axis=1)
    low, high = np.percentile(means, [2.5, 97.5])
    return float(values.mean()), float(low), float(high)

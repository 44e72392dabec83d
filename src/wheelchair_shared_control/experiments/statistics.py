"""Intervals for rates, for means and for paired differences."""
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


def paired_difference(first, second, groups, rng, resamples=4000):
    """Mean of ``first - second`` over pairs with its 95 % bootstrap interval: (value, low, high), NaN without pairs.

    ``first``, ``second`` (n,): the same episodes under two policies; pairs with a NaN are left out. ``groups`` (n,):
    as of ``mean_interval``.
    """
    differences = np.asarray(first, float) - np.asarray(second, float)
    return _bootstrap(differences, groups, rng, resamples)


def mean_interval(values, groups, seed=0, resamples=2000):
    """Mean of the finite ``values`` (n,) with its 95 % bootstrap interval: (value, low, high), NaN without values.

    ``groups`` (n,): what is drawn with replacement, whole: the episodes of one seed share start and noise whatever
    scene and user, and are no independent samples. A single group says nothing about others: then its values are drawn.
    """
    values = np.array([np.nan if value is None else value for value in values], float)
    return _bootstrap(values, groups, np.random.default_rng(seed), resamples)


def _bootstrap(values, groups, rng, resamples):
    valid = np.isfinite(values)
    values = values[valid]
    if not len(values):
        return np.nan, np.nan, np.nan
    members = np.unique(np.asarray(groups)[valid], return_inverse=True)[1]
    if members.max() == 0:
        members = np.arange(len(values))
    sums, counts = np.bincount(members, values), np.bincount(members)
    draws = rng.integers(0, len(sums), (resamples, len(sums)))
    low, high = np.percentile(sums[draws].sum(axis=1) / counts[draws].sum(axis=1), [2.5, 97.5])
    return float(values.mean()), float(low), float(high)

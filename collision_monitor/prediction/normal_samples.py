"""Points that fill the standard normal distribution evenly: integrals over it from few of them, the same on every run.

A rank-1 lattice, its generating vector built component by component (Sloan and Reztsov, 2002) for the weighted
worst-case error of smooth periodic functions, mapped by the inverse of the normal distribution (quasi-Monte Carlo).
The first coordinate is drawn twice as wide and weighted back (importance sampling): so the few points there are reach
4 standard deviations out in the direction that matters most, and a rare event is not seen as an impossible one.
"""

from __future__ import annotations

import math
from functools import lru_cache
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

DIMENSIONS: Final = 12
"""Position and velocity of one body relative to the other, orientation of both."""

WIDENED: Final = 1.5
"""By how much the first coordinate is drawn wider. Larger: rarer events are seen, common ones less exactly."""

_GOLDEN_RATIO: Final = 0.6180339887498949


class NormalSamples(NamedTuple):
    """points (n, DIMENSIONS), weights (n,) that sum to 1; read-only."""

    points: NDArray[np.float64]
    weights: NDArray[np.float64]


def generating_vector(count: int, dimensions: int) -> list[int]:
    """Of the lattice {k z / count}: each component makes the worst-case error smallest, given those before it.

    The error is that of the Korobov space of smoothness 2 with weights 1 / j^2: later coordinates matter less.
    """
    x = np.arange(count) / count
    kernel = 2.0 * math.pi**2 * (x * x - x + 1.0 / 6.0)
    k = np.arange(count)
    candidates = [z for z in range(1, count // 2 + 1) if math.gcd(z, count) == 1]
    product = np.ones(count)
    vector = []
    for j in range(1, dimensions + 1):
        weight = 1.0 / j**2
        errors = [float(product @ kernel[k * z % count]) for z in candidates]
        best = candidates[int(np.argmin(errors))] if j > 1 else 1  # the first ones are all the same
        vector.append(best)
        product *= 1.0 + weight * kernel[k * best % count]
    return vector


@lru_cache(maxsize=8)
def normal_samples(count: int) -> NormalSamples:
    """`count` points, at least 2, and their weights."""
    normal = NormalDist()
    quantiles = np.array([normal.inv_cdf((m + 0.5) / count) for m in range(count)])
    vector = np.array(generating_vector(count, DIMENSIONS))
    shifts = (np.arange(DIMENSIONS) * _GOLDEN_RATIO % 1.0 * count).astype(int)  # else one point is a corner of all
    points = quantiles[(np.arange(count)[:, None] * vector + shifts) % count]
    first = points[:, 0] = WIDENED * points[:, 0]
    weights = np.exp(-0.5 * first * first * (1.0 - 1.0 / WIDENED**2))
    weights /= weights.sum()
    points.flags.writeable = weights.flags.writeable = False
    return NormalSamples(points, weights)

"""Points that fill the standard normal distribution evenly: integrals over it from few of them, the same on every run.

A rank-1 lattice, its generating vector built component by component (Sloan and Reztsov, 2002) for the weighted
worst-case error of smooth periodic functions, mapped by the inverse of the normal distribution (quasi-Monte Carlo).
The first coordinate is drawn wider and weighted back (importance sampling): so the few points there are reach
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


PILOT: Final = 128
"""About so many of the points, evenly taken, are a coarser lattice that is good by itself."""


def generating_vector(count: int, dimensions: int) -> list[int]:
    """Of the lattice {k z / count}: each component makes the worst-case errors smallest, given those before it.

    That of all points, which counts three times, and that of the coarser lattice in them (after Cools, Kuo and Nuyens,
    2006). They are those of the Korobov space of smoothness 2 with weights 1 / sqrt(j): later coordinates matter less.
    """
    x = np.arange(count) / count
    kernel = 2.0 * math.pi**2 * (x * x - x + 1.0 / 6.0)
    k = np.arange(count)
    stride = max(1, count // PILOT)
    candidates = [z for z in range(1, count // 2 + 1) if math.gcd(z, count) == 1]
    product = np.ones(count)
    vector = []
    for j in range(1, dimensions + 1):
        best, least = 1, math.inf  # at first they are all the same
        for z in candidates if j > 1 else ():
            with_z = product * (1.0 + kernel[k * z % count] / math.sqrt(j))
            error = (with_z.mean() - 1.0) ** 3 * (with_z[::stride].mean() - 1.0)
            if error < least:
                best, least = z, error
        vector.append(best)
        product *= 1.0 + kernel[k * best % count] / math.sqrt(j)
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

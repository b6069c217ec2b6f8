"""Evenly spread samples of the standard normal distribution: integrals over it from few points, equal on every run.

The points of a Sobol' sequence, mapped by the inverse of the normal distribution (quasi-Monte Carlo). The first
coordinate is drawn wider and weighted back (importance sampling), so that even few points reach 4 standard deviations
in the direction that matters most, and a rare event does not look impossible.
"""

from __future__ import annotations

from functools import lru_cache
from statistics import NormalDist
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import inlined
from collision_monitor.uncertainty.samples.sobol_points import scrambled, sobol_digits

DIMENSIONS: Final = 18
"""Position and velocity of one body relative to the other, orientation of both, and what is left of it; see
error_samples.ORIENTATION."""

WIDENED: Final = 1.5
"""Factor by which the first coordinate is drawn wider. Larger: rarer events are found, common ones less exact."""

FURTHEST: Final = 4.5
"""Standard deviations beyond which errors are neglected; 7 of a million are larger."""

BASE: Final = 256
"""Number of samples that each pair has that may meet, see chosen_samples.py. Of fewer, because of their weights, the
earliest time would have to be that of grown bodies."""


class NormalSamples(NamedTuple):
    """points (n, DIMENSIONS), weights (n,) that sum to 1; read-only."""

    points: NDArray[np.float64]
    weights: NDArray[np.float64]


PILOT: Final = 128
"""Approximate number of the first samples that decide how many others are followed."""


@inlined
def pilot_of(count: int) -> int:
    """Number of samples in the pilot of `count`: PILOT or up to twice as many, an equal part of all if possible."""
    return -(-count // max(1, count // PILOT))


@lru_cache(maxsize=8)
def normal_samples(count: int) -> NormalSamples:
    """Make `count` points, at least 2, and their weights. The first half, quarter and so on are evenly spread too."""
    normal, digits = NormalDist(), (count - 1).bit_length()
    quantiles = np.array([normal.inv_cdf((m + 0.5) / 2**digits) for m in range(2**digits)])
    points = quantiles[scrambled(sobol_digits(count, DIMENSIONS, digits), digits)]
    first = points[:, 0] = WIDENED * points[:, 0]
    weights = np.exp(-0.5 * first * first * (1.0 - 1.0 / WIDENED**2))
    weights /= weights.sum()
    points.flags.writeable = weights.flags.writeable = False
    return NormalSamples(points, weights)


class SampleColumns(NamedTuple):
    """The same samples by coordinate, in single precision."""

    points: NDArray[np.float32]  # (DIMENSIONS, n)
    weights: NDArray[np.float64]  # (n,)
    sums: NDArray[np.float64]
    """(2, n): sum of the weights up to each sample, and of their squares."""
    even: NDArray[np.float64]
    """(n,): equal weights, for a first coordinate that is not drawn wider."""
    even_sums: NDArray[np.float64]
    """(2, n): their sums, and of their squares."""
    pilot: int
    """Number of the first samples that are the pilot."""
    order: NDArray[np.int64]
    """(pilot,): sorts the pilot by its first coordinate."""
    ranked: NDArray[np.int64]
    """The samples after the first BASE, sorted by their first coordinate."""
    ranked_sums: NDArray[np.float64]
    """Sum of the weights of those before each of them, and of all."""
    place: NDArray[np.int64]
    """(pilot + 1,): index in `ranked` at which the samples begin that lie beyond each rank of the pilot."""
    extremes: NDArray[np.int64]
    """The samples of the pilot that are farthest in some directions of position and velocity: axes first."""


@lru_cache(maxsize=8)
def sample_columns(count: int) -> SampleColumns:
    """Make the samples of `normal_samples`, for loops over many samples."""
    points, weights = normal_samples(count)
    pilot, columns = pilot_of(count), np.ascontiguousarray(points.T, np.float32)
    sums = np.cumsum([weights, weights**2], axis=1)
    even = np.full(count, 1.0 / count)
    even_sums = np.cumsum([even, even**2], axis=1)
    first = columns[0]
    by_first, base = np.argsort(first[:pilot], kind="stable"), min(BASE, count)
    ranked = base + np.argsort(first[base:], kind="stable")
    columns.flags.writeable = False
    return SampleColumns(
        columns,
        weights,
        sums,
        even,
        even_sums,
        pilot,
        by_first,
        ranked,
        np.concatenate([[0.0], np.cumsum(weights[ranked])]),
        np.concatenate([[0], np.searchsorted(first[ranked], first[by_first[1:]]), [count - base]]),
        _extremes(columns[:6, :pilot]),
    )


def _extremes(points: NDArray[np.float32]) -> NDArray[np.int64]:
    """Indices of the points (6, n) that are farthest along both ways of each axis, then of diagonals with the first."""
    axes = np.eye(6)
    diagonals = np.concatenate([axes[0] + axes[1:], axes[0] - axes[1:]])
    reach = np.concatenate([axes, -axes, diagonals, -diagonals]) @ points
    return np.array(list(dict.fromkeys(reach.argmax(axis=1).tolist())), np.int64)

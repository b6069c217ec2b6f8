"""Evenly spread samples of the standard normal distribution: integrals over it from few points, equal on every run.

The points are a rank-1 lattice, mapped by the inverse of the normal distribution (quasi-Monte Carlo). Its generating
vector is built component by component (Sloan and Reztsov, 2002) for the weighted worst-case error of smooth periodic
functions. The first coordinate is drawn wider and weighted back (importance sampling), so that even few points reach
4 standard deviations in the direction that matters most, and a rare event does not look impossible.
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
"""Factor by which the first coordinate is drawn wider. Larger: rarer events are found, common ones less exact."""

FURTHEST: Final = 4.5
"""Standard deviations beyond which errors are neglected; 7 of a million are larger."""

BASE: Final = 256
"""Number of samples of the coarser lattice that each pair has that may meet, see chosen_samples.py. Of fewer, because
of their weights, the earliest time would have to be that of grown bodies."""

_GOLDEN_RATIO: Final = 0.6180339887498949


class NormalSamples(NamedTuple):
    """points (n, DIMENSIONS), weights (n,) that sum to 1; read-only."""

    points: NDArray[np.float64]
    weights: NDArray[np.float64]


PILOT: Final = 128
"""Approximate size of the coarser lattice that evenly taken points form; it is good by itself."""


def generating_vector(count: int, dimensions: int) -> list[int]:
    """Generating vector z of the lattice {k z / count}.

    Each component minimises the worst-case errors, given those before it: the error of all points, cubed, times the
    error of the coarser lattice among them (after Cools, Kuo and Nuyens, 2006). The errors are those of the Korobov
    space of smoothness 2 with weights 1 / sqrt(j), because later coordinates matter less.
    """
    x = np.arange(count) / count
    kernel = 2.0 * math.pi**2 * (x * x - x + 1.0 / 6.0)
    k = np.arange(count)
    stride = max(1, count // PILOT)
    candidates = [z for z in range(1, count // 2 + 1) if math.gcd(z, count) == 1]
    product = np.ones(count)
    vector = []
    for j in range(1, dimensions + 1):
        best, least = 1, math.inf  # all first components are equally good
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
    """Make `count` points, at least 2, and their weights."""
    normal = NormalDist()
    quantiles = np.array([normal.inv_cdf((m + 0.5) / count) for m in range(count)])
    vector = np.array(generating_vector(count, DIMENSIONS))
    shifts = (np.arange(DIMENSIONS) * _GOLDEN_RATIO % 1.0 * count).astype(int)  # else one point is a corner
    points = quantiles[(np.arange(count)[:, None] * vector + shifts) % count]
    first = points[:, 0] = WIDENED * points[:, 0]
    weights = np.exp(-0.5 * first * first * (1.0 - 1.0 / WIDENED**2))
    weights /= weights.sum()
    points.flags.writeable = weights.flags.writeable = False
    return NormalSamples(points, weights)


def _reversed(k: int) -> float:
    """Digits of k in base 2 in reverse order, as a fraction (van der Corput): 0, 1/2, 1/4, 3/4 for 0 to 3."""
    return float(sum((k >> bit & 1) / 2 ** (bit + 1) for bit in range(k.bit_length())))


class SampleColumns(NamedTuple):
    """The same samples by coordinate, the coarser lattices first; any few in succession are spread out.

    The first pilot samples are a lattice, and twice, four times as many are too, if all are a multiple.
    """

    points: NDArray[np.float64]  # (DIMENSIONS, n)
    weights: NDArray[np.float64]  # (n,)
    sums: NDArray[np.float64]
    """(2, n): sum of the weights up to each sample, and of their squares."""
    even: NDArray[np.float64]
    """(n,): equal weights, for a first coordinate that is not drawn wider."""
    even_sums: NDArray[np.float64]
    """(2, n): their sums, and of their squares."""
    pilot: int
    """Number of samples of the coarser lattice."""
    order: NDArray[np.int64]
    """(pilot,): sorts the coarser lattice by its first coordinate."""
    ranked: NDArray[np.int64]
    """The samples after the first BASE, sorted by their first coordinate."""
    ranked_sums: NDArray[np.float64]
    """Sum of the weights of those before each of them, and of all."""
    place: NDArray[np.int64]
    """(pilot + 1,): index in `ranked` at which the samples begin that lie beyond each rank of the coarser lattice."""
    extremes: NDArray[np.int64]
    """The samples of the coarser lattice that are farthest in some directions of position and velocity: axes first."""


@lru_cache(maxsize=8)
def sample_columns(count: int) -> SampleColumns:
    """Make the samples of `normal_samples`, for loops over many samples."""
    points, weights = normal_samples(count)
    stride = max(1, count // PILOT)
    place = np.arange(count)
    coset = np.array([_reversed(k) for k in range(stride)])
    order = np.lexsort((place // stride * _GOLDEN_RATIO % 1.0, coset[place % stride]))
    pilot = -(-count // stride)
    ordered = np.ascontiguousarray(points[order].T)
    sums = np.cumsum([weights[order], weights[order] ** 2], axis=1)
    even = np.full(count, 1.0 / count)
    even_sums = np.cumsum([even, even**2], axis=1)
    first = ordered[0]
    by_first, base = np.argsort(first[:pilot], kind="stable"), min(BASE, count)
    ranked = base + np.argsort(first[base:], kind="stable")
    columns = SampleColumns(
        ordered,
        weights[order],
        sums,
        even,
        even_sums,
        pilot,
        by_first,
        ranked,
        np.concatenate([[0.0], np.cumsum(weights[order][ranked])]),
        np.concatenate([[0], np.searchsorted(first[ranked], first[by_first[1:]]), [count - base]]),
        _extremes(ordered[:6, :pilot]),
    )
    columns.points.flags.writeable = columns.weights.flags.writeable = False
    return columns


def _extremes(points: NDArray[np.float64]) -> NDArray[np.int64]:
    """Indices of the points (6, n) that are farthest along both ways of each axis, then of diagonals with the first."""
    axes = np.eye(6)
    diagonals = np.concatenate([axes[0] + axes[1:], axes[0] - axes[1:]])
    reach = np.concatenate([axes, -axes, diagonals, -diagonals]) @ points
    return np.array(list(dict.fromkeys(reach.argmax(axis=1).tolist())), np.int64)

"""Arrays of axis-aligned boxes: input check of the space partitions, and overlap tests of many pairs at once."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.checks.numbers import real_array
from collision_monitor.errors import InputError

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

CANDIDATES_AT_ONCE: Final = 1 << 20
"""Candidates compared in one batch, which limits the temporary arrays to 100 MB."""


def box_arrays(lower: ArrayLike, upper: ArrayLike) -> tuple[Array, Array]:
    """Corners (N, 2 or 3) in m as float64 arrays. Raises InputError if they are not finite or lower > upper."""
    try:
        low, high = real_array(lower), real_array(upper)
    except (TypeError, ValueError, OverflowError):
        raise InputError("boxes: expected corners of shape (N, 2 or 3), got something else than numbers") from None
    if low.ndim != 2 or low.shape[1] not in (2, 3) or low.shape != high.shape:
        raise InputError(f"boxes: expected corners of shape (N, 2 or 3), got {low.shape} and {high.shape}")
    if not (np.isfinite(low).all() and np.isfinite(high).all() and (low <= high).all()):
        raise InputError("boxes: expected finite corners with lower <= upper, got others")
    return low, high


def concatenated_ranges(first: Indices, count: Indices) -> tuple[Indices, Indices]:
    """Concatenate the ranges first[k] … first[k] + count[k] - 1 over all k; return the numbers and the k of each."""
    owner = np.repeat(np.arange(len(count)), count)
    return np.arange(len(owner)) + np.repeat(first - (np.cumsum(count) - count), count), owner


def overlaps_in_ranges(low: Array, high: Array, box: Indices, first: Indices, count: Indices) -> Indices:
    """Pairs (M, 2) of box[k] and each box first[k] … first[k] + count[k] - 1 that it overlaps or touches."""
    found = [np.zeros((0, 2), np.int64)]
    done = np.cumsum(count)
    begin = 0
    while begin < len(box):
        most = (done[begin - 1] if begin else 0) + CANDIDATES_AT_ONCE
        end = max(int(np.searchsorted(done, most, side="right")), begin + 1)
        j, owner = concatenated_ranges(first[begin:end], count[begin:end])
        found.append(overlaps(low, high, box[begin:end][owner], j))
        begin = end
    return np.concatenate(found)


def overlaps(low: Array, high: Array, i: Indices, j: Indices) -> Indices:
    """Pairs (M, 2) among i, j with boxes that overlap or touch; tests axis by axis, as most fail on the first."""
    for axis in range(low.shape[1]):
        meet = (low[i, axis] <= high[j, axis]) & (low[j, axis] <= high[i, axis])
        i, j = i[meet], j[meet]
    return np.stack([i, j], axis=1)


def in_order(pairs: Indices) -> Indices:
    """Sort the pairs, with the smaller number of each pair first."""
    pairs = np.sort(pairs, axis=1)
    return np.asarray(pairs[np.lexsort((pairs[:, 1], pairs[:, 0]))])

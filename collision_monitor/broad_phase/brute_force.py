"""Brute-force broad phase: compares every pair of boxes. The reference in the tests of the grids."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def overlapping_pairs(lower: Array, upper: Array) -> NDArray[np.int64]:
    """Pairs (M, 2), i < j, sorted, of axis-aligned boxes (N, 3) that overlap or touch."""
    meet = np.all((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None]), axis=-1)
    return np.argwhere(np.triu(meet, k=1))

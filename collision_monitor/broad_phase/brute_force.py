"""Brute-force broad phase: compares every pair of boxes. The reference in the tests of the grids."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor.broad_phase.boxes import box_arrays


def overlapping_pairs(lower: ArrayLike, upper: ArrayLike) -> NDArray[np.int64]:
    """Pairs (M, 2), i < j, sorted, of axis-aligned boxes (N, 2 or 3) that overlap or touch. Raises InputError."""
    low, high = box_arrays(lower, upper)
    meet = np.all((low[:, None] <= high[None]) & (low[None] <= high[:, None]), axis=-1)
    return np.argwhere(np.triu(meet, k=1))

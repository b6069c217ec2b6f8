"""Octree, or quadtree in the plane: each box is stored in the smallest cell that contains it entirely.

A box can therefore only meet boxes of its own cell and of that cell's ancestors up to the root. Only occupied cells are
stored, sorted. A box across the middle plane of a large cell stays in that cell, however small the box is. Loose
octrees and grids with one resolution per size avoid this. (Slides "Spatial partitioning: quadtrees and octrees")
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.broad_phase.boxes import Indices, box_arrays, in_order, overlaps_in_ranges

DEPTH: Final = 18
"""Levels below the root. Three coordinates of DEPTH bits each and the level fit into one 64-bit number."""


def octree_overlaps(lower: ArrayLike, upper: ArrayLike) -> Indices:
    """Pairs (M, 2), i < j, sorted, of boxes (N, 2 or 3) that overlap or touch."""
    low, high = box_arrays(lower, upper)
    if not len(low):
        return np.zeros((0, 2), np.int64)
    base = low.min(axis=0)
    # a power of two, so that the scaling is exact except for negligibly small numbers
    scale = 2.0 ** (DEPTH - np.ceil(np.log2(max(float((high - base).max()), 1e-300))))
    first, last = (np.minimum((corner - base) * scale, 2.0**DEPTH - 1).astype(np.int64) for corner in (low, high))
    # all bits above the highest bit in which the cells of the corners differ give the smallest common cell
    differ = np.bitwise_or.reduce(first ^ last, axis=1)
    level = DEPTH - np.frexp(differ.astype(np.float64))[1]
    key = _key(first, level)
    order = np.argsort(key, kind="stable")
    low, high, first, level, key = low[order], high[order], first[order], level[order], key[order]
    place = np.arange(len(low))
    # against the boxes behind it in its own cell, and against all boxes in the ancestor cells
    end = np.searchsorted(key, key, side="right")
    found = [overlaps_in_ranges(low, high, place, place + 1, end - place - 1)]
    for k in range(int(level.max())):
        some = place[level > k]
        around = _key(first[some], np.full(len(some), k))
        begin, end = np.searchsorted(key, around), np.searchsorted(key, around, side="right")
        found.append(overlaps_in_ranges(low, high, some, begin, end - begin))
    return in_order(order[np.concatenate(found)])


def _key(cell: Indices, level: Indices) -> Indices:
    """Sort key of the cell of a level that contains a finest cell (n, 2 or 3)."""
    key = np.asarray(level, np.int64)
    for coordinate in cell.T:
        key = key << DEPTH | coordinate >> (DEPTH - level)
    return key

"""k-d tree over space: planes across x, y, z in turn halve the boxes; a box across a plane goes to both sides.

Built level by level. Only boxes of one leaf can meet. (Bentley, 1975; slides "Efficient collision detection": trees,
k-d tree)
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.broad_phase.boxes import Array, Indices, box_arrays, in_order, overlaps_in_ranges

LEAF: Final = 8
"""Boxes of a leaf, about. Larger: more pairs to compare. Smaller: more boxes cross planes."""

COPIES: Final = 8
"""Most entries per box in all leaves; boxes that all cross each other's planes are not divided further."""


def kd_tree_overlaps(lower: ArrayLike, upper: ArrayLike) -> Indices:
    """Pairs (M, 2), i < j, sorted, of boxes (N, 2 or 3) that overlap or touch. Raises InputError."""
    low, high = box_arrays(lower, upper)
    if not len(low):
        return np.zeros((0, 2), np.int64)
    box, node = _leaves(low, high)
    place = np.arange(len(box))
    end = np.searchsorted(node, node, side="right")
    pairs = in_order(box[overlaps_in_ranges(low[box], high[box], place, place + 1, end - place - 1)])
    return np.unique(pairs, axis=0) if len(pairs) else pairs


def _leaves(low: Array, high: Array) -> tuple[Indices, Indices]:
    """Entries of the leaves: box and leaf (K,), sorted by leaf."""
    n, width = low.shape
    box, node = np.arange(n), np.zeros(n, np.int64)
    middle = 0.5 * low + 0.5 * high
    for level in range(max(int(np.ceil(np.log2(max(n / LEAF, 1)))), 0)):
        axis = level % width
        order = np.lexsort((middle[box, axis], node))
        box, node = box[order], node[order]
        first = np.flatnonzero(np.diff(node, prepend=-1))
        count = np.diff(first, append=len(node))
        plane = np.repeat(middle[box[first + count // 2], axis], count)
        before, behind = low[box, axis] <= plane, high[box, axis] >= plane
        if before.sum() + behind.sum() > COPIES * n:
            break
        box = np.concatenate([box[before], box[behind]])
        node = np.concatenate([2 * node[before], 2 * node[behind] + 1])
    order = np.argsort(node, kind="stable")
    return box[order], node[order]

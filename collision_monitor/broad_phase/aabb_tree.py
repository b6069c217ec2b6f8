"""AABB tree, built level by level: each node is split at the median of its widest axis, down to one or two boxes.

(Slides "Bounding volume hierarchies"; Ericson, Real-Time Collision Detection, 6.2)
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.broad_phase.boxes import Array, Indices, box_arrays, concatenated_ranges, in_order, overlaps


class AabbTree(NamedTuple):
    """AABB tree. Level k has 2^k nodes: lower[k], upper[k] (2^k, 2 or 3) in m.

    Node m of the last level holds the boxes order[first[m]] … order[first[m + 1] - 1].
    """

    lower: list[Array]
    upper: list[Array]
    order: Indices
    first: Indices


def aabb_tree(lower: ArrayLike, upper: ArrayLike) -> AabbTree:
    """Build the tree of N >= 1 boxes (N, 2 or 3) in m. Raises InputError."""
    low, high = box_arrays(lower, upper)
    n, depth = len(low), max(len(low).bit_length() - 1, 0)
    middle = low + 0.5 * (high - low)
    order = np.arange(n)
    lowers, uppers = [], []
    for k in range(depth + 1):
        first = np.arange(2**k) * n >> k
        lowers.append(np.minimum.reduceat(low[order], first))
        uppers.append(np.maximum.reduceat(high[order], first))
        if k < depth:
            node = np.repeat(np.arange(2**k), np.diff(first, append=n))
            spread = np.maximum.reduceat(middle[order], first) - np.minimum.reduceat(middle[order], first)
            along = middle[order, spread.argmax(axis=1)[node]]
            order = order[np.lexsort((along, node))]
    return AabbTree(lowers, uppers, order, np.append(first, n))


def tree_overlaps(lower: ArrayLike, upper: ArrayLike) -> Indices:
    """Pairs (M, 2), i < j, sorted, of boxes (N, 2 or 3) that overlap or touch; tests the tree against itself."""
    low, high = box_arrays(lower, upper)
    if not len(low):
        return np.zeros((0, 2), np.int64)
    tree = aabb_tree(low, high)
    i = j = np.zeros(1, np.int64)
    for node_low, node_high in zip(tree.lower[1:], tree.upper[1:], strict=True):
        same = i == j
        # both halves against both halves, but a node's own two halves against each other only once
        i = np.concatenate([2 * i, 2 * i, 2 * i[~same] + 1, 2 * i + 1])
        j = np.concatenate([2 * j, 2 * j + 1, 2 * j[~same], 2 * j + 1])
        i, j = overlaps(node_low, node_high, i, j).T
    size = np.diff(tree.first)
    b, owner = concatenated_ranges(tree.first[j], size[j])
    a, again = concatenated_ranges(tree.first[i[owner]], size[i[owner]])
    b = b[again]
    pairs = tree.order[np.stack([a, b], axis=1)[(a < b) | (i != j)[owner[again]]]]
    return in_order(overlaps(low, high, *pairs.T))

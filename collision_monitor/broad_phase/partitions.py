"""The space partitions behind one interface: corners of boxes in, overlapping pairs out, in space and in the plane.

The monitor uses the grids; the others serve comparison and use without a monitor.
benchmarks/space_partitions.py measures them against each other.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

import numpy as np

from collision_monitor.broad_phase.aabb_tree import tree_overlaps
from collision_monitor.broad_phase.box_pairs import box_pairs
from collision_monitor.broad_phase.boxes import Array, Indices, box_arrays, in_order, overlaps
from collision_monitor.broad_phase.brute_force import overlapping_pairs
from collision_monitor.broad_phase.hashed_grid import make_hashed_grid, put_boxes, query_boxes
from collision_monitor.broad_phase.kd_tree import kd_tree_overlaps
from collision_monitor.broad_phase.octree import octree_overlaps
from collision_monitor.broad_phase.sweep_and_prune import sweep_and_prune

Partition = Callable[[Array, Array], Indices]
"""Lower and upper corners (N, 2 or 3) in m -> pairs (M, 2), i < j, sorted, of boxes that overlap or touch."""


def grid_overlaps(lower: Array, upper: Array) -> Indices:
    """Pairs by the grid that sorts all boxes anew, with one resolution for each size class. Raises InputError."""
    low, high = box_arrays(lower, upper)
    centre, half = _rounded_out(low, high)
    return overlaps(low, high, *box_pairs(centre, half).astype(np.int64).T)


def quadtree_overlaps(lower: Array, upper: Array) -> Indices:
    """Pairs by a quadtree over x and y, which suits boxes that stand on a floor. Raises InputError."""
    low, high = box_arrays(lower, upper)
    i, j = octree_overlaps(low[:, :2], high[:, :2]).T
    return overlaps(low, high, i, j)


def hashed_grid_overlaps(lower: Array, upper: Array) -> Indices:
    """Pairs by the grid updated box by box, with one resolution for each power of two. Raises InputError."""
    low, high = box_arrays(lower, upper)
    n = len(low)
    grid, every = make_hashed_grid(n), np.arange(n, dtype=np.int32)
    put_boxes(grid, every, *_rounded_out(low, high))
    pairs = np.empty((8 * n, 2), np.int32)
    count = query_boxes(grid, every, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), np.int32)
        query_boxes(grid, every, pairs)
    i, j = pairs[:count].astype(np.int64).T
    return in_order(overlaps(low, high, i[i < j], j[i < j]))


def _rounded_out(low: Array, high: Array) -> tuple[Array, Array]:
    """Centres and half extents (N, 3) in m of boxes that contain these boxes in spite of round-off.

    Those of the plane lie at z = 0.
    """
    flat = ((0, 0), (0, 3 - low.shape[1]))
    low, high = np.pad(low, flat), np.pad(high, flat)
    centre = low + 0.5 * (high - low)
    half = np.maximum(high - centre, centre - low)
    return centre, np.nextafter(half + 1e-15 * np.abs(centre), np.inf)


PARTITIONS: Final[dict[str, Partition]] = {
    "brute force": overlapping_pairs,
    "sweep and prune": sweep_and_prune,
    "AABB tree": tree_overlaps,
    "quadtree": quadtree_overlaps,
    "octree": octree_overlaps,
    "k-d tree": kd_tree_overlaps,
    "grid": grid_overlaps,
    "hashed grid": hashed_grid_overlaps,
}

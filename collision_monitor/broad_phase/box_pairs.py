"""Pairs of axis-aligned boxes that overlap, by one dense grid, and the boxes of a grid that overlap a region."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor._jit.prefetch import prefetch
from collision_monitor.broad_phase.dense_grid import (
    AHEAD,
    PAD,
    Bounds,
    class_is_empty,
    find_buckets,
    gather_centres,
    make_grid,
    measure_classes,
    partners,
    places,
    plan_cells,
    searches,
    sort_by_cell,
)
from collision_monitor.broad_phase.size_classes import ABSENT, CLASSES, LARGEST_BODY, OCTAVES, STARTING, classify
from collision_monitor.errors import InputError


@device
def sort_pairs(pairs: Any, count: int, other: Any, begins: Any) -> None:
    """Sort pairs[:count] of numbers below begins.size - 1 by first, then second, with two stable counting sorts."""
    for column in (1, 0):
        source, target = (pairs, other) if column == 1 else (other, pairs)
        begins[:] = 0
        for k in range(count):
            begins[source[k, column] + 1] += 1
        for i in range(1, begins.size):
            begins[i] += begins[i - 1]
        for k in range(count):
            i = source[k, column]
            target[begins[i], 0] = source[k, 0]
            target[begins[i], 1] = source[k, 1]
            begins[i] += 1


@device
def _sort_boxes(centre: Any, half: Any, starts: Any, grid: Any, extent: Any, scratch: Any) -> None:
    size, octave, cubes = scratch
    n = centre.shape[0]
    lx = ly = lz = np.inf
    hx = hy = hz = -np.inf
    for i in range(n):
        x, y, z = centre[i, 0], centre[i, 1], centre[i, 2]
        size[i] = max(half[i, 0], half[i, 1], half[i, 2])
        if not max(abs(x), abs(y), abs(z)) <= LARGEST_BODY:
            size[i] = np.inf
        total = half[i, 0] + half[i, 1] + half[i, 2] + x + y + z
        if total != total or not min(half[i, 0], half[i, 1], half[i, 2]) >= 0.0:
            size[i] = np.nan
        if size[i] <= LARGEST_BODY:
            lx, ly, lz = min(lx, x), min(ly, y), min(lz, z)
            hx, hy, hz = max(hx, x), max(hy, y), max(hz, z)
    classify(size, starts, octave, cubes, grid)
    measure_classes(size, grid)
    cells = plan_cells(lx, ly, lz, hx, hy, hz, grid)
    find_buckets(centre, grid, 0, n)
    sort_by_cell(n, cells, grid)
    gather_centres(centre, grid, 0, n)
    for p in range(n):
        prefetch(half, np.intp(grid.order[min(p + AHEAD, n - 1)]))
        for c in range(3):
            extent[c, p] = half[grid.order[p], c]


@allocating_kernel
def sort_boxes(centre: Any, half: Any, starts: Any, grid: Any, extent: Any) -> None:
    """Sort boxes with centre, half (N, 3) in m by cell: fill `grid`, and extent (3, N + PAD) in its order.

    A box with a NaN or a negative half extent is absent. starts (N,) bool: those that search, see `box_pairs`.
    """
    scratch = np.empty(centre.shape[0]), np.empty((OCTAVES, 2), np.int64), np.empty((OCTAVES, 2))
    _sort_boxes(centre, half, starts, grid, extent, scratch)


@inlined
def boxes_at(grid: Any, extent: Any, region: Any, found: Any) -> int:
    """Write the places of all boxes of a grid that overlap the Region into found (N + 1,); return their number.

    Uses the first place behind the last box.
    """
    p = grid.order.size
    grid.centre[0, p], grid.centre[1, p], grid.centre[2, p] = region.x, region.y, region.z
    extent[0, p], extent[1, p], extent[2, p] = region.hx, region.hy, region.hz
    n = 0
    for k in range(CLASSES):
        if not class_is_empty(grid, k):
            n = partners(grid, Bounds(extent, False), ABSENT, k, p, found, n)
    return n


@allocating_kernel
def _box_pairs(centre: Any, half: Any, starts: Any, grid: Any, pairs: Any) -> int:
    """Write pairs into pairs (P, 2), sorted unless there are more than P; return their number."""
    n = centre.shape[0]
    extent = np.zeros((3, n + PAD))
    scratch = np.empty(n), np.empty((OCTAVES, 2), np.int64), np.empty((OCTAVES, 2))
    _sort_boxes(centre, half, starts, grid, extent, scratch)
    found = np.empty(n + PAD, np.int32)
    total = 0
    for a in range(STARTING):
        first, end = places(grid, a)
        for b in range(CLASSES):
            if not searches(grid, a, b):
                continue
            for p in range(first, end):
                count = partners(grid, Bounds(extent, False), a, b, p, found, 0)
                i = grid.order[p]
                for m in range(count):
                    if total < pairs.shape[0]:
                        j = grid.order[found[m]]
                        pairs[total, 0] = min(i, j)
                        pairs[total, 1] = max(i, j)
                    total += 1
    if total <= pairs.shape[0]:
        sort_pairs(pairs, total, np.empty((total, 2), np.int32), np.empty(n + 1, np.int32))
    return total


def box_pairs(centre: ArrayLike, half: ArrayLike, starts: ArrayLike | None = None) -> NDArray[np.int32]:
    """Pairs (M, 2), i < j, sorted, of axis-aligned boxes that overlap or touch: |centre difference| <= sum of halves.

    centre, half extents: (N, 3) m; half extents may be infinite, and a box with a NaN or a negative half extent meets
    nothing. starts (N,) bool: pairs of two boxes without the flag are omitted and not visited. Raises InputError.
    """
    centre = np.ascontiguousarray(centre, dtype=np.float64)
    half = np.ascontiguousarray(half, dtype=np.float64)
    n = len(centre)
    if centre.shape != (n, 3) or half.shape != (n, 3):
        raise InputError(f"expected centres and half extents of shape (N, 3), got {centre.shape} and {half.shape}")
    starting = np.ones(n, np.bool_) if starts is None else np.ascontiguousarray(starts, dtype=np.bool_)
    if starting.shape != (n,):
        raise InputError(f"starts: expected {n} flags, one for each box, got an array of shape {starting.shape}")
    grid = make_grid(n)
    pairs = np.empty((16 * n + 16, 2), np.int32)  # more than most scenes have; unwritten memory costs nothing
    count = _box_pairs(centre, half, starting, grid, pairs)
    if count > len(pairs):
        pairs = np.empty((count, 2), np.int32)
        _box_pairs(centre, half, starting, grid, pairs)
    return pairs[:count]

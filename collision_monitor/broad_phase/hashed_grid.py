"""Hashed uniform grid with one resolution per size class, updated object by object.

Each box is stored in exactly one cell: the cell of its centre, at the level with cells at least as wide as the
box. A query visits the cells from which a box of the level could reach, so mixed sizes cost one lookup per occupied
level. Cells are chains in a hash table, so that empty space costs nothing. A chain links nodes of half a cache line
with rounded bounds; the exact box is read only if these meet.
Source: lecture slides "Efficient collision detection: spatial partitioning" (hash tables, multiresolution grids).
"""

from __future__ import annotations

from math import frexp
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, inlined, kernel
from collision_monitor._jit.alignment import aligned_zeros
from collision_monitor._jit.settled import settled
from collision_monitor.broad_phase.region import Region, regions_overlap

GRID_LEVELS: Final = 128
"""Number of cell sizes."""

LEVEL_OFFSET: Final = 64
"""Level of cells 1 m wide; levels run from 2^-64 m to 2^63 m, and other sizes use the outermost levels."""

CELL_LIMIT: Final = 2.0**62
"""Cell coordinates are clipped to this, so that no position overflows an int64; clipped boxes share cells."""

GRID_BOX = np.dtype(
    [
        ("x", np.float64),  # centre (m)
        ("y", np.float64),
        ("z", np.float64),
        ("hx", np.float64),  # half extents (m)
        ("hy", np.float64),
        ("hz", np.float64),
        ("cell_x", np.int64),
        ("cell_y", np.int64),
        ("cell_z", np.int64),
        ("level", np.int32),  # -1: the box is not in the grid
        ("previous", np.int32),  # in the bucket; -2 - bucket: first of the chain
        ("level_previous", np.int32),  # in the level; -1: first of the chain
        ("reserved", np.int32),  # 0; the record has no padding, whose bytes a copy need not keep
    ],
    align=True,
)
"""One box."""

GRID_NODE = np.dtype(
    [
        ("low_x", np.float32),  # bounds of the box (m), rounded outwards
        ("low_y", np.float32),
        ("low_z", np.float32),
        ("high_x", np.float32),
        ("high_y", np.float32),
        ("high_z", np.float32),
        ("next", np.int32),  # in the bucket; -1: end of the chain
        ("level_next", np.int32),  # in the chain of all boxes of a level
    ]
)
"""What a query reads of every box that it passes."""

FLOAT32_ROUNDING: Final = 2.0**-23
"""Twice the relative rounding error of a float32."""

FLOAT64_ROUNDING: Final = 2.0**-50
"""More than the relative rounding error of a bound computed from a centre and a half extent."""

SMALLEST: Final = 1e-40
"""m: more than the rounding error of the smallest float32 numbers."""

LARGEST_FLOAT32: Final = 3e38
"""Nearly the largest float32; larger numbers would become infinite."""


class HashedGrid(NamedTuple):
    """Grid with a capacity of N boxes and B buckets (a power of two)."""

    box: Any  # (N,) GRID_BOX
    node: Any  # (N,) GRID_NODE: of the same boxes
    head: Any  # (B,) int32: first box of the bucket, -1: none
    level_head: Any  # (GRID_LEVELS,) int32
    level_count: Any  # (GRID_LEVELS,) int32


def make_hashed_grid(capacity: int) -> HashedGrid:
    """Create an empty grid for box numbers 0 … capacity - 1."""
    buckets = 1 << max(4, (2 * capacity - 1).bit_length())
    box = np.zeros(capacity, GRID_BOX)
    box["level"] = -1
    return HashedGrid(
        box=box,
        node=aligned_zeros(capacity, GRID_NODE),  # so that none is in two cache lines
        head=np.full(buckets, -1, np.int32),
        level_head=np.full(GRID_LEVELS, -1, np.int32),
        level_count=np.zeros(GRID_LEVELS, np.int32),
    )


def regridded(box: NDArray[np.void], capacity: int) -> HashedGrid:
    """Create a grid of this capacity with all boxes (N,) GRID_BOX that were in a grid."""
    grid = make_hashed_grid(capacity)
    centre, half = np.empty((2, len(box), 3))
    read_boxes(box, centre, half)
    put_boxes(grid, np.flatnonzero(box["level"] >= 0).astype(np.int32), centre, half)
    return grid


@device
def _level_of(width: float) -> int:
    """Return the finest level with cells at least `width` wide."""
    if not width < 2.0**62:
        return GRID_LEVELS - 1
    exponent = frexp(width)[1] if width > 0.0 else -LEVEL_OFFSET
    return max(exponent + LEVEL_OFFSET, 0)


@device
def _coordinate(x: Any, cell: Any) -> Any:
    return np.int64(min(max(np.floor(x / cell), -CELL_LIMIT), CELL_LIMIT))


@inlined
def _bucket(level: Any, x: Any, y: Any, z: Any, mask: Any) -> Any:
    h = np.uint64(x) * np.uint64(0x9E3779B97F4A7C15) + np.uint64(y) * np.uint64(0xBF58476D1CE4E5B9)
    h += np.uint64(z) * np.uint64(0x94D049BB133111EB) + np.uint64(level) * np.uint64(0xD6E8FEB86659FD93)
    h = (h ^ (h >> np.uint64(32))) * np.uint64(0x9E3779B97F4A7C15)
    return np.int64((h >> np.uint64(32)) & np.uint64(mask))


@device
def remove_box(grid: HashedGrid, i: int) -> None:
    """Remove box i from the grid; do nothing if it is not in the grid."""
    box = grid.box[i]
    if box.level < 0:
        return
    node = grid.node[i]
    if box.previous < -1:
        grid.head[-2 - box.previous] = node.next
    else:
        grid.node[box.previous].next = node.next
    if node.next >= 0:
        grid.box[node.next].previous = box.previous
    if box.level_previous < 0:
        grid.level_head[box.level] = node.level_next
    else:
        grid.node[box.level_previous].level_next = node.level_next
    if node.level_next >= 0:
        grid.box[node.level_next].level_previous = box.level_previous
    grid.level_count[box.level] -= 1
    box.level = -1


@inlined
def _low(centre: float, half: float, rounding: float) -> float:
    return centre - half - (rounding * (abs(centre) + half) + SMALLEST)


@inlined
def _high(centre: float, half: float, rounding: float) -> float:
    return centre + half + (rounding * (abs(centre) + half) + SMALLEST)


@inlined
def _write_bounds(node: Any, box: Region) -> None:
    """Write the bounds of a box (a Region), rounded outwards, into its node."""
    node.low_x = np.float32(min(_low(box.x, box.hx, FLOAT32_ROUNDING), LARGEST_FLOAT32))
    node.low_y = np.float32(min(_low(box.y, box.hy, FLOAT32_ROUNDING), LARGEST_FLOAT32))
    node.low_z = np.float32(min(_low(box.z, box.hz, FLOAT32_ROUNDING), LARGEST_FLOAT32))
    node.high_x = np.float32(max(_high(box.x, box.hx, FLOAT32_ROUNDING), -LARGEST_FLOAT32))
    node.high_y = np.float32(max(_high(box.y, box.hy, FLOAT32_ROUNDING), -LARGEST_FLOAT32))
    node.high_z = np.float32(max(_high(box.z, box.hz, FLOAT32_ROUNDING), -LARGEST_FLOAT32))


@inlined
def _may_overlap(low: Any, high: Any, node: Any) -> Any:
    """Whether the bounds of a node meet the corners `low` and `high` (m) of a box; True if the boxes overlap."""
    # no branches: each would be taken at random
    along_x = (low[0] <= node.high_x) & (node.low_x <= high[0])
    along_y = (low[1] <= node.high_y) & (node.low_y <= high[1])
    return along_x & along_y & (low[2] <= node.high_z) & (node.low_z <= high[2])


@device
def put_box(grid: HashedGrid, i: int, region: Region) -> None:
    """Insert box i with the bounds `region`, or move it there."""
    remove_box(grid, i)
    box, node = grid.box[i], grid.node[i]
    level = _level_of(2.0 * max(region.hx, region.hy, region.hz))
    size = 2.0 ** (level - LEVEL_OFFSET)
    x, y, z = _coordinate(region.x, size), _coordinate(region.y, size), _coordinate(region.z, size)
    bucket = _bucket(level, x, y, z, grid.head.size - 1)
    box.level = level
    box.cell_x, box.cell_y, box.cell_z = x, y, z
    box.x, box.y, box.z = region.x, region.y, region.z
    box.hx, box.hy, box.hz = region.hx, region.hy, region.hz
    _write_bounds(node, region)
    node.next = grid.head[bucket]
    box.previous = -2 - bucket
    if node.next >= 0:
        grid.box[node.next].previous = i
    grid.head[bucket] = i
    node.level_next = grid.level_head[level]
    box.level_previous = -1
    if node.level_next >= 0:
        grid.box[node.level_next].level_previous = i
    grid.level_head[level] = i
    grid.level_count[level] += 1


@device
def query_box(grid: Any, box: Any, i: Any, found: Any) -> Any:
    """Write all boxes except number i that overlap `box` (a Region or a GRID_BOX) to found[0:n], unordered.

    Returns n. If n is larger than found.size, the rest was counted but not written.
    """
    n = 0
    low = (
        _low(box.x, box.hx, FLOAT64_ROUNDING),
        _low(box.y, box.hy, FLOAT64_ROUNDING),
        _low(box.z, box.hz, FLOAT64_ROUNDING),
    )
    high = (
        _high(box.x, box.hx, FLOAT64_ROUNDING),
        _high(box.y, box.hy, FLOAT64_ROUNDING),
        _high(box.z, box.hz, FLOAT64_ROUNDING),
    )
    for level in range(GRID_LEVELS):
        count = grid.level_count[level]
        if count == 0:
            continue
        size = 2.0 ** (level - LEVEL_OFFSET)
        # a box of this level reaches at most half a cell from its centre; the outermost level holds boxes of any size
        reach = 0.5 * size if level < GRID_LEVELS - 1 else np.inf
        x0, x1 = np.floor((box.x - box.hx - reach) / size), np.floor((box.x + box.hx + reach) / size)
        y0, y1 = np.floor((box.y - box.hy - reach) / size), np.floor((box.y + box.hy + reach) / size)
        z0, z1 = np.floor((box.z - box.hz - reach) / size), np.floor((box.z + box.hz + reach) / size)
        cells = (x1 - x0 + 1.0) * (y1 - y0 + 1.0) * (z1 - z0 + 1.0)
        outermost = max(abs(x0), abs(x1), abs(y0), abs(y1), abs(z0), abs(z1))
        if not (cells <= 2.0 * count and outermost < CELL_LIMIT):
            j = grid.level_head[level]
            while j >= 0:
                if j != i and _may_overlap(low, high, grid.node[j]) and regions_overlap(box, grid.box[j]):
                    if n < found.size:
                        found[n] = j
                    n += 1
                j = grid.node[j].level_next
            continue
        for x in range(np.int64(x0), np.int64(x1) + 1):
            for y in range(np.int64(y0), np.int64(y1) + 1):
                for z in range(np.int64(z0), np.int64(z1) + 1):
                    j = grid.head[_bucket(level, x, y, z, grid.head.size - 1)]
                    while j >= 0:
                        other = grid.box[j]
                        if (
                            _may_overlap(low, high, grid.node[j])
                            and regions_overlap(box, other)
                            and other.cell_x == x
                            and other.cell_y == y
                            and other.cell_z == z
                            and other.level == level
                            and j != i
                        ):
                            if n < found.size:
                                found[n] = j
                            n += 1
                        j = grid.node[j].next
    return n


@kernel
def put_boxes(grid: HashedGrid, which: Any, centre: Any, half: Any) -> None:
    """Insert the boxes `which` (M,) with centre, half (N, 3) in m, indexed by box number."""
    for k in range(which.size):
        i = which[k]
        x, y, z = centre[i, 0], centre[i, 1], centre[i, 2]
        put_box(grid, i, Region(x, y, z, half[i, 0], half[i, 1], half[i, 2]))


@kernel
def read_boxes(box: Any, centre: Any, half: Any) -> None:
    """Copy the first N boxes (GRID_BOX) into centre, half (N, 3) in m.

    A box that is not in the grid gets a NaN half extent, so that it meets nothing.
    """
    for i in range(centre.shape[0]):
        centre[i, 0], centre[i, 1], centre[i, 2] = box[i].x, box[i].y, box[i].z
        half[i, 0], half[i, 1], half[i, 2] = box[i].hx, box[i].hy, box[i].hz
        if box[i].level < 0:
            half[i, 0] = np.nan


@settled
@kernel
def remove_boxes(grid: HashedGrid, which: Any) -> None:
    """Remove the boxes `which` (M,)."""
    for k in range(which.size):
        remove_box(grid, which[k])


@allocating_kernel
def query_boxes(grid: Any, which: Any, pairs: Any) -> Any:
    """Write all (i, j) with i in `which` (M,) and j overlapping i to pairs (P, 2); return their number.

    If the number exceeds P, call again with a larger array.
    """
    found = np.empty(grid.box.size, np.int32)
    n = 0
    for k in range(which.size):
        i = which[k]
        count = query_box(grid, grid.box[i], i, found)
        for m in range(count):
            if n < pairs.shape[0]:
                pairs[n, 0] = i
                pairs[n, 1] = found[m]
            n += 1
    return n

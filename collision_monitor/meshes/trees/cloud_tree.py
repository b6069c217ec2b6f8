"""Tree over points: boxes along the axes around runs of points along a space-filling curve.

A cloud may be replaced at every step, so its tree is made in two passes over the points: their order along the Z curve,
by a radix sort, and the boxes from the leaves upward. (Morton, 1966; Kamel, Faloutsos, On packing R-trees, 1993)
"""

from __future__ import annotations

from itertools import count
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, inlined, kernel
from collision_monitor.geometry.vector import minus
from collision_monitor.meshes.layout import (
    AXES,
    BOXES,
    CENTER,
    CHILD,
    CORNERS,
    COUNT,
    FACE,
    HALF,
    KEY,
    MOST_PARTS,
    PARTS,
    REACH,
    ROWS,
    WIDTH,
)
from collision_monitor.meshes.supports import REACHES, extend, extend_by_box, write_supports
from collision_monitor.meshes.trees.box_fit import CONTAINED

Array = NDArray[np.float64]

DIGITS: Final = 10
"""Bits of a cell's number along each axis. Fewer: points of one cell, in any order, make wider boxes."""

BUCKETS: Final = 1 << DIGITS

_NUMBERS = count(1)


def cloud_tree(points: Array) -> Array:
    """Build the tree (n, ROWS, WIDTH) over points (m, 3) in m, m >= 1. A point is a triangle with equal corners."""
    points = np.ascontiguousarray(points, dtype=np.float64)
    sizes = _levels(len(points))
    blocks = np.zeros((_blocks_above(sizes) + sizes[-1], ROWS, WIDTH))
    order = np.empty(len(points), np.int32)
    _sort_along_curve(points, order)
    far = _fill(points, order, np.array(sizes), blocks, np.empty(REACHES))
    blocks[0, REACH, 1] = np.nextafter(np.sqrt(far) * (1.0 + CONTAINED), np.inf)
    blocks[0, COUNT, 1] = len(points)
    blocks[0, PARTS, 1] = max(len(points), MOST_PARTS + 1)  # more than are stored, so that each point is examined
    # hardly any cloud occurs twice: its key is a number, because a digest would take longer than the tree
    blocks[0, KEY : KEY + 2, 1] = -1.0, next(_NUMBERS)
    return blocks


def tree_points(blocks: Array, root: int) -> Array:
    """The points (n, 3) of the cloud with a tree that begins at a block, in the user's order."""
    number = int(blocks[root, COUNT, 1])
    sizes = _levels(number)
    first = root + _blocks_above(sizes)
    leaves = blocks[first : first + sizes[-1]]
    points = np.empty((number, 3))
    number_of = leaves[:, FACE].ravel().astype(np.int64)
    points[number_of] = leaves[:, CORNERS : CORNERS + 3].transpose(0, 2, 1).reshape(-1, 3)
    return points


def _levels(points: int) -> list[int]:
    """Numbers of blocks of the levels, the leaves last."""
    sizes = [-(-points // WIDTH)]
    while sizes[0] > 1:
        sizes.insert(0, -(-sizes[0] // WIDTH))
    return sizes


def _blocks_above(sizes: list[int]) -> int:
    """Number of blocks above the leaves, for these numbers of blocks of the levels."""
    return BOXES * (1 + sum(sizes[:-1]))


@inlined
def _spread(x: Any) -> Any:
    """The bits of a number below 2^10 with two zeros behind each."""
    x = (x | (x << 16)) & 0x030000FF
    x = (x | (x << 8)) & 0x0300F00F
    x = (x | (x << 4)) & 0x030C30C3
    return (x | (x << 2)) & 0x09249249


@allocating_kernel
def _sort_along_curve(points: Any, order: Any) -> None:
    """Write the order of the points along the Z curve through the cells of a cube around them."""
    n = len(points)
    low, high = points[0].copy(), points[0].copy()
    for k in range(n):
        for c in range(3):
            low[c], high[c] = min(low[c], points[k, c]), max(high[c], points[k, c])
    longest = max(high[0] - low[0], max(high[1] - low[1], high[2] - low[2]))
    scale = (BUCKETS - 1) / longest if longest > 0.0 else 0.0
    if not scale < np.inf:
        scale = 0.0  # all points are one as far as a cell can tell
    keys, other = np.empty(n, np.int64), np.empty(n, np.int64)
    for k in range(n):
        x = np.int64((points[k, 0] - low[0]) * scale)
        y = np.int64((points[k, 1] - low[1]) * scale)
        z = np.int64((points[k, 2] - low[2]) * scale)
        keys[k] = (_spread(x) | (_spread(y) << 1) | (_spread(z) << 2)) << 32 | k
    begin = np.empty(BUCKETS, np.int64)
    for digit in range(3):
        shift = 32 + DIGITS * digit
        begin[:] = 0
        for k in range(n):
            begin[(keys[k] >> shift) & (BUCKETS - 1)] += 1
        at = 0
        for bucket in range(BUCKETS):
            begin[bucket], at = at, at + begin[bucket]
        for k in range(n):
            bucket = (keys[k] >> shift) & (BUCKETS - 1)
            other[begin[bucket]] = keys[k]
            begin[bucket] += 1
        keys, other = other, keys
    for k in range(n):
        order[k] = keys[k] & 0xFFFFFFFF


@device
def _write_box(blocks: Any, block: int, member: int, low: Any, high: Any, child: int) -> float:
    """Write the box from low to high (m), enlarged against round-off by the returned length (m)."""
    scale = 0.0
    for c in range(3):
        scale += max(abs(low[c]), abs(high[c]))
    for c in range(3):
        half = 0.5 * (high[c] - low[c])
        blocks[block, AXES + 4 * c, member] = 1.0
        blocks[block, CENTER + c, member] = low[c] + half
        blocks[block, HALF + c, member] = half + CONTAINED * scale
    blocks[block, CHILD, member] = child
    return CONTAINED * scale


@kernel
def _fill(points: Any, order: Any, sizes: Any, blocks: Any, reach: Any) -> float:
    """Write the blocks level by level, from the leaves upward; return the largest squared distance from the origin.

    The boxes of a level lie in the blocks of the level above; the topmost box in block 0. reach (REACHES,): scratch
    memory.
    """
    n, levels = len(points), len(sizes)
    first = BOXES
    for level in range(levels - 1):
        first += BOXES * sizes[level]
    far = 0.0
    for leaf in range(sizes[levels - 1]):
        block = first + leaf
        for lane in range(WIDTH):
            k = order[min(WIDTH * leaf + lane, n - 1)]
            x, y, z = points[k, 0], points[k, 1], points[k, 2]
            far = max(far, x * x + y * y + z * z)
            for i in range(3):
                blocks[block, CORNERS + 3 * i, lane] = x
                blocks[block, CORNERS + 3 * i + 1, lane] = y
                blocks[block, CORNERS + 3 * i + 2, lane] = z
            blocks[block, FACE, lane] = k
    above = first
    for level in range(levels - 1, -1, -1):
        first, above = above, above - BOXES * sizes[level - 1] if level > 0 else 0
        for k in range(sizes[level]):
            block = first + (k if level == levels - 1 else BOXES * k)
            lx = ly = lz = np.inf
            hx = hy = hz = -np.inf
            for lane in range(WIDTH):
                at = CORNERS if level == levels - 1 else CENTER
                x, y, z = blocks[block, at, lane], blocks[block, at + 1, lane], blocks[block, at + 2, lane]
                a, b, c = 0.0, 0.0, 0.0
                if level < levels - 1:
                    if blocks[block, CHILD, lane] == 0.0:
                        break
                    a, b, c = blocks[block, HALF, lane], blocks[block, HALF + 1, lane], blocks[block, HALF + 2, lane]
                lx, ly, lz = min(lx, x - a), min(ly, y - b), min(lz, z - c)
                hx, hy, hz = max(hx, x + a), max(hy, y + b), max(hz, z + c)
            child = -block if level == levels - 1 else block
            box, member = above + BOXES * (k // WIDTH), k % WIDTH
            slack = _write_box(blocks, box, member, (lx, ly, lz), (hx, hy, hz), child)
            own = blocks[box, CENTER, member], blocks[box, CENTER + 1, member], blocks[box, CENTER + 2, member]
            reach[:] = -np.inf
            for lane in range(WIDTH):
                at = CORNERS if level == levels - 1 else CENTER
                arm = blocks[block, at, lane], blocks[block, at + 1, lane], blocks[block, at + 2, lane]
                if level == levels - 1:
                    extend(minus(arm, own), 0.0, reach)
                elif blocks[block, CHILD, lane] != 0.0:
                    extend_by_box(minus(arm, own), blocks, block, lane, reach)
            write_supports(reach, slack, blocks, box, member)
    return far

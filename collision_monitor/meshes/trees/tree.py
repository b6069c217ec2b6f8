"""Tree of oriented boxes over triangles, eight boxes or triangles in a block.

Triangles are halved along x, y or z, where the boxes around both halves are smallest; eight such parts make a block.
Parts are cut so that they fill their blocks.
(Gottschalk, Lin, Manocha, OBBTree, 1996; Wald, Benthin, Boulos, Getting rid of packets, 2008: wide trees)
"""

from __future__ import annotations

import os
from concurrent.futures import ThreadPoolExecutor
from hashlib import blake2b
from math import sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, inlined, kernel
from collision_monitor.meshes.layout import (
    BOXES,
    CHILD,
    CLOSED,
    CORNERS,
    FACE,
    FIRST_PART,
    KEY,
    MOST_PARTS,
    PARTS,
    RADIUS,
    REACH,
    ROWS,
    WIDTH,
)
from collision_monitor.meshes.supports import REACHES
from collision_monitor.meshes.trees.box_fit import CONTAINED, fit_box

Array = NDArray[np.float64]

STACK: Final = 512
"""Parts that wait while the tree is built: eight for each of its levels, and a level has 1/8 of the triangles."""

PART: Final = 5
"""Numbers of a part that waits, see `_grow`."""

SAMPLE: Final = 2000
"""Most triangles of a part by which its axis is chosen. More: the tree takes longer. Fewer: its boxes are larger."""

PARALLEL: Final = 50_000
"""Fewest triangles, 30 ms, for which threads are worth their start."""


def tree_of(
    corners: Array, radius: float | Array = 0.0, closed: bool = False, parts: Array | None = None, split: int = 0
) -> Array:
    """Build the tree (n, ROWS, WIDTH) over triangles (m, 3, 3) in m, m >= 1, in any order and place.

    radius: by which the triangles are enlarged (m), one number or (m,). A cloud of points is triangles with equal
    corners. closed: the triangles bound a solid. parts (k, 3): a point of each connected part; None: there is one part.
    split: the first so many triangles, and the others, have a box of their own each below the root.
    """
    corners = np.ascontiguousarray(corners, dtype=np.float64)
    n = len(corners)
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), n).copy()
    inner = corners[:1, 0] if parts is None else parts
    behind = BOXES + (BOXES + _blocks_of(split) + _blocks_of(n - split) if split else _blocks_of(n))
    tree = np.empty((behind + -(-min(len(inner), MOST_PARTS) // WIDTH), ROWS, WIDTH))
    tree[:BOXES] = tree[behind:] = 0.0
    middle = np.empty((n, 3))
    far = _measure(corners, radii, middle)
    _grow_all((corners, radii, middle, np.arange(n), tree), split)
    for k, point in enumerate(inner[:MOST_PARTS]):
        tree[behind + k // WIDTH, :3, k % WIDTH] = point
    tree[0, CLOSED, 1], tree[0, REACH, 1] = closed, np.nextafter(far * (1.0 + CONTAINED), np.inf)
    tree[0, PARTS, 1], tree[0, FIRST_PART, 1] = len(inner), behind
    digest = blake2b(digest_size=16)
    for source in (corners, radii, tree[0, : FIRST_PART + 1, 1], tree[behind:]):  # what the tree is made of: half of it
        digest.update(np.ascontiguousarray(source).data)
    tree[0, KEY : KEY + 2, 1] = np.frombuffer(digest.digest())
    return tree


def _grow_all(arrays: tuple[Array, Array, Array, NDArray[np.int64], Array], split: int) -> None:
    """Write all blocks. The parts of a large tree grow on threads; each writes its own blocks, known in advance."""
    stack = np.zeros((STACK, PART), np.int64)
    n, order = len(arrays[0]), arrays[3]
    stack[0] = 0, n, 0, 0, BOXES
    if split:
        _grow(*arrays, stack, 1, 1)  # the root, and parts in another order
        order[:] = range(n)
        first = 2 * BOXES
        stack[:2] = (0, split, BOXES, 0, first), (split, n, BOXES, 1, first + _blocks_of(split))
        _grow(*arrays, stack, 2, n)
        return
    if n < PARALLEL:
        _grow(*arrays, stack, 1, n)
        return
    stacks = [np.concatenate([part[None], stack]) for part in stack[: _grow(*arrays, stack, 1, 1)]]
    with ThreadPoolExecutor(min(len(stacks), os.cpu_count() or 1)) as pool:
        list(pool.map(lambda own: _grow(*arrays, own, 1, n), stacks))


def _blocks_of(triangles: int) -> int:
    """Number of blocks of a part with so many triangles: all children are full but the last."""
    count = 0
    while triangles > WIDTH:
        unit, full = WIDTH, 1
        while triangles > WIDTH * unit:
            unit, full = WIDTH * unit, WIDTH * full + BOXES
        count += BOXES + triangles // unit * full
        triangles %= unit
    return count + 1 if triangles > 0 else count


_number_of_blocks: Final = inlined(_blocks_of)


@kernel
def _measure(corners: Any, radius: Any, middle: Any) -> float:
    """Write the centres of the triangles; return the largest distance of a point from the origin (m)."""
    far = 0.0
    for k in range(len(corners)):
        most = 0.0
        for i in range(3):
            x, y, z = corners[k, i, 0], corners[k, i, 1], corners[k, i, 2]
            most = max(most, x * x + y * y + z * z)
        far = max(far, sqrt(most) + radius[k])
        for c in range(3):
            middle[k, c] = (corners[k, 0, c] + corners[k, 1, c] + corners[k, 2, c]) / 3.0
    return far


@allocating_kernel
def _grow(corners: Any, radius: Any, middle: Any, order: Any, blocks: Any, stack: Any, waiting: int, steps: int) -> int:
    """Write the parts that wait on a stack, and those below, `steps` at most; return how many wait.

    A part: begin and end in the order, block and member for its box, and its first block.
    """
    axes, half, center = np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3))
    some, reach = np.empty(SAMPLE, np.int64), np.empty(REACHES)
    while waiting > 0 and steps > 0:
        waiting -= 1
        steps -= 1
        begin, end, parent, member, block = stack[waiting]
        fit_box(corners, radius, order, begin, end, axes, half, center, reach, blocks, parent, member)
        if end - begin <= WIDTH:
            blocks[parent, CHILD, member] = -block
            _write_leaf(corners, radius, order, begin, end, blocks, block)
        else:
            blocks[parent, CHILD, member] = block
            blocks[block : block + BOXES] = 0.0
            waiting = _push_parts(corners, middle, order, begin, end, block, stack, waiting, some)
    return waiting


@device
def _write_leaf(corners: Any, radius: Any, order: Any, begin: int, end: int, blocks: Any, block: int) -> None:
    """Write a block of triangles."""
    blocks[block] = 0.0
    for lane in range(WIDTH):
        k = order[min(begin + lane, end - 1)]
        for i in range(3):
            for c in range(3):
                blocks[block, CORNERS + 3 * i + c, lane] = corners[k, i, c]
        blocks[block, FACE, lane] = k
        blocks[block, RADIUS, lane] = radius[k]


@device
def _push_parts(
    corners: Any, middle: Any, order: Any, begin: int, end: int, block: int, stack: Any, first: int, some: Any
) -> int:
    """Divide the triangles of a block into its parts; push them from `first` on, return the stack's new length."""
    unit = WIDTH
    while end - begin > WIDTH * unit:
        unit *= WIDTH
    last = first + 1
    stack[first, 0], stack[first, 1] = begin, end
    while last < first + WIDTH:
        widest = first
        for k in range(first + 1, last):
            if stack[k, 1] - stack[k, 0] > stack[widest, 1] - stack[widest, 0]:
                widest = k
        if stack[widest, 1] - stack[widest, 0] <= unit:
            break
        cut = _halve(corners, middle, order, stack[widest, 0], stack[widest, 1], unit, some)
        stack[last, 0], stack[last, 1] = cut, stack[widest, 1]
        stack[widest, 1] = cut
        last += 1
    own = block + BOXES
    for k in range(first, last):
        stack[k, 2], stack[k, 3], stack[k, 4] = block, k - first, own
        own += _number_of_blocks(stack[k, 1] - stack[k, 0])
    return last


@device
def _halve(corners: Any, middle: Any, order: Any, begin: int, end: int, unit: int, some: Any) -> int:
    """Sort the order so that the first half lies below the second along `_best_axis`; return where that begins.

    The first half fills whole parts of `unit` triangles.
    """
    cut = begin + unit * ((end - begin + unit - 1) // unit // 2)
    step = 1 + (end - begin) // SAMPLE
    count = 0
    for k in range(begin, end, step):
        some[count] = order[k]
        count += 1
    _sort_about(middle, order, begin, end, cut, _best_axis(corners, middle, some, count, (cut - begin) // step))
    return cut


@device
def _best_axis(corners: Any, middle: Any, some: Any, count: int, cut: int) -> int:
    """The axis along which the boxes around both halves have the least surface, weighted by their triangles.

    (Goldsmith, Salmon, Automatic creation of object hierarchies for ray tracing, 1987: the surface area heuristic)
    """
    best, least = 0, np.inf
    for axis in range(3):
        _sort_about(middle, some, 0, count, cut, axis)
        cost = cut * _surface(corners, some, 0, cut) + (count - cut) * _surface(corners, some, cut, count)
        if cost < least:
            best, least = axis, cost
    return best


@device
def _surface(corners: Any, order: Any, begin: int, end: int) -> float:
    """An eighth of the surface of the axis-aligned box around triangles (m^2)."""
    x, y, z = corners[order[begin], 0, 0], corners[order[begin], 0, 1], corners[order[begin], 0, 2]
    low_x, low_y, low_z, high_x, high_y, high_z = x, y, z, x, y, z
    for k in range(begin, end):
        for i in range(3):
            x, y, z = corners[order[k], i, 0], corners[order[k], i, 1], corners[order[k], i, 2]
            low_x, low_y, low_z = min(low_x, x), min(low_y, y), min(low_z, z)
            high_x, high_y, high_z = max(high_x, x), max(high_y, y), max(high_z, z)
    x, y, z = 0.5 * high_x - 0.5 * low_x, 0.5 * high_y - 0.5 * low_y, 0.5 * high_z - 0.5 * low_z
    return x * y + y * z + z * x


@device
def _sort_about(middle: Any, order: Any, begin: int, end: int, cut: int, axis: int) -> None:
    """Sort the order so that the part before the cut lies below the rest. (Quickselect: Hoare, 1961)"""
    first, last = begin, end - 1
    while first < last:
        a, b, c = middle[order[first], axis], middle[order[(first + last) // 2], axis], middle[order[last], axis]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = first, last
        while i <= j:
            while middle[order[i], axis] < pivot:
                i += 1
            while middle[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if cut <= j:
            last = j
        elif cut >= i:
            first = i
        else:
            break

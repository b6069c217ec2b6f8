"""Tree of oriented boxes over triangles, eight boxes or triangles in a block.

Triangles are halved along the longest side of their centres' bounds; eight such parts make a block. Parts are cut so
that they fill their blocks.
(Gottschalk, Lin, Manocha, OBBTree, 1996; Wald, Benthin, Boulos, Getting rid of packets, 2008: wide trees)
"""

from __future__ import annotations

from hashlib import blake2b
from math import copysign, sqrt
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device
from collision_monitor.meshes.layout import (
    AXES,
    CENTER,
    CHILD,
    CLOSED,
    CORNERS,
    FACE,
    FIRST_PART,
    HALF,
    KEY,
    MOST_PARTS,
    PARTS,
    RADIUS,
    REACH,
    ROWS,
    WIDTH,
)
from collision_monitor.tolerances import EPSILON

Array = NDArray[np.float64]

JACOBI_SWEEPS: Final = 6
"""Sweeps for the principal axes. Any rotation is a valid box; fewer sweeps only make it wider."""

STACK: Final = 512
"""Parts that wait while the tree is built: eight for each of its levels, and a level has 1/8 of the triangles."""

CONTAINED: Final = 64 * EPSILON
"""Part of a box's coordinates by which it is enlarged against the round-off of its fit and of later rotations."""


def tree_of(
    corners: Array, radius: float | Array = 0.0, closed: bool = False, parts: Array | None = None
) -> Array:
    """Build the tree (n, ROWS, WIDTH) over triangles (m, 3, 3) in m, m >= 1, in any order and place.

    radius: by which the triangles are enlarged (m), one number or (m,). A cloud of points is triangles with equal
    corners. closed: the triangles bound a solid. parts (k, 3): a point of each connected part; None: there is one part.
    """
    corners = np.ascontiguousarray(corners, dtype=np.float64)
    radii = np.broadcast_to(np.asarray(radius, dtype=np.float64), len(corners)).copy()
    inner = corners[:1, 0] if parts is None else parts
    blocks = np.empty((most_blocks(len(corners)), ROWS, WIDTH))
    blocks[0] = 0.0
    used = _build(corners, radii, blocks)
    stored = np.zeros((-(-min(len(inner), MOST_PARTS) // WIDTH), ROWS, WIDTH))
    for k, point in enumerate(inner[:MOST_PARTS]):
        stored[k // WIDTH, :3, k % WIDTH] = point
    far = np.sqrt(np.einsum("nij,nij->ni", corners, corners).max(axis=1)) + radii
    blocks[0, CLOSED, 1], blocks[0, REACH, 1] = closed, np.nextafter(far.max() * (1.0 + CONTAINED), np.inf)
    blocks[0, PARTS, 1], blocks[0, FIRST_PART, 1] = len(inner), used
    tree = np.concatenate([blocks[:used], stored])
    tree[0, KEY : KEY + 2, 1] = np.frombuffer(blake2b(tree.data, digest_size=16).digest())
    return tree


def most_blocks(triangles: int) -> int:
    """Largest number of blocks of a tree over so many triangles: each block of boxes has at least two."""
    return 2 * -(-triangles // WIDTH) + 1


@allocating_kernel
def _build(corners, radius, blocks):
    """Write the blocks of the tree; return their number."""
    n = len(corners)
    order = np.arange(n)
    middle = np.empty((n, 3))
    for k in range(n):
        for c in range(3):
            middle[k, c] = (corners[k, 0, c] + corners[k, 1, c] + corners[k, 2, c]) / 3.0
    stack = np.empty((STACK, 4), np.int64)  # begin and end in the order, parent's block and member
    begins, ends = np.empty(WIDTH, np.int64), np.empty(WIDTH, np.int64)
    axes, half, center = np.empty((2, 3, 3)), np.empty((2, 3)), np.empty((2, 3))
    _fit(corners, radius, order, 0, n, axes, half, center, blocks, 0, 0)
    stack[0] = 0, n, 0, 0
    waiting, used = 1, 1
    while waiting > 0:
        waiting -= 1
        begin, end, parent, member = stack[waiting]
        block = used
        used += 1
        blocks[block] = 0.0
        if end - begin <= WIDTH:
            blocks[parent, CHILD, member] = -block
            for lane in range(WIDTH):
                k = order[min(begin + lane, end - 1)]
                for i in range(3):
                    for c in range(3):
                        blocks[block, CORNERS + 3 * i + c, lane] = corners[k, i, c]
                blocks[block, FACE, lane] = k
                blocks[block, RADIUS, lane] = radius[k]
            continue
        blocks[parent, CHILD, member] = block
        unit = WIDTH
        while end - begin > WIDTH * unit:
            unit *= WIDTH
        count = 1
        begins[0], ends[0] = begin, end
        while count < WIDTH:
            widest = 0
            for part in range(1, count):
                if ends[part] - begins[part] > ends[widest] - begins[widest]:
                    widest = part
            if ends[widest] - begins[widest] <= unit:
                break
            cut = _halve(middle, order, begins[widest], ends[widest], unit)
            begins[count], ends[count] = cut, ends[widest]
            ends[widest] = cut
            count += 1
        for part in range(count):
            _fit(corners, radius, order, begins[part], ends[part], axes, half, center, blocks, block, part)
            stack[waiting] = begins[part], ends[part], block, part
            waiting += 1
    return used


@device
def _halve(middle, order, begin, end, unit):
    """Sort the order so that its first half lies below the second along the longest side; return where that begins.

    The first half fills whole blocks.
    """
    axis, longest = 0, -1.0
    for c in range(3):
        low = high = middle[order[begin], c]
        for k in range(begin + 1, end):
            x = middle[order[k], c]
            low, high = min(low, x), max(high, x)
        if high - low > longest:
            axis, longest = c, high - low
    cut = begin + unit * ((end - begin + unit - 1) // unit // 2)
    first, last = begin, end - 1
    while first < last:  # quickselect (Hoare, 1961), with the middle one of three as pivot
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
    return cut


@device
def _fit(corners, radius, order, begin, end, axes, half, center, blocks, block, member):
    """Write the box around some triangles: the smaller of that along the principal axes and that along x, y, z."""
    mx = my = mz = 0.0
    origin = corners[order[begin], 0]
    ox, oy, oz = origin[0], origin[1], origin[2]
    xx = xy = xz = yy = yz = zz = 0.0
    for k in range(begin, end):
        for i in range(3):
            x, y, z = corners[order[k], i, 0] - ox, corners[order[k], i, 1] - oy, corners[order[k], i, 2] - oz
            mx, my, mz = mx + x, my + y, mz + z
            xx, xy, xz = xx + x * x, xy + x * y, xz + x * z
            yy, yz, zz = yy + y * y, yz + y * z, zz + z * z
    n = 3.0 * (end - begin)
    mx, my, mz = mx / n, my / n, mz / n
    _principal_axes(
        xx / n - mx * mx, xy / n - mx * my, xz / n - mx * mz, yy / n - my * my, yz / n - my * mz, zz / n - mz * mz,
        axes[0],
    )  # fmt: skip
    for r in range(3):
        for c in range(3):
            axes[1, r, c] = 1.0 if r == c else 0.0
    best, least = 0, np.inf
    for choice in range(2):
        R = axes[choice]
        for c in range(3):
            low, high = np.inf, -np.inf
            for k in range(begin, end):
                for i in range(3):
                    at = (
                        R[0, c] * (corners[order[k], i, 0] - ox)
                        + R[1, c] * (corners[order[k], i, 1] - oy)
                        + R[2, c] * (corners[order[k], i, 2] - oz)
                    )
                    low, high = min(low, at - radius[order[k]]), max(high, at + radius[order[k]])
            center[choice, c], half[choice, c] = low + 0.5 * (high - low), 0.5 * (high - low)
        x, y, z = half[choice, 0], half[choice, 1], half[choice, 2]
        surface = x * y + y * z + z * x
        if surface < least:
            best, least = choice, surface
    R = axes[best]
    scale = abs(ox) + abs(oy) + abs(oz) + half[best, 0] + half[best, 1] + half[best, 2]
    for r in range(3):
        for c in range(3):
            blocks[block, AXES + 3 * r + c, member] = R[r, c]
        along = R[r, 0] * center[best, 0] + R[r, 1] * center[best, 1] + R[r, 2] * center[best, 2]
        blocks[block, CENTER + r, member] = origin[r] + along
        blocks[block, HALF + r, member] = half[best, r] + CONTAINED * scale


@device
def _principal_axes(xx, xy, xz, yy, yz, zz, R):
    """Write the eigenvectors of a symmetric matrix into the columns of R (3, 3), by Jacobi rotations."""
    for r in range(3):
        for c in range(3):
            R[r, c] = 1.0 if r == c else 0.0
    for _ in range(JACOBI_SWEEPS):
        for pair in range(3):
            off = xy if pair == 0 else (xz if pair == 1 else yz)
            if off == 0.0:
                continue
            p, q = (0, 1) if pair == 0 else ((0, 2) if pair == 1 else (1, 2))
            first = xx if p == 0 else yy
            second = yy if q == 1 else zz
            theta = 0.5 * (second - first) / off
            t = copysign(1.0, theta) / (abs(theta) + sqrt(theta * theta + 1.0))
            cosine = 1.0 / sqrt(t * t + 1.0)
            sine = t * cosine
            if pair == 0:
                xx, yy, xy, xz, yz = xx - t * xy, yy + t * xy, 0.0, cosine * xz - sine * yz, sine * xz + cosine * yz
            elif pair == 1:
                xx, zz, xz, xy, yz = xx - t * xz, zz + t * xz, 0.0, cosine * xy - sine * yz, sine * xy + cosine * yz
            else:
                yy, zz, yz, xy, xz = yy - t * yz, zz + t * yz, 0.0, cosine * xy - sine * xz, sine * xy + cosine * xz
            for r in range(3):
                a, b = R[r, p], R[r, q]
                R[r, p], R[r, q] = cosine * a - sine * b, sine * a + cosine * b

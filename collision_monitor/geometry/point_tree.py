"""Tree over points that tells which linear functions exceed a limit at one of them.

A node has a plane through its points' middle, the range of their heights over it, and the largest distance of a point
from the plane's normal there. Points of a smooth surface are nearly in one plane, so a function that has its greatest
value elsewhere leaves a node out although that value is nearly reached.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, kernel
from collision_monitor.tolerances import EPSILON

Array = NDArray[np.float64]

LEAF: Final = 8
"""Most points of a leaf. More: more points are examined. Fewer: more nodes."""

CENTER, NORMAL, LOW, HIGH, BESIDE, SIZE = 0, 3, 6, 7, 8, 9
COLUMNS: Final = 10
"""Numbers of a node: centre and unit normal, range of the heights of its points, their largest distance from the axis,
and the largest distance of a point from the origin."""

WAITING: Final = 64
"""Nodes that wait in a search: one for each level."""

SCATTER: Final = 2654435761
"""Multiple of a place that is scattered over 32 bits (Knuth, The Art of Computer Programming 3, section 6.4)."""

BOUND_ROUND_OFF: Final = 8 * EPSILON
"""Round-off of a bound, as part of the product of the lengths. Larger: more points of a flat face are examined."""


class PointTree:
    """Tree over points (n, 3), n >= 1. directions (n, 3): about normal to the surface at each point, of any length."""

    def __init__(self, points: Array, directions: Array) -> None:
        self._levels = max(int(np.ceil(np.log2(len(points) / LEAF))), 0)
        self._order = np.arange(len(points))
        self._nodes = np.zeros((2 << self._levels, COLUMNS))
        points, directions = (np.ascontiguousarray(each, np.float64) for each in (points, directions))
        _build(points, directions, self._order, self._nodes, self._levels)

    def exceeds(self, d: Array, cut: Array, rows: Array, limit: Array, stop: bool = False) -> NDArray[np.bool_]:
        """Whether some row (a, b, c, e) of the points' rows (n, 4) has (a, b, c) . d + e > limit, for each d (m, 3).

        cut (m,): only points x with x . d > cut may have such a row; with x = (a, b, c) and e = 0, the limit. stop:
        leave the others False after the first that does.
        """
        found = np.zeros(len(d), bool)
        d, cut, rows, limit = (np.ascontiguousarray(each, np.float64) for each in (d, cut, rows[self._order], limit))
        _search(self._nodes, self._levels, d, cut, rows, limit, found, stop)
        return found


@kernel
def _build(points: Any, directions: Any, order: Any, nodes: Any, levels: Any) -> None:
    """Write the nodes, those below node k at 2 k and 2 k + 1, and sort the order so that each has a part of it."""
    n = len(points)
    for level in range(levels + 1):
        for k in range(1 << level):
            begin, end = (n * k) >> level, (n * (k + 1)) >> level
            axis = _write_node(points, directions, order, begin, end, nodes, (1 << level) + k)
            if level < levels:
                _sort_about(points, order, begin, end, (n * (2 * k + 1)) >> (level + 1), axis)


@device
def _write_node(points: Any, directions: Any, order: Any, begin: int, end: int, nodes: Any, node: int) -> int:
    """Write a node over points of the order; return the axis along which they extend farthest."""
    axis, widest, length = 0, -1.0, 0.0
    for c in range(3):
        low = high = points[order[begin], c]
        total = 0.0
        for i in range(begin, end):
            x = points[order[i], c]
            low, high = min(low, x), max(high, x)
            total += directions[order[i], c]
        nodes[node, CENTER + c], nodes[node, NORMAL + c] = 0.5 * low + 0.5 * high, total
        length += total * total
        if high - low > widest:
            axis, widest = c, high - low
    length = sqrt(length)
    for c in range(3):
        nodes[node, NORMAL + c] = nodes[node, NORMAL + c] / length if length > 0.0 else (1.0 if c == axis else 0.0)
    nx, ny, nz = nodes[node, NORMAL], nodes[node, NORMAL + 1], nodes[node, NORMAL + 2]
    bottom, top, beside, size = np.inf, -np.inf, 0.0, 0.0
    for i in range(begin, end):
        k = order[i]
        size = max(size, points[k, 0] ** 2 + points[k, 1] ** 2 + points[k, 2] ** 2)
        x, y, z = (
            points[k, 0] - nodes[node, CENTER],
            points[k, 1] - nodes[node, CENTER + 1],
            points[k, 2] - nodes[node, CENTER + 2],
        )
        h = x * nx + y * ny + z * nz
        bottom, top = min(bottom, h), max(top, h)
        x, y, z = x - h * nx, y - h * ny, z - h * nz
        beside = max(beside, x * x + y * y + z * z)
    nodes[node, LOW], nodes[node, HIGH], nodes[node, BESIDE], nodes[node, SIZE] = bottom, top, sqrt(beside), sqrt(size)
    return axis


@device
def _sort_about(points: Any, order: Any, begin: int, end: int, middle: int, axis: int) -> None:
    """Sort the order so that the part before the middle lies below the rest. (Quickselect: Hoare, 1961)

    The pivots are at scattered places, because there are orders that make fixed places take quadratic time.
    """
    first, last = begin, end - 1
    while first < last:
        scattered, size = (first * SCATTER + last) & 0x7FFFFFFF, last - first + 1
        a, b = points[order[first + scattered % size], axis], points[order[(first + last) // 2], axis]
        c = points[order[first + (scattered >> 8) % size], axis]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = first, last
        while i <= j:
            while points[order[i], axis] < pivot:
                i += 1
            while points[order[j], axis] > pivot:
                j -= 1
            if i <= j:
                order[i], order[j] = order[j], order[i]
                i += 1
                j -= 1
        if middle <= j:
            last = j
        elif middle >= i:
            first = i
        else:
            break


@device
def _bound(nodes: Any, node: int, x: float, y: float, z: float, length: float) -> float:
    """Upper bound on p . (x, y, z) for the points p of a node."""
    nx, ny, nz = nodes[node, NORMAL], nodes[node, NORMAL + 1], nodes[node, NORMAL + 2]
    t = x * nx + y * ny + z * nz
    u, v, w = x - t * nx, y - t * ny, z - t * nz  # not from 1 - t * t, which is round-off where the two are parallel
    middle = x * nodes[node, CENTER] + y * nodes[node, CENTER + 1] + z * nodes[node, CENTER + 2]
    height = max(t * nodes[node, LOW], t * nodes[node, HIGH])
    aside = nodes[node, BESIDE] * sqrt(u * u + v * v + w * w)
    return middle + height + aside + BOUND_ROUND_OFF * length * nodes[node, SIZE]


@allocating_kernel
def _search(nodes: Any, levels: Any, d: Any, cut: Any, rows: Any, limit: Any, found: Any, stop: Any) -> None:
    """Write what `PointTree.exceeds` returns. rows: in the order of the tree."""
    n = len(rows)
    waiting = np.empty(WAITING, np.int64)
    for q in range(len(d)):
        x, y, z = d[q, 0], d[q, 1], d[q, 2]
        length = sqrt(x * x + y * y + z * z)
        waiting[0], count = 1, 1
        while count > 0 and not found[q]:  # terminates: each node is opened once
            count -= 1
            node = waiting[count]
            if node >> levels == 0:
                a, b = 2 * node, 2 * node + 1
                first, second = _bound(nodes, a, x, y, z, length), _bound(nodes, b, x, y, z, length)
                if first > second:  # that with the greater bound is opened first
                    a, b, first, second = b, a, second, first
                if first > cut[q]:
                    waiting[count] = a
                    count += 1
                if second > cut[q]:
                    waiting[count] = b
                    count += 1
                continue
            k = node - (1 << levels)
            for i in range((n * k) >> levels, (n * (k + 1)) >> levels):
                if rows[i, 0] * x + rows[i, 1] * y + rows[i, 2] * z + rows[i, 3] > limit[q]:
                    found[q] = True
                    break
        if stop and found[q]:
            return

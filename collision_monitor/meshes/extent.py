"""How far trees reach in given directions: the support values of their convex hulls, without the hulls."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.meshes.boxes import half_of
from collision_monitor.meshes.distance.nearest import MEMORY, triangle_at
from collision_monitor.meshes.layout import CENTER, CHILD, RADIUS, WIDTH
from collision_monitor.meshes.placing import turned_back

Array = NDArray[np.float64]


@device
def farthest(blocks: Any, root: int, d: Vector, work: Any) -> float:
    """Largest d . x (m) over the points x of a tree, for a unit vector d in its frame."""
    best = -inf
    length = sqrt(dot(d, d))
    work[0], work[1] = inf, WIDTH * root
    waiting = 1
    while waiting > 0:  # terminates: each box is opened once
        waiting -= 1
        if work[2 * waiting] <= best:
            continue
        place = int(work[2 * waiting + 1])
        child = blocks[place // WIDTH, CHILD, place % WIDTH]
        block = root + int(abs(child))
        first = waiting
        for k in range(WIDTH):
            if child < 0.0:
                T = triangle_at(blocks, block, k)
                best = max(best, max(dot(T.a, d), max(dot(T.b, d), dot(T.c, d))) + blocks[block, RADIUS, k] * length)
            elif blocks[block, CHILD, k] != 0.0:
                e, n = half_of(blocks, block, k), turned_back(blocks, block, k, d)
                c = blocks[block, CENTER, k], blocks[block, CENTER + 1, k], blocks[block, CENTER + 2, k]
                bound = dot(c, d) + abs(n[0]) * e[0] + abs(n[1]) * e[1] + abs(n[2]) * e[2]
                at = waiting
                while at > first and work[2 * (at - 1)] > bound:
                    work[2 * at], work[2 * at + 1] = work[2 * (at - 1)], work[2 * (at - 1) + 1]
                    at -= 1
                work[2 * at], work[2 * at + 1] = bound, WIDTH * block + k
                waiting += 1
    return best


@kernel
def _extents(tree: Any, directions: Any, out: Any, work: Any) -> None:
    for k in range(len(directions)):
        out[k] = farthest(tree, 0, (directions[k, 0], directions[k, 1], directions[k, 2]), work)


def tree_extents(tree: Array, directions: Array) -> Array:
    """Largest d . x (k,) in m over the points x of a tree, for directions d (k, 3) in its frame."""
    out = np.empty(len(directions))
    _extents(tree, np.ascontiguousarray(directions), out, np.empty(MEMORY))
    return out

"""The longest edge of a mesh, which bounds how deep its triangles can be in those of another one.

Two triangles that meet are parted by a translation along the normal of one of them, which has no width along it. It is
at most half of the width of the other one, and thus at most half of its longest edge.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Final

from collision_monitor._jit import device
from collision_monitor.meshes.layout import CHILD, RADIUS, WIDTH
from collision_monitor.meshes.nearest import triangle_at
from collision_monitor.narrow_phase.vector import cross, dot, minus
from collision_monitor.tolerances import PARALLEL_SIN2

MOST_BLOCKS: Final = 1024
"""Blocks to walk, 20 us. The edges of a mesh with more, 6,000 triangles at least, stay unknown."""


@device
def longest_edge(blocks, root, stack):
    """Length (m) of the longest edge of a tree; infinite if it has a radius, slivers, or more than MOST_BLOCKS blocks.

    stack: scratch, at least WIDTH MOST_BLOCKS numbers.
    """
    stack[0] = root
    waiting, walked, longest = 1, 0, 0.0
    while waiting > 0:
        waiting -= 1
        block = int(stack[waiting])
        walked += 1
        if walked > MOST_BLOCKS:
            return inf
        for k in range(WIDTH):
            child = int(blocks[block, CHILD, k])
            if child > 0:
                stack[waiting] = root + child
                waiting += 1
            elif child < 0:
                longest = max(longest, _longest_in(blocks, root - child))
    return sqrt(longest)


@device
def _longest_in(blocks, leaf):
    """Squared length (m^2) of the longest edge in a block of triangles; infinite if one has a radius or no normal."""
    longest = 0.0
    for k in range(WIDTH):
        T = triangle_at(blocks, leaf, k)
        u, v, w = minus(T.b, T.a), minus(T.c, T.b), minus(T.a, T.c)
        uu, vv, n = dot(u, u), dot(v, v), cross(u, v)
        if blocks[leaf, RADIUS, k] > 0.0 or not dot(n, n) > PARALLEL_SIN2 * uu * vv:
            return inf
        longest = max(longest, max(uu, max(vv, dot(w, w))))
    return longest

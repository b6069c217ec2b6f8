"""How deep two trees overlap, between two bounds: the search ends as soon as these are close enough.

The deepest pair of triangles in two boxes is at most as deep as the boxes overlap along any axis. So a pair of boxes
that overlap by little more than the deepest triangles so far is not opened.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import device
from collision_monitor.meshes.boxes import box_separations, triangle_bounds
from collision_monitor.meshes.distance.nearest import (
    BOUNDS,
    NEAR_A,
    NEAR_B,
    PLACE_A,
    PLACE_B,
    opens_b,
    push_nearest_last,
    triangle_at,
)
from collision_monitor.meshes.layout import CHILD, RADIUS, WIDTH
from collision_monitor.meshes.overlap.leaf_planes import may_cross
from collision_monitor.meshes.overlap.touching_triangles import OPEN, contact_of_places, meet, repeats
from collision_monitor.meshes.placing import Placing, inverse, place_triangle

MOST_LEAVES: Final = 2_000
"""Most pairs of leaves to examine, about 1 ms; hostile meshes need more, and get the full answer."""


@device
def _deepest_of_leaves(
    blocks: Any, place_a: int, leaf_a: int, place_b: int, leaf_b: int, X: Placing, enough: float, answer: Any, work: Any
) -> float:
    """Depth (m) of the deepest triangles of two leaves, or of the first pair at least `enough` deep; -1: none meet.

    Its places are written to the answer if it is deeper than answer[0]. place_a, place_b: the boxes of the leaves.
    """
    triangle_bounds(blocks, place_a // WIDTH, place_a % WIDTH, blocks, leaf_b, X, work, NEAR_B)
    triangle_bounds(blocks, place_b // WIDTH, place_b % WIDTH, blocks, leaf_a, inverse(X), work, NEAR_A)
    best = -1.0
    for m in range(WIDTH):
        if work[NEAR_B + m] > 0.0 or repeats(blocks, leaf_b, m):
            continue
        T, own = place_triangle(X, triangle_at(blocks, leaf_b, m)), blocks[leaf_b, RADIUS, m]
        may = may_cross((*T.a, *T.b, *T.c), own, blocks, leaf_a)
        for k in range(WIDTH):
            if not (may >> k) & 1 or work[NEAR_A + k] > 0.0 or repeats(blocks, leaf_a, k):
                continue
            if not meet(triangle_at(blocks, leaf_a, k), T, own + blocks[leaf_a, RADIUS, k]):
                continue
            depth, _, _ = contact_of_places(blocks, WIDTH * leaf_a + k, blocks, WIDTH * leaf_b + m, X)
            best = max(best, depth)
            if depth > answer[0]:
                answer[0], answer[PLACE_A], answer[PLACE_B] = depth, WIDTH * leaf_a + k, WIDTH * leaf_b + m
            if best >= enough:
                return best
    return best


@device
def depth_range(
    blocks: Any, root_a: int, root_b: int, X: Placing, wanted: float, answer: Any, work: Any
) -> tuple[float, float]:
    """Bounds (m) on the depth of the deepest pair of triangles of two trees that meet, at most `wanted` apart.

    (-1, 0) if none meet, (-1, inf) if the search ended early. X: pose of B in A's frame. answer: gets the places of the
    triangles with the lower bound, as in `nearest_triangles`.
    """
    Y = inverse(X)
    work[0], work[1], work[2] = -inf, WIDTH * root_a, WIDTH * root_b
    waiting, leaves, most = 1, 0, 0.0
    answer[0], answer[PLACE_A], answer[PLACE_B] = -1.0, -1.0, -1.0
    while waiting > 0:  # terminates: each pair of boxes is opened once
        waiting -= 1
        depth, place_a, place_b = -work[3 * waiting], int(work[3 * waiting + 1]), int(work[3 * waiting + 2])
        if answer[0] >= 0.0 and depth <= answer[0] + wanted:
            most = max(most, depth)
            continue
        a, i, b, j = place_a // WIDTH, place_a % WIDTH, place_b // WIDTH, place_b % WIDTH
        child_a, child_b = blocks[a, CHILD, i], blocks[b, CHILD, j]
        if child_a < 0.0 and child_b < 0.0:
            leaves += 1
            if leaves > MOST_LEAVES:
                return -1.0, inf
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            found = _deepest_of_leaves(blocks, place_a, leaf_a, place_b, leaf_b, X, depth - wanted, answer, work)
            if found >= 0.0 and found >= depth - wanted:  # the others were not looked at
                most = max(most, depth)
        elif opens_b(blocks, a, i, child_a, blocks, b, j, child_b):
            block = root_b + int(child_b)
            box_separations(blocks, a, i, blocks, block, X, work, BOUNDS)
            waiting = push_nearest_last(blocks, block, work, waiting, OPEN, float(place_a), True)
        else:
            block = root_a + int(child_a)
            box_separations(blocks, b, j, blocks, block, Y, work, BOUNDS)
            waiting = push_nearest_last(blocks, block, work, waiting, OPEN, float(place_b), False)
    return answer[0], max(most, answer[0])

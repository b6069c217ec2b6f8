"""Nearest triangles of two trees, and whether two trees have a point in common.

Pairs of boxes wait on a stack, the nearest on top; a pair is dropped if its bound exceeds the best distance so far.
The bounds are gaps along two directions, that between the nearest points so far, and that between the centres of the
boxes; where these leave many pairs, also the gaps along the axes of the boxes.
(Larsen, Gottschalk, Lin, Manocha, 1999; Ericson, Real-Time Collision Detection, 6.3)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, dot, minus, opposite
from collision_monitor.meshes.boxes import raise_by_gaps, triangle_bounds
from collision_monitor.meshes.boxes_below import boxes_below, count_of, first_of
from collision_monitor.meshes.distance.leaf_bounds import farthest_along, least_of_pairs, raise_bounds
from collision_monitor.meshes.distance.triangle_pair import Corners, closest_triangle_points
from collision_monitor.meshes.layout import CENTER, CHILD, CORNERS, FACE, HALF, RADIUS, WIDTH
from collision_monitor.meshes.placing import inverse, place_point, place_triangle, turn_back
from collision_monitor.meshes.supports import content_reach_along, support_bounds
from collision_monitor.tolerances import EPSILON

DEEPEST: Final = 24
"""Largest number of levels of two trees together: each level has eight times as many triangles."""

WAITING: Final = 3 * WIDTH * DEEPEST
"""Numbers for the pairs of boxes that wait: bound, box of A, box of B, each box as WIDTH * block + member."""
BOUNDS: Final = WAITING
NEAR_A: Final = BOUNDS + WIDTH
NEAR_B: Final = NEAR_A + WIDTH
PAIRS: Final = NEAR_B + WIDTH
MOST_PAIRS: Final = 4096
"""Most pairs of triangles that touch which are remembered: more than two meshes of a million triangles usually have
along the curve where they cross. The depth of the others is not known then."""
MEMORY: Final = PAIRS + 2 * MOST_PAIRS
"""Numbers of scratch memory of a query."""

BETWEEN: Final = PAIRS
"""Bounds on the squared distances of the triangles of two leaves (m^2); also the pairs of `touching_triangles`."""

# columns of an answer behind its first one, the distance
ON_A: Final = 1
ON_B: Final = 4
PLACE_A: Final = 7
PLACE_B: Final = 8
LEAST: Final = 9
ANSWER: Final = 10
"""Numbers of an answer: distance of the surfaces (m), closest points on both in A's frame (m), the places of the two
triangles, WIDTH * block + member, which serve as a hint for a later query, and a lower bound on the distance (m)."""

CLOSER: Final = 1.0 - 32.0 * EPSILON
"""Factor to the best squared distance below which another one counts. Less: distances are less exact. 1: round-off
makes all triangles of a mesh that is very far away equally near, and nothing is pruned."""

MANY: Final = 4
"""Boxes of a block that may be nearer, along both directions, for which the gaps along the axes are computed too. More:
pairs of surfaces that are close in many places are opened in vain. Fewer: these gaps rarely leave fewer pairs."""

MOST_LEAVES: Final = 50_000
"""Most pairs of leaves to examine, up to 0.7 s. Hostile meshes, such as a million triangles in a point, need more; the
lower bound then is that of the boxes."""


def answer_row() -> NDArray[np.float64]:
    """Make an answer without a hint."""
    row = np.zeros(ANSWER)
    row[PLACE_A] = row[PLACE_B] = -1.0
    return row


@inlined
def triangle_at(blocks: Any, block: int, k: int) -> Corners:
    """Triangle k of a block."""
    return Corners(
        (blocks[block, CORNERS, k], blocks[block, CORNERS + 1, k], blocks[block, CORNERS + 2, k]),
        (blocks[block, CORNERS + 3, k], blocks[block, CORNERS + 4, k], blocks[block, CORNERS + 5, k]),
        (blocks[block, CORNERS + 6, k], blocks[block, CORNERS + 7, k], blocks[block, CORNERS + 8, k]),
    )


@inlined
def size_of(blocks: Any, block: int, member: int) -> float:
    """Sum of the half extents of a box (m)."""
    return blocks[block, HALF, member] + blocks[block, HALF + 1, member] + blocks[block, HALF + 2, member]


@device
def push_nearest_last(
    blocks: Any, block: int, work: Any, waiting: int, limit: float, fixed: float, fixed_is_a: bool
) -> int:
    """Push the pairs of a box and the members of a block with bounds below the limit; return the stack's new length."""
    first = waiting
    bits = boxes_below(limit, work, BOUNDS, blocks, block)
    while bits != 0:
        k = first_of(bits)
        bits &= bits - 1
        bound, at = work[BOUNDS + k], waiting
        while at > first and work[3 * (at - 1)] < bound:
            for c in range(3):
                work[3 * at + c] = work[3 * (at - 1) + c]
            at -= 1
        place = float(WIDTH * block + k)
        work[3 * at] = bound
        work[3 * at + 1] = fixed if fixed_is_a else place
        work[3 * at + 2] = place if fixed_is_a else fixed
        waiting += 1
    return waiting


@inlined
def opens_b(blocks_a: Any, a: int, i: int, child_a: float, blocks_b: Any, b: int, j: int, child_b: float) -> bool:
    """Whether to open the box of B rather than that of A: the one that is not a leaf, or the larger."""
    if child_b < 0.0:
        return False
    return child_a < 0.0 or size_of(blocks_b, b, j) >= size_of(blocks_a, a, i)


@inlined
def _unit(w: Vector) -> Vector:
    """A vector with at most the length 1, in spite of round-off."""
    length = sqrt(dot(w, w)) * (1.0 + 4.0 * EPSILON)
    return w[0] / length, w[1] / length, w[2] / length


@inlined
def _direction(answer: Any, distance: float) -> Vector:
    """Unit vector between the closest points of an answer; 0 if there is none."""
    if not 0.0 < distance < inf:
        return 0.0, 0.0, 0.0
    on_a, on_b = (answer[ON_A], answer[ON_A + 1], answer[ON_A + 2]), (answer[ON_B], answer[ON_B + 1], answer[ON_B + 2])
    return _unit(minus(on_b, on_a))


@inlined
def toward(blocks_a: Any, a: int, i: int, blocks_b: Any, b: int, j: int, X: Any) -> Vector:
    """Unit vector from the centre of a box of A to that of a box of B; 0 if they are one point."""
    w = minus(place_point(X, _center(blocks_b, b, j)), _center(blocks_a, a, i))
    return _unit(w) if dot(w, w) > 0.0 else (0.0, 0.0, 0.0)


@inlined
def _center(blocks: Any, block: int, member: int) -> Vector:
    """Centre of a box (m)."""
    return blocks[block, CENTER, member], blocks[block, CENTER + 1, member], blocks[block, CENTER + 2, member]


@inlined
def _shift(X: Any, n: Vector) -> float:
    """Distance of B's origin from A's along n (m)."""
    return n[0] * X.x + n[1] * X.y + n[2] * X.z


@inlined
def _least(work: Any, at: int) -> float:
    """Least of eight numbers."""
    least = work[at]
    for k in range(1, WIDTH):
        least = min(least, work[at + k])
    return least


@inlined
def _bounds_of(
    blocks_a: Any, a: int, i: int, blocks_b: Any, block: int, X: Any, n: Vector, u: Vector, limit: float, work: Any
) -> None:
    """Write lower bounds on the squared distances of a box of A from the boxes of a block of B (m^2).

    n, u: unit directions from A to B, in A's frame. limit: bounds above it are as good as any (m^2).
    """
    gaps = _shift(X, n) - content_reach_along(blocks_a, a, i, n), _shift(X, u) - content_reach_along(blocks_a, a, i, u)
    support_bounds(opposite(turn_back(X, n)), opposite(turn_back(X, u)), gaps, blocks_b, block, work, BOUNDS)
    if limit < inf and count_of(boxes_below(limit, work, BOUNDS, blocks_b, block)) >= MANY:
        raise_by_gaps(blocks_a, a, i, blocks_b, block, X, work, BOUNDS)


@device
def _leaf_pair(
    blocks_a: Any, a: int, i: int, leaf_a: int, blocks_b: Any, b: int, j: int, leaf_b: int, X: Any, n: Vector,
    best: float, answer: Any, work: Any,
) -> float:  # fmt: skip
    """Improve the answer by the triangles of two leaves; return the best distance. a, i and b, j: their boxes.

    n: a unit direction from A to B, along which the leaves may be apart. The pair with the least bound is examined; its
    direction raises the bounds of the others.
    """
    gap = _shift(X, n) - farthest_along(n, blocks_a, leaf_a)
    if not gap - farthest_along(opposite(turn_back(X, n)), blocks_b, leaf_b) < best:
        return best
    triangle_bounds(blocks_a, a, i, blocks_b, leaf_b, X, work, NEAR_B)
    if not _least(work, NEAR_B) < best * best:
        return best
    triangle_bounds(blocks_b, b, j, blocks_a, leaf_a, inverse(X), work, NEAR_A)
    if not _least(work, NEAR_A) < best * best:
        return best
    for k in range(1, WIDTH):
        if blocks_a[leaf_a, FACE, k] == blocks_a[leaf_a, FACE, k - 1]:
            work[NEAR_A + k] = inf
        if blocks_b[leaf_b, FACE, k] == blocks_b[leaf_b, FACE, k - 1]:
            work[NEAR_B + k] = inf
    raise_bounds(n, blocks_a, leaf_a, blocks_b, leaf_b, X, work, BETWEEN, NEAR_A)
    while True:  # terminates: each pair is examined once
        bound, pair = least_of_pairs(work, BETWEEN)
        if not bound < best * best:
            return best
        work[BETWEEN + pair] = inf
        k, m = pair // WIDTH, pair % WIDTH
        T = place_triangle(X, triangle_at(blocks_b, leaf_b, m))
        found = closest_triangle_points(triangle_at(blocks_a, leaf_a, k), T)
        distance = max(sqrt(found.squared) - blocks_a[leaf_a, RADIUS, k] - blocks_b[leaf_b, RADIUS, m], 0.0)
        if distance < best:
            best = distance
            answer[0] = distance
            for c in range(3):
                answer[ON_A + c], answer[ON_B + c] = found.on_a[c], found.on_b[c]
            answer[PLACE_A], answer[PLACE_B] = WIDTH * leaf_a + k, WIDTH * leaf_b + m
            if best == 0.0:
                return best
        if found.squared > 0.0:
            n = _unit(minus(found.on_b, found.on_a))
            raise_bounds(n, blocks_a, leaf_a, blocks_b, leaf_b, X, work, BETWEEN, -1)


@device
def nearest_triangles(
    blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Any, limit: float, answer: Any, work: Any
) -> float:
    """Write the nearest triangles of two trees to the answer if they are nearer than `limit` (m); return the distance.

    blocks_a, root_a: the array of a tree and its block 0 there. X (Placing): pose of B in A's frame. answer: may hold
    the places of two triangles as a hint, else -1. work (MEMORY,). The distance is at least 0; inf: none below it.
    """
    best = limit
    found = inf
    if answer[PLACE_A] >= 0.0:
        a, b = int(answer[PLACE_A]), int(answer[PLACE_B])
        S = triangle_at(blocks_a, a // WIDTH, a % WIDTH)
        closest = closest_triangle_points(S, place_triangle(X, triangle_at(blocks_b, b // WIDTH, b % WIDTH)))
        radius = blocks_a[a // WIDTH, RADIUS, a % WIDTH] + blocks_b[b // WIDTH, RADIUS, b % WIDTH]
        distance = max(sqrt(closest.squared) - radius, 0.0)
        if distance < best:
            best = found = distance
            answer[0] = distance
            for c in range(3):
                answer[ON_A + c], answer[ON_B + c] = closest.on_a[c], closest.on_b[c]
    Y = inverse(X)
    work[0], work[1], work[2] = 0.0, WIDTH * root_a, WIDTH * root_b
    waiting, leaves = 1, 0
    n = _direction(answer, found) if found < inf else toward(blocks_a, root_a, 0, blocks_b, root_b, 0, X)
    while waiting > 0 and best > 0.0:  # terminates: each pair of boxes is opened once
        waiting -= 1
        limit = CLOSER * best * best
        if not work[3 * waiting] < limit:
            continue
        place_a, place_b = int(work[3 * waiting + 1]), int(work[3 * waiting + 2])
        a, i, b, j = place_a // WIDTH, place_a % WIDTH, place_b // WIDTH, place_b % WIDTH
        child_a, child_b = blocks_a[a, CHILD, i], blocks_b[b, CHILD, j]
        if child_a < 0.0 and child_b < 0.0:
            leaves += 1
            if leaves > MOST_LEAVES:
                waiting += 1
                break
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            distance = _leaf_pair(blocks_a, a, i, leaf_a, blocks_b, b, j, leaf_b, X, n, best, answer, work)
            if distance < best:
                best = found = distance
                n = _direction(answer, found)
            continue
        u = toward(blocks_a, a, i, blocks_b, b, j, X)
        if opens_b(blocks_a, a, i, child_a, blocks_b, b, j, child_b):
            block = root_b + int(child_b)
            _bounds_of(blocks_a, a, i, blocks_b, block, X, n, u, limit, work)
            waiting = push_nearest_last(blocks_b, block, work, waiting, limit, float(place_a), True)
        else:
            block = root_a + int(child_a)
            m, v = opposite(turn_back(X, n)), opposite(turn_back(X, u))
            _bounds_of(blocks_b, b, j, blocks_a, block, Y, m, v, limit, work)
            waiting = push_nearest_last(blocks_a, block, work, waiting, limit, float(place_b), False)
    least = found * found
    for k in range(waiting):  # of a search that ended early
        least = min(least, work[3 * k])
    answer[LEAST] = sqrt(least)
    return found

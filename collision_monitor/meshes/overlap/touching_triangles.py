"""Triangles of two trees that have a point in common: all of them up to a limit, or just whether there is one."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, cross, dot, minus
from collision_monitor.meshes.boxes import box_separations, triangle_bounds
from collision_monitor.meshes.distance.nearest import (
    BOUNDS,
    NEAR_A,
    NEAR_B,
    PAIRS,
    PLACE_A,
    PLACE_B,
    opens_b,
    push_nearest_last,
    triangle_at,
)
from collision_monitor.meshes.distance.triangle_pair import Corners, closest_triangle_points, crossing_point
from collision_monitor.meshes.layout import CHILD, FACE, RADIUS, WIDTH
from collision_monitor.meshes.overlap.leaf_planes import may_cross, may_touch
from collision_monitor.meshes.placing import inverse, place_triangle
from collision_monitor.tolerances import PARALLEL_SIN2

NOWHERE: Final = (0.0, 0.0, 0.0)

OPEN: Final = 5e-324
"""Least gap (m) that separates two boxes: the smallest number above 0."""

MOST_LEAVES: Final = 100_000
"""Most pairs of leaves to examine, about 50 ms. Hostile meshes, such as a million triangles in a point, need more; the
answer then says that it is not complete."""


FEWER_LEAVES: Final = 2_000
"""The same for `nearly_touching`, about 1 ms."""


@inlined
def repeats(blocks: Any, block: int, k: int) -> bool:
    """Whether a member of a block of triangles repeats the one before."""
    return k > 0 and blocks[block, FACE, k] == blocks[block, FACE, k - 1]


@inlined
def _pairs_within(
    blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Any, slack: float, most: int, leaves: int, work: Any
) -> tuple[int, bool]:
    """`touching_triangles` of triangles at most `slack` (m) apart, until so many pairs of leaves are examined."""
    Y, near = inverse(X), max(slack, OPEN)
    work[0], work[1], work[2] = 0.0, WIDTH * root_a, WIDTH * root_b
    waiting, found = 1, 0
    while waiting > 0:  # terminates: each pair of boxes is opened once
        waiting -= 1
        place_a, place_b = int(work[3 * waiting + 1]), int(work[3 * waiting + 2])
        a, i, b, j = place_a // WIDTH, place_a % WIDTH, place_b // WIDTH, place_b % WIDTH
        child_a, child_b = blocks_a[a, CHILD, i], blocks_b[b, CHILD, j]
        if child_a < 0.0 and child_b < 0.0:
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            leaves -= 1
            if leaves < 0:
                return found, False
            triangle_bounds(blocks_a, a, i, blocks_b, leaf_b, X, work, NEAR_B)
            triangle_bounds(blocks_b, b, j, blocks_a, leaf_a, Y, work, NEAR_A)
            for m in range(WIDTH):
                if work[NEAR_B + m] > slack * slack or repeats(blocks_b, leaf_b, m):
                    continue
                T, own = place_triangle(X, triangle_at(blocks_b, leaf_b, m)), blocks_b[leaf_b, RADIUS, m]
                corners = (*T.a, *T.b, *T.c)
                if slack > 0.0:
                    may = may_touch(corners, own, blocks_a, leaf_a, slack)
                else:
                    may = may_cross(corners, own, blocks_a, leaf_a)
                for k in range(WIDTH):
                    if not (may >> k) & 1 or work[NEAR_A + k] > slack * slack or repeats(blocks_a, leaf_a, k):
                        continue
                    if meet(triangle_at(blocks_a, leaf_a, k), T, own + blocks_a[leaf_a, RADIUS, k] + slack):
                        work[PAIRS + 2 * found], work[PAIRS + 2 * found + 1] = WIDTH * leaf_a + k, WIDTH * leaf_b + m
                        found += 1
                        if found == most:
                            return found, False
        elif opens_b(blocks_a, a, i, child_a, blocks_b, b, j, child_b):
            block = root_b + int(child_b)
            box_separations(blocks_a, a, i, blocks_b, block, X, work, BOUNDS)
            waiting = push_nearest_last(blocks_b, block, work, waiting, near, float(place_a), True)
        else:
            block = root_a + int(child_a)
            box_separations(blocks_b, b, j, blocks_a, block, Y, work, BOUNDS)
            waiting = push_nearest_last(blocks_a, block, work, waiting, near, float(place_b), False)
    return found, True


@device
def touching_triangles(
    blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Any, most: int, work: Any
) -> tuple[int, bool]:
    """Find pairs of triangles that meet, `most` at most; return their number, and whether these are all.

    Pair k is at work[PAIRS + 2 k]: the places of both triangles. Other arguments as in `nearest_triangles`.
    """
    return _pairs_within(blocks_a, root_a, blocks_b, root_b, X, 0.0, most, MOST_LEAVES, work)


@device
def nearly_touching(
    blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Any, slack: float, most: int, work: Any
) -> int:
    """Number of some pairs of triangles at most `slack` (m) apart, as `touching_triangles` finds them.

    Round-off may hide triangles that touch in one plane from `touching_triangles`.
    """
    found, _ = _pairs_within(blocks_a, root_a, blocks_b, root_b, X, slack, most, FEWER_LEAVES, work)
    return found


@inlined
def meet(S: Corners, T: Corners, radius: float) -> bool:
    """Whether two triangles, enlarged by this radius together, have a point in common."""
    if radius > 0.0:
        return closest_triangle_points(S, T).squared <= radius * radius
    found, _ = crossing_point(S, T)
    return found


@inlined
def _overlap_along(S: Corners, T: Corners, axis: Vector) -> tuple[float, float]:
    """How far T has to move along the axis, or against it, to leave S; in units of the axis."""
    a, b, c = dot(S.a, axis), dot(S.b, axis), dot(S.c, axis)
    x, y, z = dot(T.a, axis), dot(T.b, axis), dot(T.c, axis)
    forth = max(a, max(b, c)) - min(x, min(y, z))
    back = max(x, max(y, z)) - min(a, min(b, c))
    return forth, back


@device
def triangle_depth(S: Corners, T: Corners) -> tuple[float, Vector]:
    """Length (m) and direction of the shortest translation of T that parts two triangles that meet.

    It is along the normal of one of them or at a right angle to an edge of each, as all faces of their difference are.
    """
    d = minus(S.b, S.a), minus(S.c, S.b), minus(S.a, S.c)
    e = minus(T.b, T.a), minus(T.c, T.b), minus(T.a, T.c)
    best, direction = inf, (0.0, 0.0, 1.0)
    for k in range(11):
        if k == 9:
            u, v = d[0], d[1]
        elif k == 10:
            u, v = e[0], e[1]
        else:
            u = d[0] if k < 3 else (d[1] if k < 6 else d[2])
            v = e[0] if k % 3 == 0 else (e[1] if k % 3 == 1 else e[2])
        n = cross(u, v)
        nn = dot(n, n)
        if not nn > PARALLEL_SIN2 * dot(u, u) * dot(v, v):
            continue
        length = sqrt(nn)
        n = n[0] / length, n[1] / length, n[2] / length
        forth, back = _overlap_along(S, T, n)
        if forth < best:
            best, direction = forth, n
        if back < best:
            best, direction = back, (-n[0], -n[1], -n[2])
    return max(best, 0.0), direction


@device
def triangle_pair_depth(S: Corners, T: Corners, radius: float) -> tuple[float, Vector, Vector]:
    """Depth (m) of two triangles enlarged by this radius together, its direction from S to T, and a point on S.

    The depth is negative if they are apart.
    """
    crosses, _ = crossing_point(S, T)
    if crosses:
        depth, n = triangle_depth(S, T)
        parted = Corners(along(T.a, depth, n), along(T.b, depth, n), along(T.c, depth, n))
        return depth + radius, n, closest_triangle_points(S, parted).on_a
    found = closest_triangle_points(S, T)
    length = sqrt(found.squared)
    w = minus(found.on_b, found.on_a)
    n = (w[0] / length, w[1] / length, w[2] / length) if length > 0.0 else (0.0, 0.0, 1.0)
    return radius - length, n, found.on_a


@device
def contact_of_places(blocks_a: Any, a: int, blocks_b: Any, b: int, X: Any) -> tuple[float, Vector, Vector]:
    """`triangle_pair_depth` of the triangles at two places, WIDTH * block + member; the point is on A's surface."""
    S = triangle_at(blocks_a, a // WIDTH, a % WIDTH)
    T = place_triangle(X, triangle_at(blocks_b, b // WIDTH, b % WIDTH))
    own = blocks_a[a // WIDTH, RADIUS, a % WIDTH]
    depth, n, x = triangle_pair_depth(S, T, own + blocks_b[b // WIDTH, RADIUS, b % WIDTH])
    return depth, n, along(x, own, n)


@device
def deepest_touching(
    blocks_a: Any, blocks_b: Any, X: Any, work: Any, count: int, answer: Any
) -> tuple[float, Vector, Vector]:
    """Depth (m) of the deepest of the first pairs of `touching_triangles`, its direction, and a point on A.

    Its places are written to the answer (see `nearest_triangles`).
    """
    best, direction, point = -1.0, (0.0, 0.0, 1.0), NOWHERE
    for k in range(count):
        a, b = int(work[PAIRS + 2 * k]), int(work[PAIRS + 2 * k + 1])
        depth, n, x = contact_of_places(blocks_a, a, blocks_b, b, X)
        if depth > best:
            best, direction, point = depth, n, x
            answer[PLACE_A], answer[PLACE_B] = a, b
    return best, direction, point

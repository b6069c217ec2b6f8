"""Whether a point is inside a closed, oriented surface: by its winding number, from a ray through the tree."""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, cross, dot, minus, sum_of_sizes
from collision_monitor.meshes.boxes import box_separations, half_of
from collision_monitor.meshes.distance.nearest import BOUNDS, PAIRS, triangle_at
from collision_monitor.meshes.layout import CENTER, CHILD, CLOSED, FIRST_PART, MOST_PARTS, PARTS, WIDTH
from collision_monitor.meshes.overlap.touching_triangles import repeats
from collision_monitor.meshes.placing import Placing, inverse, place_point, turned_back
from collision_monitor.narrow_phase.gjk import closest_on_triangle, weighted
from collision_monitor.tolerances import EPSILON, SAT_ROUND_OFF

OUTSIDE, UNKNOWN, INSIDE = 0, 1, 2

MOST_LOCATED: Final = 10_000
"""Most points and boxes of the other surface to locate, 10 to 30 ms. Many disjoint parts near a surface, such as a
cloud around a robot, need more only if they are as near to the surface as to each other."""

UNDECIDED: Final = 1 << 62
"""Not a winding number."""

DIRECTIONS: Final = (
    (0.5377, 0.2871, 0.7928), (-0.3138, 0.9102, 0.2702), (0.8791, -0.4418, 0.1789), (0.1, -0.61, -0.7861)
)  # fmt: skip
"""Rays that are tried one after another: a ray that passes too near an edge decides nothing. None is parallel to what
people build."""


@device
def locate_in_surface(blocks: Any, root: int, x: Vector, work: Any) -> int:
    """OUTSIDE or INSIDE for a point (m) in the frame of a closed surface; UNKNOWN if round-off leaves it open."""
    e = half_of(blocks, root, 0)
    c = blocks[root, CENTER, 0], blocks[root, CENTER + 1, 0], blocks[root, CENTER + 2, 0]
    y = turned_back(blocks, root, 0, minus(x, c))
    if abs(y[0]) > e[0] or abs(y[1]) > e[1] or abs(y[2]) > e[2]:
        return OUTSIDE
    for d in DIRECTIONS:
        winding = _winding(blocks, root, x, d, work)
        if winding != UNDECIDED:
            return INSIDE if winding != 0 else OUTSIDE
    return UNKNOWN


@device
def is_in(blocks: Any, root: int, other: Any, other_root: int, X: Placing, clear: float, work: Any) -> int:
    """INSIDE if a part of the other tree, placed by X, is in the solid that a tree bounds and no surfaces meet.

    clear (m): distance of the two surfaces, or less. UNKNOWN if round-off, or the number of parts, leaves it open.
    """
    if blocks[root, CLOSED, 1] == 0.0:
        return OUTSIDE
    parts = int(other[other_root, PARTS, 1])
    if parts > MOST_PARTS:
        return _is_some_in(blocks, root, other, other_root, X, clear, work)
    first = other_root + int(other[other_root, FIRST_PART, 1])
    known = OUTSIDE
    for k in range(parts):
        block, member = first + k // WIDTH, k % WIDTH
        x = place_point(X, (other[block, 0, member], other[block, 1, member], other[block, 2, member]))
        known = max(known, locate_in_surface(blocks, root, x, work))
        if known == INSIDE:
            return INSIDE
    return known


@device
def is_either_in(blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Placing, clear: float, work: Any) -> int:
    """The larger of `is_in` of B in A, and of A in B. X: pose of B in A's frame."""
    known: int = is_in(blocks_a, root_a, blocks_b, root_b, X, clear, work)
    if known != INSIDE:
        known = max(known, is_in(blocks_b, root_b, blocks_a, root_a, inverse(X), clear, work))
    return known


@device
def _is_some_in(blocks: Any, root: int, other: Any, other_root: int, X: Placing, clear: float, work: Any) -> int:
    """`is_in` by a corner of each triangle of the other tree that is near the solid.

    One of them answers for a box if no surface is in the sphere about it, because all are on the same side then.
    """
    work[PAIRS] = WIDTH * other_root
    waiting, located, known = 1, 0, OUTSIDE
    while waiting > 0:  # terminates: each box is opened once
        waiting -= 1
        place = int(work[PAIRS + waiting])
        child = other[place // WIDTH, CHILD, place % WIDTH]
        block = other_root + int(abs(child))
        if child > 0.0:
            box_separations(blocks, root, 0, other, block, X, work, BOUNDS)
        for k in range(WIDTH):
            if child > 0.0:
                if other[block, CHILD, k] == 0.0 or work[BOUNDS + k] > 0.0:
                    continue
                e = half_of(other, block, k)
                if 4.0 * dot(e, e) >= clear * clear:
                    located += 1
                    c = other[block, CENTER, k], other[block, CENTER + 1, k], other[block, CENTER + 2, k]
                    if not is_clear(blocks, root, place_point(X, c), sqrt(dot(e, e)) * (1.0 + 1e-9), work):
                        work[PAIRS + waiting] = WIDTH * block + k
                        waiting += 1
                        continue
                x = _first_point(other, other_root, block, k)
            elif repeats(other, block, k):
                continue
            else:
                x = triangle_at(other, block, k).a
            if located >= MOST_LOCATED:
                return UNKNOWN
            located += 1
            known = max(known, locate_in_surface(blocks, root, place_point(X, x), work))
            if known == INSIDE:
                return INSIDE
    return known


@device
def is_clear(blocks: Any, root: int, x: Vector, radius: float, work: Any) -> bool:
    """Whether no triangle is in the sphere of a radius (m) about a point."""
    work[0] = WIDTH * root
    waiting = 1
    while waiting > 0:  # terminates: each box is opened once
        waiting -= 1
        place = int(work[waiting])
        child = blocks[place // WIDTH, CHILD, place % WIDTH]
        block = root + int(abs(child))
        for k in range(WIDTH):
            if child > 0.0:
                if blocks[block, CHILD, k] == 0.0:
                    continue
                e = half_of(blocks, block, k)
                c = blocks[block, CENTER, k], blocks[block, CENTER + 1, k], blocks[block, CENTER + 2, k]
                y = turned_back(blocks, block, k, minus(x, c))
                gap = max(abs(y[0]) - e[0], 0.0), max(abs(y[1]) - e[1], 0.0), max(abs(y[2]) - e[2], 0.0)
                if dot(gap, gap) <= radius * radius:
                    work[waiting] = WIDTH * block + k
                    waiting += 1
            elif not repeats(blocks, block, k):
                T = triangle_at(blocks, block, k)
                a, b, c = minus(T.a, x), minus(T.b, x), minus(T.c, x)
                y = weighted(closest_on_triangle(a, b, c), a, b, c)
                if sqrt(dot(y, y)) <= radius + SAT_ROUND_OFF * (sum_of_sizes(a) + sum_of_sizes(b) + sum_of_sizes(c)):
                    return False
    return True


@device
def _first_point(blocks: Any, root: int, block: int, k: int) -> Vector:
    """A corner of a triangle in a box."""
    child = blocks[block, CHILD, k]
    while child > 0.0:  # terminates: one level down
        child = blocks[root + int(child), CHILD, 0]
    return triangle_at(blocks, root - int(child), 0).a


@inlined
def _ray_meets(blocks: Any, block: int, k: int, x: Vector, d: Vector) -> bool:
    """Whether the ray from x along d may meet a box: no axis of it, and no cross product with d, separates them."""
    e = half_of(blocks, block, k)
    c = blocks[block, CENTER, k], blocks[block, CENTER + 1, k], blocks[block, CENTER + 2, k]
    p, q = turned_back(blocks, block, k, minus(x, c)), turned_back(blocks, block, k, d)
    for i in range(3):
        if (p[i] > e[i] and q[i] >= 0.0) or (p[i] < -e[i] and q[i] <= 0.0):
            return False
    m = cross(q, p)
    return (
        abs(m[0]) <= e[1] * abs(q[2]) + e[2] * abs(q[1])
        and abs(m[1]) <= e[0] * abs(q[2]) + e[2] * abs(q[0])
        and abs(m[2]) <= e[0] * abs(q[1]) + e[1] * abs(q[0])
    )


@device
def _winding(blocks: Any, root: int, x: Vector, d: Vector, work: Any) -> int:
    """Crossings of the ray from x along d out of the surface less those into it; UNDECIDED if round-off leaves it open.

    It counts the solids that contain the point, so that their common part is inside too, and a cavity outside.
    """
    work[0] = WIDTH * root
    waiting, count = 1, 0
    while waiting > 0:
        waiting -= 1
        place = int(work[waiting])
        child = blocks[place // WIDTH, CHILD, place % WIDTH]
        if child > 0.0:
            block = root + int(child)
            for k in range(WIDTH):
                if blocks[block, CHILD, k] != 0.0 and _ray_meets(blocks, block, k, x, d):
                    work[waiting] = WIDTH * block + k
                    waiting += 1
            continue
        block = root - int(child)
        for k in range(WIDTH):
            if repeats(blocks, block, k):
                continue
            T = triangle_at(blocks, block, k)
            a, b, c = minus(T.a, x), minus(T.b, x), minus(T.c, x)
            u, v, w = dot(cross(a, b), d), dot(cross(b, c), d), dot(cross(c, a), d)
            scale = max(dot(a, a), max(dot(b, b), dot(c, c)))
            slack = 64.0 * EPSILON * scale
            if (u < -slack or v < -slack or w < -slack) and (u > slack or v > slack or w > slack):
                continue
            if a == b and b == c:  # a face that repeats another, see `made_tree`
                continue
            volume = dot(cross(a, b), c)  # its sign, against that of the turns, says on which side of x the triangle is
            if abs(u) <= slack or abs(v) <= slack or abs(w) <= slack or abs(volume) <= slack * scale**0.5:
                return UNDECIDED
            if (volume > 0.0) == (u > 0.0):
                count += 1 if u > 0.0 else -1
    return count

"""Two triangles: their distance with its closest points, and whether they meet. Flat triangles and points are allowed.

The closest points lie on two edges, or on a corner and a face; otherwise an edge passes through a face. The search
ends as soon as the vector between the closest points of two edges separates the triangles by more than its round-off.
(Larsen, Gottschalk, Lin, Manocha, Fast proximity queries with swept sphere volumes, 1999; Ericson, 5.1.9)
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, cross, dot, minus, sum_of_sizes
from collision_monitor.tolerances import SAT_ROUND_OFF, SEGMENT_PARALLEL_SIN2


class Corners(NamedTuple):
    """Corners (m)."""

    a: Any
    b: Any
    c: Any


class Closest(NamedTuple):
    """Squared distance (m^2), and the closest points on both (m)."""

    squared: Any
    on_a: Any
    on_b: Any


@inlined
def _within(x: float) -> float:
    return min(max(x, 0.0), 1.0)


@inlined
def _segments(p: Vector, d: Vector, q: Vector, e: Vector) -> tuple[float, Vector, Vector, Vector]:
    """Closest points of the segments p + s d and q + t e, s and t in [0, 1]; d and e may be 0."""
    r = minus(q, p)
    dd, ee, de = dot(d, d), dot(e, e), dot(d, e)
    n = cross(d, e)
    nn = dot(n, n)
    s = 0.0
    if nn > SEGMENT_PARALLEL_SIN2 * dd * ee:
        s = _within(dot(cross(r, e), n) / nn)
    t = (s * de - dot(r, e)) / ee if ee > 0.0 else 0.0
    if t < 0.0 or t > 1.0 or not ee > 0.0:
        t = _within(t)
        s = _within((t * de + dot(r, d)) / dd) if dd > 0.0 else 0.0
    x, y = along(p, s, d), along(q, t, e)
    w = minus(y, x)
    return dot(w, w), x, y, w


@inlined
def _is_over(x: Vector, S: Corners, n: Vector, nn: float) -> bool:
    """Whether the projection of x onto the plane of the triangle S lies in it; n: normal of any length, nn = n . n."""
    return (
        dot(cross(minus(S.b, S.a), minus(x, S.a)), n) >= 0.0
        and dot(cross(minus(S.c, S.b), minus(x, S.b)), n) >= 0.0
        and dot(cross(minus(S.a, S.c), minus(x, S.c)), n) >= 0.0
    ) and nn > 0.0


@inlined
def _pierces(x: Vector, y: Vector, S: Corners) -> bool:
    """Whether the segment from x to y passes through the triangle S; the ends lie on both sides of its plane."""
    d = minus(y, x)
    a, b, c = minus(S.a, x), minus(S.b, x), minus(S.c, x)
    u, v, w = dot(cross(a, b), d), dot(cross(b, c), d), dot(cross(c, a), d)
    return (u >= 0.0 and v >= 0.0 and w >= 0.0) or (u <= 0.0 and v <= 0.0 and w <= 0.0)


@inlined
def normal(S: Corners) -> Vector:
    """Normal of a triangle, as long as twice its area."""
    return cross(minus(S.b, S.a), minus(S.c, S.a))


@inlined
def _heights(S: Corners, T: Corners, n: Vector) -> Vector:
    """Heights of the corners of S above the plane of T, times the length of its normal n."""
    return dot(minus(S.a, T.a), n), dot(minus(S.b, T.a), n), dot(minus(S.c, T.a), n)


@inlined
def _crossing(S: Corners, T: Corners, h: Vector) -> tuple[bool, Vector]:
    """Whether an edge of S passes through T, and a point of it there; h: heights of S's corners above T's plane."""
    if h[0] * h[1] <= 0.0 and h[0] != h[1] and _pierces(S.a, S.b, T):
        return True, along(S.a, h[0] / (h[0] - h[1]), minus(S.b, S.a))
    if h[1] * h[2] <= 0.0 and h[1] != h[2] and _pierces(S.b, S.c, T):
        return True, along(S.b, h[1] / (h[1] - h[2]), minus(S.c, S.b))
    if h[2] * h[0] <= 0.0 and h[2] != h[0] and _pierces(S.c, S.a, T):
        return True, along(S.c, h[2] / (h[2] - h[0]), minus(S.a, S.c))
    return False, S.a


@inlined
def _all_on_one_side(h: Vector) -> bool:
    return (h[0] > 0.0 and h[1] > 0.0 and h[2] > 0.0) or (h[0] < 0.0 and h[1] < 0.0 and h[2] < 0.0)


@device
def crossing_point(S: Corners, T: Corners) -> tuple[bool, Vector]:
    """Whether an edge of either triangle passes through the other, and a point of both (m)."""
    n, m = normal(S), normal(T)
    h = _heights(S, T, m)
    if _all_on_one_side(h):
        return False, S.a
    g = _heights(T, S, n)
    if _all_on_one_side(g):
        return False, S.a
    found, x = _crossing(S, T, h)
    if found:
        return True, x
    return _crossing(T, S, g)


@inlined
def corner(S: Corners, k: int) -> Vector:
    """Corner k of a triangle."""
    return S.a if k == 0 else (S.b if k == 1 else S.c)


@device
def closest_triangle_points(S: Any, T: Any) -> Any:
    """Closest points of two triangles (Closest)."""
    best, on_s, on_t = inf, S.a, T.a
    for i in range(3):
        p = corner(S, i)
        d = minus(corner(S, (i + 1) % 3), p)
        third = corner(S, (i + 2) % 3)
        for j in range(3):
            q = corner(T, j)
            e = minus(corner(T, (j + 1) % 3), q)
            squared, x, y, w = _segments(p, d, q, e)
            if squared < best:
                best, on_s, on_t = squared, x, y
                up, down = minus(third, x), minus(y, corner(T, (j + 2) % 3))
                gap_s, gap_t = -dot(up, w), -dot(down, w)
                if squared > 0.0 and gap_s >= 0.0 and gap_t >= 0.0:
                    slack = SAT_ROUND_OFF * (sum_of_sizes(x) + sum_of_sizes(d) + sum_of_sizes(e))
                    if gap_s >= slack * sum_of_sizes(up) and gap_t >= slack * sum_of_sizes(down):
                        return Closest(best, on_s, on_t)
    n, m = normal(S), normal(T)
    nn, mm = dot(n, n), dot(m, m)
    g, h = _heights(T, S, n), _heights(S, T, m)
    for k in range(3):
        x, y = corner(S, k), corner(T, k)
        high, over = g[k], h[k]
        if nn > 0.0 and high * high < best * nn and _is_over(y, S, n, nn):
            best, on_s, on_t = high * high / nn, along(y, -high / nn, n), y
        if mm > 0.0 and over * over < best * mm and _is_over(x, T, m, mm):
            best, on_s, on_t = over * over / mm, x, along(x, -over / mm, m)
    if not (_all_on_one_side(g) or _all_on_one_side(h)):
        found, x = _crossing(S, T, h)
        if not found:
            found, x = _crossing(T, S, g)
        if found:
            return Closest(0.0, x, x)
    return Closest(best, on_s, on_t)

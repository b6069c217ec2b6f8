"""Slow oracles in rational numbers for the exact predicates of geometry."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from hypothesis import strategies as st

LATTICE = st.integers(-4, 4)
POINTS_2D = st.tuples(LATTICE, LATTICE)
POINTS_3D = st.tuples(LATTICE, LATTICE, LATTICE)
EXPONENTS = st.integers(-30, 30)
"""Exponents of powers of two that scale a scene from 1e-9 to 1e9 without rounding."""


def exact(point: Any) -> list[Fraction]:
    return [Fraction(float(x)) for x in point]


def minus(p: list[Fraction], q: list[Fraction]) -> list[Fraction]:
    return [x - y for x, y in zip(p, q, strict=True)]


def dot(u: list[Fraction], v: list[Fraction]) -> Fraction:
    return sum((x * y for x, y in zip(u, v, strict=True)), Fraction(0))


def cross2(u: list[Fraction], v: list[Fraction]) -> Fraction:
    return u[0] * v[1] - u[1] * v[0]


def cross3(u: list[Fraction], v: list[Fraction]) -> list[Fraction]:
    return [u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]]


def area2(a: Any, b: Any, p: Any) -> Fraction:
    a, b, p = exact(a), exact(b), exact(p)
    return cross2(minus(b, a), minus(p, a))


def volume6(a: Any, b: Any, c: Any, p: Any) -> Fraction:
    a, b, c, p = exact(a), exact(b), exact(c), exact(p)
    return dot(cross3(minus(b, a), minus(c, a)), minus(p, a))


def sign(x: Fraction) -> int:
    return (x > 0) - (x < 0)


def on_segment(p: Any, a: Any, b: Any) -> bool:
    """Whether p = a + t (b - a) for a t in 0 … 1, as on the lecture's slide."""
    p, a, b = exact(p), exact(a), exact(b)
    if a == b:
        return p == a
    along, to = minus(b, a), minus(p, a)
    k = next(i for i, x in enumerate(along) if x)
    t = to[k] / along[k]
    return 0 <= t <= 1 and all(x == t * y for x, y in zip(to, along, strict=True))


def common_points(a: Any, b: Any, c: Any, d: Any) -> tuple[Any, Any] | None:
    """First and last common point of the segments a, b and c, d in the plane, or None."""
    a, b, c, d = exact(a), exact(b), exact(c), exact(d)
    u, v, w = minus(b, a), minus(d, c), minus(c, a)
    turn = cross2(u, v)
    if turn:
        t, s = cross2(w, v) / turn, cross2(w, u) / turn
        if not (0 <= t <= 1 and 0 <= s <= 1):
            return None
        p = [a[0] + t * u[0], a[1] + t * u[1]]
        return p, p
    shared = sorted(p for p in (a, b) if on_segment(p, c, d)) + sorted(p for p in (c, d) if on_segment(p, a, b))
    return (min(shared), max(shared)) if shared else None


def in_polygon(p: Any, polygon: Any) -> int:
    """1 inside, 0 on the boundary, -1 outside; by a ray that meets no corner."""
    n = len(polygon)
    sides = [(polygon[i], polygon[(i + 1) % n]) for i in range(n)]
    if any(on_segment(p, a, b) for a, b in sides):
        return 0
    q = exact(p)
    for step in range(1, 1000):
        direction = [Fraction(1), Fraction(step, 997)]
        if all(cross2(direction, minus(exact(corner), q)) for corner in polygon):
            break
    count = 0
    for a, b in sides:
        a, b = exact(a), exact(b)
        side_a, side_b = cross2(direction, minus(a, q)), cross2(direction, minus(b, q))
        if sign(side_a) != sign(side_b):
            t = side_a / (side_a - side_b)
            hit = [x + t * (y - x) for x, y in zip(a, b, strict=True)]
            count += dot(minus(hit, q), direction) > 0
    return 1 if count % 2 else -1


def in_triangle(p: list[Fraction], a: list[Fraction], b: list[Fraction], c: list[Fraction]) -> bool:
    """Whether a point in the plane of a non-degenerate triangle is in the triangle, boundary included."""
    n = cross3(minus(b, a), minus(c, a))
    return all(dot(cross3(minus(v, u), minus(p, u)), n) >= 0 for u, v in ((a, b), (b, c), (c, a)))


def in_polyhedron(p: Any, vertices: Any, faces: Any) -> int:
    """1 inside, 0 on the boundary, -1 outside; by a ray that meets no edge. Faces must not be degenerate."""
    q = exact(p)
    corners = [[exact(vertices[i]) for i in face] for face in faces]
    for a, b, c in corners:
        if volume6(a, b, c, p) == 0 and in_triangle(q, a, b, c):
            return 0
    for step in range(1, 1000):
        direction = [Fraction(1), Fraction(step, 997), Fraction(step * step, 1009 * 991)]
        count = 0
        for a, b, c in corners:
            n = cross3(minus(b, a), minus(c, a))
            turns = [dot(cross3(minus(u, q), minus(v, q)), direction) for u, v in ((a, b), (b, c), (c, a))]
            if 0 in turns and len({sign(t) for t in turns} - {0}) < 2:
                break  # through an edge: take another direction
            same = len({sign(t) for t in turns}) == 1
            count += same and dot(minus(a, q), n) / dot(direction, n) > 0
        else:
            return 1 if count % 2 else -1
    raise AssertionError("no ray without an edge")


def segment_meets_triangle(p: Any, q: Any, a: Any, b: Any, c: Any) -> bool:
    """Whether segment p, q meets a non-degenerate triangle, by the steps of the lecture's slide in rationals."""
    p, q, a, b, c = exact(p), exact(q), exact(a), exact(b), exact(c)
    n = cross3(minus(b, a), minus(c, a))
    before, after = dot(minus(p, a), n), dot(minus(q, a), n)
    if before == 0 and after == 0:
        k = max(range(3), key=lambda i: abs(n[i]))
        flat = [[x for i, x in enumerate(r) if i != k] for r in (p, q, a, b, c)]
        crosses = [common_points(flat[0], flat[1], flat[i], flat[j]) for i, j in ((2, 3), (3, 4), (4, 2))]
        return any(crosses) or in_triangle(p, a, b, c)
    if sign(before) == sign(after):
        return False
    t = before / (before - after)
    return in_triangle([x + t * (y - x) for x, y in zip(p, q, strict=True)], a, b, c)

"""Feature of a triangle at a point of it: the vertex, the edge or the face that touches there."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, dot, minus
from collision_monitor.meshes.distance.triangle_pair import Corners, normal
from collision_monitor.narrow_phase.gjk import closest_on_triangle, weighted
from collision_monitor.shapes.feature_types import EDGE, FACE, VERTEX
from collision_monitor.shapes.registry import CURVED
from collision_monitor.shapes.revolved import ROUND_TIE
from collision_monitor.tolerances import FEATURE_TIE

WHOLE_FACE, WHOLE_EDGE, CORNER, ON_EDGE, IN_FACE = range(5)
"""Ranks of features at a point, the best first: a face or an edge that touches as a whole, since the normal is at a
right angle to it; the vertex at the point; the edge or the face that contains it."""


@inlined
def slot_tie(table: Any, a: int, b: int) -> float:
    """Largest difference of equal heights on one of two shapes, as a part of its size."""
    return ROUND_TIE if CURVED[table.kind[a]] or CURVED[table.kind[b]] else FEATURE_TIE


@device
def off_segment(x: Vector, p: Vector, q: Vector) -> float:
    """Squared distance of a point from a segment, which may be a point (m^2)."""
    d, w = minus(q, p), minus(x, p)
    dd = dot(d, d)
    t = min(max(dot(d, w) / dd, 0.0), 1.0) if dd > 0.0 else 0.0
    w = along(w, -t, d)
    return dot(w, w)


@inlined
def off_triangle(x: Vector, T: Corners) -> tuple[float, Vector]:
    """Squared distance of a point from a triangle (m^2), and the nearest point of it."""
    foot = weighted(closest_on_triangle(minus(T.a, x), minus(T.b, x), minus(T.c, x)), T.a, T.b, T.c)
    d = minus(foot, x)
    return dot(d, d), foot


@device
def feature_in_triangle(T: Corners, x: Vector, n: Vector, reach: float) -> tuple[int, float, float]:
    """Rank, type (contact_row.py) and number of the feature of a triangle at a point x of it, for a normal n.

    Corner c has the number c, and so has the edge from there. reach (m): heights and distances up to it count as 0.
    """
    level_a = abs(dot(minus(T.a, x), n)) <= reach
    level_b = abs(dot(minus(T.b, x), n)) <= reach
    level_c = abs(dot(minus(T.c, x), n)) <= reach
    if level_a and level_b and level_c:
        return WHOLE_FACE, FACE, 0.0
    near = reach * reach
    on_ab, on_bc, on_ca = off_segment(x, T.a, T.b), off_segment(x, T.b, T.c), off_segment(x, T.c, T.a)
    if on_ab <= near and level_a and level_b:
        return WHOLE_EDGE, EDGE, 0.0
    if on_bc <= near and level_b and level_c:
        return WHOLE_EDGE, EDGE, 1.0
    if on_ca <= near and level_c and level_a:
        return WHOLE_EDGE, EDGE, 2.0
    nearest, corner = inf, 0.0
    for c in range(3):
        d = minus(x, T.a if c == 0 else (T.b if c == 1 else T.c))
        if dot(d, d) < nearest:
            nearest, corner = dot(d, d), float(c)
    if nearest <= near:
        return CORNER, VERTEX, corner
    least = min(on_ab, min(on_bc, on_ca))
    if least <= near:
        return ON_EDGE, EDGE, 0.0 if on_ab == least else (1.0 if on_bc == least else 2.0)
    return IN_FACE, FACE, 0.0


@device
def triangle_feature(T: Corners, number: float, x: Vector, n: Vector, reach: float) -> tuple[float, float]:
    """Type and index of the feature of a triangle at the point that is nearest to x, for a normal n, in its frame.

    Face f (`number`) has the index f. Its corner c has 3 f + c, as in `faces.ravel()`, and so has its edge from that
    corner on. reach: see `feature_in_triangle`.
    """
    _, foot = off_triangle(x, T)
    _, kind, c = feature_in_triangle(T, foot, n, reach)
    return kind, number if kind == FACE else 3.0 * number + c


@device
def number_in_hull(table: Any, s: int, T: Corners, kind: float, c: float, reach: float) -> float:
    """Number of a feature of a hull: the lowest of its vertices. kind, c: of the feature in a triangle of the hull.

    A face is all vertices within `reach` (m) of the triangle's plane.
    """
    first = T.a if c == 0.0 else (T.b if c == 1.0 else T.c)
    second = T.b if c == 0.0 else (T.c if c == 1.0 else T.a)
    number = float(_nearest_vertex(table, s, first))
    if kind == VERTEX:
        return number
    number = min(number, float(_nearest_vertex(table, s, second)))
    if kind == EDGE:
        return number
    m = normal(T)
    number = min(number, float(_nearest_vertex(table, s, T.c)))
    level = reach * sqrt(dot(m, m))
    for k in range(table.vertex_start[s], table.vertex_start[s] + table.vertex_count[s]):
        if abs(dot(minus(vertex_at(table, k), T.a), m)) <= level:
            number = min(number, float(table.vertex_index[k]))
    return number


@inlined
def vertex_at(table: Any, k: int) -> Vector:
    """Vertex k of a shape table."""
    return table.vertices[0, k], table.vertices[1, k], table.vertices[2, k]


@device
def _nearest_vertex(table: Any, s: int, x: Vector) -> int:
    """Number of the vertex of a hull that is nearest to a point."""
    nearest, number = inf, 0
    for k in range(table.vertex_start[s], table.vertex_start[s] + table.vertex_count[s]):
        d = minus(vertex_at(table, k), x)
        if dot(d, d) < nearest:
            nearest, number = dot(d, d), int(table.vertex_index[k])
    return number

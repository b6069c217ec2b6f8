"""Penetration depth of two convex cores by the expanding polytope algorithm, with bounds from both sides.

(van den Bergen, Proximity Queries and Penetration Depth Computation, 2001.) The polytope lies inside of B - A, so the
distance of its nearest face bounds the depth from below; the support distance along any direction bounds it from above.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, across, along, cross, dot, minus, opposite, scaled
from collision_monitor.narrow_phase.core import CorePair
from collision_monitor.narrow_phase.gjk import closest_on_triangle, point_on_a, simplex_point, weighted
from collision_monitor.narrow_phase.support_difference import support_difference
from collision_monitor.narrow_phase.work_memory import (
    EDGES,
    FACES,
    MAX_FACES,
    SIMPLEX,
    SIMPLEX_ROW,
    SPARE,
    WEIGHTS,
)
from collision_monitor.tolerances import EPSILON, FLAT, SLIVER_SIN2

# Columns of a face, MAX_FACES numbers each: its normal, its distance, its three vertices; and of an edge.
_NX, _NY, _NZ, _D, _I, _J, _K = range(FACES, FACES + 7 * MAX_FACES, MAX_FACES)
_FROM: Final = EDGES
_TO: Final = EDGES + 3 * MAX_FACES


@inlined
def _from_first(work: Any, k: int) -> Vector:
    """From the first point of the simplex to point k."""
    return minus(simplex_point(work, k), simplex_point(work, 0))


@inlined
def _normal(work: Any, i: int, j: int, k: int) -> tuple[Vector, float]:
    """Cross product of the edges ij and ik, and the product of their squared lengths."""
    a = simplex_point(work, i)
    u, v = minus(simplex_point(work, j), a), minus(simplex_point(work, k), a)
    return cross(u, v), dot(u, u) * dot(v, v)


@inlined
def _set_face(work: Any, f: int, i: int, j: int, k: int) -> None:
    """Face f through the points i, j, k, counter-clockwise from outside; a sliver gets distance inf and no normal."""
    n, product = _normal(work, i, j, k)
    n2 = dot(n, n)
    work[_I + f] = i
    work[_J + f] = j
    work[_K + f] = k
    if n2 > SLIVER_SIN2 * product:
        n = scaled(n, 1.0 / sqrt(n2))
        work[_D + f] = dot(n, simplex_point(work, i))
    else:
        n = (0.0, 0.0, 0.0)
        work[_D + f] = inf
    work[_NX + f] = n[0]
    work[_NY + f] = n[1]
    work[_NZ + f] = n[2]


@device
def _probe(work: Any, count: int, step: int) -> Vector:
    """Unit direction in which to search for a point off the first `count` simplex points: 6 steps, then 4, then 2."""
    s = 1.0 if step % 2 == 0 else -1.0
    if count == 1:
        return (
            s if step // 2 == 0 else 0.0,
            s if step // 2 == 1 else 0.0,
            s if step // 2 == 2 else 0.0,
        )
    if count == 2:
        edge = _from_first(work, 1)
        u = across(edge, (0.0, 0.0, 0.0))
        if step >= 2:
            u = cross(edge, u)
    else:
        u, _ = _normal(work, 0, 1, 2)
    length = s * sqrt(dot(u, u))
    return u[0] / length, u[1] / length, u[2] / length


@device
def _off(work: Any, count: int, n: Vector) -> float:
    """How far the spare row is off the point, line or plane of the first `count` simplex points; n is the plane's."""
    d = _from_first(work, 4)
    if count == 3:
        return abs(dot(d, n))
    if count == 2:
        edge = _from_first(work, 1)
        length = sqrt(dot(edge, edge))
        d = cross(edge, d)
        d = (d[0] / length, d[1] / length, d[2] / length)
    return sqrt(dot(d, d))


@inlined
def _push_edge(work: Any, count: int, i: float, j: float) -> int:
    """Add a directed edge to the horizon, or cancel it against its reverse: the edge is then inside the hole."""
    for e in range(count):
        if work[_FROM + e] == j and work[_TO + e] == i:
            work[_FROM + e] = work[_FROM + count - 1]
            work[_TO + e] = work[_TO + count - 1]
            return count - 1
    work[_FROM + count] = i
    work[_TO + count] = j
    return count + 1


@inlined
def _grow(cores: CorePair, work: Any, flat: float, count: int) -> tuple[int, float, Vector]:
    """Grow the simplex to a tetrahedron; returns its points, an upper bound of the depth (m) and its direction.

    Each point is the farthest of a few support points: along the axes from a point, across a line, to both sides of a
    plane. If none is farther than `flat` (m), B - A is flat and the simplex keeps fewer than four points.
    """
    while count < 4:
        farthest = 0.0
        upper = inf
        nearest = (0.0, 0.0, 0.0)
        for step in range(8 - 2 * count):
            d = _probe(work, count, step)
            w = support_difference(cores, work, d, SPARE)
            h = dot(d, w)
            if h < upper:
                upper = h
                nearest = d
            off = _off(work, count, d)
            if off > farthest:
                farthest = off
                for m in range(SIMPLEX_ROW):
                    work[SIMPLEX + SIMPLEX_ROW * count + m] = work[SPARE + m]
        if farthest <= flat:
            return count, upper, nearest
        work[WEIGHTS + count] = 0.0
        count += 1
    return count, inf, (0.0, 0.0, 0.0)


@inlined
def _least_along_axes(cores: CorePair, work: Any) -> tuple[float, Vector]:
    """Upper bound of the depth (m) and its direction: the least support along the six directions of A's axes."""
    least = inf
    direction = (1.0, 0.0, 0.0)
    for step in range(6):
        d = _probe(work, 1, step)
        h = dot(d, support_difference(cores, work, d, SPARE))
        if h < least:
            least = h
            direction = d
    return least, direction


@device
def _weighted_point_on_a(work: Any, count: int) -> Vector:
    """Point on A with the weights of the first `count` simplex points."""
    point = (0.0, 0.0, 0.0)
    for k in range(count):
        point = along(point, work[WEIGHTS + k], point_on_a(work, k))
    return point


@inlined
def _is_vertex(work: Any, points: int, w: Vector) -> bool:
    """Whether the polytope of this many points already has the vertex w."""
    for k in range(points):
        x, y, z = simplex_point(work, k)
        if x == w[0] and y == w[1] and z == w[2]:
            return True
    return False


@inlined
def _add_vertex(work: Any, faces: int, vertex: int, w: Vector, visible: float) -> tuple[int, bool]:
    """Replace the faces that vertex w sees by a cone; returns the number of faces, and whether the cone fits."""
    edges = 0
    f = 0
    while f < faces:
        if dot((work[_NX + f], work[_NY + f], work[_NZ + f]), w) - work[_D + f] > visible:
            edges = _push_edge(work, edges, work[_I + f], work[_J + f])
            edges = _push_edge(work, edges, work[_J + f], work[_K + f])
            edges = _push_edge(work, edges, work[_K + f], work[_I + f])
            faces -= 1
            for m in range(7):
                work[FACES + m * MAX_FACES + f] = work[FACES + m * MAX_FACES + faces]
        else:
            f += 1
    if faces + edges > MAX_FACES:
        return faces, False
    for e in range(edges):
        _set_face(work, faces, int(work[_FROM + e]), int(work[_TO + e]), vertex)
        faces += 1
    return faces, True


@inlined
def _nearest_face(work: Any, faces: int) -> int:
    """The face with the smallest distance from the origin."""
    near = 0
    for f in range(1, faces):
        if work[_D + f] < work[_D + near]:
            near = f
    return near


@inlined
def _expand(
    cores: CorePair, work: Any, size: float, tolerance: float, most: int
) -> tuple[float, float, Vector, float, int]:
    """Expand the tetrahedron of the simplex until the bounds of the depth meet.

    Returns (upper, lower, outward, plane, faces): the bounds (m), the direction that proves `upper`, the
    distance (m) of the face with that normal, the number of faces.
    """
    n, _ = _normal(work, 0, 1, 2)
    p, q = (1, 2) if dot(n, _from_first(work, 3)) < 0.0 else (2, 1)
    _set_face(work, 0, 0, p, q)
    _set_face(work, 1, 0, q, 3)
    _set_face(work, 2, 0, 3, p)
    _set_face(work, 3, p, 3, q)
    faces = 4
    points = 4
    upper = inf
    outward = (0.0, 0.0, 0.0)
    lower_cap = inf
    lower = -inf
    plane = 0.0
    visible = 8.0 * EPSILON * size
    while points < most:
        near = _nearest_face(work, faces)
        distance = work[_D + near]
        if not distance < inf:
            break
        lower = max(lower, min(distance, lower_cap))
        n = (work[_NX + near], work[_NY + near], work[_NZ + near])
        w = support_difference(cores, work, n, SIMPLEX + SIMPLEX_ROW * points)
        h = dot(n, w)
        if h < upper:
            upper = h
            outward = n
            plane = distance
        if upper - lower <= tolerance * size or upper <= distance:
            break
        if _is_vertex(work, points, w) or h - distance <= visible:
            # round-off tilted this face: it cannot be expanded, and its distance remains a bound
            lower_cap = min(lower_cap, distance)
            work[_D + near] = inf
            continue
        faces, fits = _add_vertex(work, faces, points, w, visible)
        if not fits:
            break
        points += 1
    return upper, lower, outward, plane, faces


@inlined
def _witness(work: Any, faces: int, exit_point: Vector, reach: float) -> Vector:
    """Point on A where the ray to `exit_point` leaves the polytope, on any coplanar face within `reach` (m)."""
    best = inf
    point_a = (0.0, 0.0, 0.0)
    for f in range(faces):
        if work[_D + f] <= reach or best == inf:
            i, j, k = int(work[_I + f]), int(work[_J + f]), int(work[_K + f])
            a, b, c = simplex_point(work, i), simplex_point(work, j), simplex_point(work, k)
            weights = closest_on_triangle(minus(a, exit_point), minus(b, exit_point), minus(c, exit_point))
            d = minus(weighted(weights, a, b, c), exit_point)
            d2 = dot(d, d)
            if d2 < best:
                best = d2
                point_a = weighted(weights, point_on_a(work, i), point_on_a(work, j), point_on_a(work, k))
    return point_a


@outlined
def epa(
    cores: CorePair, work: Any, size: float, count: int, tolerance: float, most: int
) -> tuple[float, float, Vector, Vector]:
    """Depth of two cores that overlap or touch, from the `count` simplex points that GJK left, in A's frame.

    Returns (upper, lower, normal, point_a): bounds of the depth (m), the unit direction from A to B, the witness on A.
    Ends when upper - lower <= tolerance * size (m), or with `most` (<= MAX_VERTICES) points.
    """
    flat = FLAT * size
    count, upper, outward = _grow(cores, work, flat, count)
    if count < 4:
        return upper, min(upper, -flat), opposite(outward), _weighted_point_on_a(work, count)
    upper, lower, outward, plane, faces = _expand(cores, work, size, tolerance, most)
    if not upper < inf:  # every face of the first tetrahedron is a sliver
        upper, outward = _least_along_axes(cores, work)
        lower = min(upper, -flat)
    reach = plane + max(upper - plane, 64.0 * EPSILON * size)
    return upper, lower, opposite(outward), _witness(work, faces, scaled(outward, upper), reach)

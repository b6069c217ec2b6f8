"""Distance of two convex cores by GJK, with a certified lower bound.

(Gilbert, Johnson, Keerthi, 1988; van den Bergen, 2003, chapter 4; closest points by Voronoi regions: Ericson, 5.1)
The scratch memory stores the simplex in rows as `support_difference` writes them.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, cross, direction, dot, minus, opposite, scaled
from collision_monitor.narrow_phase.core import CorePair
from collision_monitor.narrow_phase.support_difference import support_difference
from collision_monitor.narrow_phase.work_memory import NEW_WEIGHTS, ON_A, P_AB, SIMPLEX, SIMPLEX_ROW, WEIGHTS
from collision_monitor.tolerances import EPSILON, FLAT, GJK_RELATIVE, GJK_TOUCHING, THIN_SIN2

MAX_ITERATIONS: Final = 64


class Accuracy(NamedTuple):
    """How exact a distance has to be."""

    near: Any  # m: a distance that is at most this need not be known any better
    slack: Any  # m: by how much a lower bound of a larger one may be too small


EXACT: Final = Accuracy(0.0, 0.0)
"""As exact as numbers allow."""


@inlined
def simplex_point(work: Any, k: int) -> Vector:
    """Point k of the simplex."""
    at = SIMPLEX + SIMPLEX_ROW * k
    return work[at], work[at + 1], work[at + 2]


@inlined
def point_on_a(work: Any, k: int) -> Vector:
    """The point on A from which point k of the simplex was computed."""
    at = SIMPLEX + SIMPLEX_ROW * k + ON_A
    return work[at], work[at + 1], work[at + 2]


@inlined
def weighted(weights: Vector, a: Vector, b: Vector, c: Vector) -> Vector:
    """The weighted sum of the corners of a triangle."""
    wa, wb, wc = weights
    return (
        wa * a[0] + wb * b[0] + wc * c[0],
        wa * a[1] + wb * b[1] + wc * c[1],
        wa * a[2] + wb * b[2] + wc * c[2],
    )


@inlined
def _segment(a: Vector, b: Vector) -> float:
    """Weight of b in the point of segment ab that is closest to the origin."""
    e = minus(b, a)
    length2 = dot(e, e)
    toward = -dot(a, e)
    if toward <= 0.0 or not length2 > 0.0:
        return 0.0
    if toward >= length2:
        return 1.0
    return toward / length2


@inlined
def _triangle(a: Vector, b: Vector, c: Vector) -> tuple[Vector, bool]:
    """Weights of a, b and the newest point c in the point closest to the origin; whether it is inside the face."""
    u, v = minus(b, a), minus(c, a)
    n = cross(u, v)
    # barycentric coordinates of the origin's projection, each as a triple product with the normal
    wa = dot(n, cross(b, c))
    wb = dot(n, cross(c, a))
    wc = dot(n, cross(a, b))
    if wa > 0.0 and wb > 0.0 and wc > 0.0 and dot(n, n) > 0.0:
        total = wa + wb + wc
        return (wa / total, wb / total, wc / total), True
    # on an edge or a corner, even if the triangle is thin; not on edge ab: it was not the nearest before
    t = _segment(a, c)
    on_ac = along(a, t, v)
    s = _segment(b, c)
    on_bc = along(b, s, minus(c, b))
    if dot(on_ac, on_ac) <= dot(on_bc, on_bc):
        return (1.0 - t, 0.0, t), False
    return (0.0, 1.0 - s, s), False


@device
def closest_on_triangle(a: Vector, b: Vector, c: Vector) -> Vector:
    """Weights of a, b, c in the point of a triangle that is closest to the origin, without earlier steps."""
    weights, inside = _triangle(a, b, c)
    if inside:
        return weights
    nearest = weighted(weights, a, b, c)
    t = _segment(a, b)
    on_ab = along(a, t, minus(b, a))
    if dot(on_ab, on_ab) < dot(nearest, nearest):
        return 1.0 - t, t, 0.0
    return weights


@device
def _face_vector(a: Vector, b: Vector, c: Vector, weights: Vector) -> Vector:
    """Projection of the origin on the plane of a triangle, or the weighted point if the triangle is thin.

    Near contact the plane's normal is accurate and the weighted sum is round-off; for a thin triangle, the reverse.
    """
    u, v = minus(b, a), minus(c, a)
    n = cross(u, v)
    n2 = dot(n, n)
    if n2 <= THIN_SIN2 * dot(u, u) * dot(v, v):
        return along(along(a, weights[1], u), weights[2], v)
    return scaled(n, dot(n, a) / n2)


@inlined
def _keep(work: Any, count: int) -> int:
    """Adopt the new weights and drop the simplex points of weight 0; returns the number of points left."""
    kept = 0
    for k in range(count):
        if work[NEW_WEIGHTS + k] > 0.0:
            work[WEIGHTS + kept] = work[NEW_WEIGHTS + k]
            if kept != k:
                for m in range(SIMPLEX_ROW):
                    work[SIMPLEX + SIMPLEX_ROW * kept + m] = work[SIMPLEX + SIMPLEX_ROW * k + m]
            kept += 1
    return kept


@inlined
def _closest(work: Any, count: int, size: float) -> tuple[bool, Vector]:
    """Whether the simplex contains the origin, and its point closest to the origin; writes the weights of that point.

    The last point is the newest; before it, the closest point was inside the simplex of the others.
    """
    a, b = simplex_point(work, 0), simplex_point(work, 1)
    if count == 2:
        t = _segment(a, b)
        work[NEW_WEIGHTS] = 1.0 - t
        work[NEW_WEIGHTS + 1] = t
        return False, along(a, t, minus(b, a))
    c = simplex_point(work, 2)
    if count == 3:
        weights, inside = _triangle(a, b, c)
        work[NEW_WEIGHTS] = weights[0]
        work[NEW_WEIGHTS + 1] = weights[1]
        work[NEW_WEIGHTS + 2] = weights[2]
        if inside:
            return False, _face_vector(a, b, c, weights)
        return False, weighted(weights, a, b, c)
    flat2 = (FLAT * size) ** 2
    best = inf
    nearest = (0.0, 0.0, 0.0)
    d = simplex_point(work, 3)
    for face in range(3):
        # a, b and the newest point d; c is opposite
        if face > 0:
            a, b, c = b, c, a
        n = cross(minus(a, d), minus(b, d))
        origin = -dot(n, d)
        height = dot(n, minus(c, d))
        # a flat tetrahedron contains nothing: its sides are noise
        if origin * height > 0.0 and height * height > flat2 * dot(n, n):
            continue
        weights, inside = _triangle(a, b, d)
        point = _face_vector(a, b, d, weights) if inside else weighted(weights, a, b, d)
        d2 = dot(point, point)
        if d2 < best:
            best = d2
            nearest = point
            work[NEW_WEIGHTS + face] = weights[0]
            work[NEW_WEIGHTS + (face + 1) % 3] = weights[1]
            work[NEW_WEIGHTS + (face + 2) % 3] = 0.0
            work[NEW_WEIGHTS + 3] = weights[2]
    return best == inf, nearest


@inlined
def gjk(cores: CorePair, work: Any, size: float, limit: float, accuracy: Accuracy) -> tuple[int, float, Vector]:
    """Distance between two cores, with the pose of B in A's frame in the scratch memory.

    Returns (points in the simplex, certified lower bound (m), unit direction from A to B in A's frame that proves it).
    0 points: the search ended early because the lower bound passed `limit` (m). A lower bound <= 0 means that the
    cores overlap or touch within round-off, or that their distance is at most accuracy.near.
    """
    _, toward = direction((work[P_AB], work[P_AB + 1], work[P_AB + 2]))
    length = 1.0
    squared = inf
    count = 0
    lower = -inf
    normal = (0.0, 0.0, 0.0)
    for _ in range(MAX_ITERATIONS):
        w = support_difference(cores, work, opposite(toward), SIMPLEX + SIMPLEX_ROW * count)
        bound = dot(toward, w) / length
        if bound > lower:
            lower = bound
            normal = (toward[0] / length, toward[1] / length, toward[2] / length)
            if lower > limit:
                return 0, lower, normal
        if count > 0 and length - lower <= GJK_RELATIVE * length + 4.0 * EPSILON * size + accuracy.slack:
            break
        if count == 0:
            inside, nearest = False, w
            work[NEW_WEIGHTS] = 1.0
        else:
            inside, nearest = _closest(work, count + 1, size)
        if inside and lower <= 0.0:
            return 4, 0.0, (0.0, 0.0, 1.0)
        shorter = dot(nearest, nearest)
        if inside or not shorter < squared:
            # round-off: no more progress is possible; return the current bounds
            break
        count = _keep(work, count + 1)
        toward = nearest
        squared = shorter
        length = sqrt(squared)
        if length <= max(GJK_TOUCHING * size, accuracy.near):
            return count, 0.0, (0.0, 0.0, 1.0)
    return count, lower, normal

"""`vertex_face_impact` and `edge_edge_impact`: first contact of two features of meshes whose points move straight.

Both find the first root of F(t, u, w) = A(t) + u B(t) + w C(t), where A, B and C are linear in time: v - f0, f0 - f1
and f0 - f2 for a vertex and a face, a0 - b0, a1 - a0 and b0 - b1 for two edges. Over a box of (t, u, w), each component
of F is within its values at the corners of the box. Boxes that cannot hold a root are dropped and others are halved,
the earlier half first. With a separation, conservative advancement by distance over speed comes first.
(Snyder, 1992; Wang, Ferguson, Schneider, Jiang, Attene and Panozzo, 2021)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor.checks.numbers import as_numbers, checked_number, checked_whole
from collision_monitor.errors import InputError
from collision_monitor.geometry.vector import cross, dot
from collision_monitor.tolerances import EPSILON, LARGEST_INPUT

MOST_BOXES: Final = 8192
"""Largest number of boxes for one query, which take less than 1 ms; an easy query takes one, a hit about a hundred."""

TOLERANCE: Final = 1e-6
"""Default tolerance of a hit, as a part of the query's size."""

_CLEAR, _HIT, _UNRESOLVED = 0, 1, 2
_NAMES: Final = np.array(["clear", "hit", "unresolved"])

_AXES: Final = 6
"""Axes along which F is evaluated: x, y, z and a frame of the features, which separates coplanar and parallel ones."""

_DEPTH: Final = 200
"""Largest number of waiting boxes: one for each halving of one box, and no side is halved more than 50 times."""

_SHORTEST: Final = 2.0**-50
"""Side of a box that is not halved further, so that the ends of all boxes are exact numbers."""

_STEPS: Final = 1000
"""Largest number of steps of conservative advancement, about 100 µs; the boxes settle the rest."""

_DISTANCE_ERROR: Final = 1e-9
"""Largest excess of a computed distance, as a part of the query's size; it is 1e-11 for nearly parallel edges."""

_PARALLEL_SIN2: Final = 1e-22
"""sin^2 between two edges below which the closest points are searched at the ends only, where they are at most 1e-11
of the size farther apart."""

_BORDER: Final = 1e-6
"""Part of an edge by which a closest point may lie beyond its end; the distance is then hardly too short."""

_ROUND_OFF: Final = 16 * EPSILON
"""Error of a computed component of F, as a part of the sum of its terms: a dozen roundings of half a unit."""


@dataclass(frozen=True, eq=False)
class FeatureImpact:
    """Results of queries of shape (...), as arrays of that shape, or as plain values for one query.

    status: "hit": within [lower, upper] they come within separation + tolerance. "clear": they do not come within the
    separation, and the times are infinite. "unresolved": the budget ran out, upper is infinite; treat it as a hit.
    lower, upper: parts of the step, from 0 to 1. There is no contact before lower.

    >>> FeatureImpact("clear", math.inf, math.inf).status
    'clear'
    """

    status: Any
    lower: Any
    upper: Any


def vertex_face_impact(
    x: ArrayLike, separation: float = 0.0, tolerance: float | None = None, budget: int = MOST_BOXES
) -> FeatureImpact:
    """Whether a vertex meets a triangle. x (..., 8, 3): v, f0, f1, f2 at the start, then at the end of the step (m).

    separation (m): distance below which they are in contact. tolerance (m): largest distance of a hit beyond that, by
    default 1e-6 of the largest difference of coordinates. budget: boxes for one query. Round-off hides no contact.
    Raises InputError for another shape of the array, or for numbers that are not finite.

    >>> face = [(-1, -1, 0), (1, -1, 0), (0, 1, 0)]
    >>> found = vertex_face_impact([(0, 0, 1), *face, (0, 0, -1), *face])
    >>> found.status, round(found.lower, 3)
    ('hit', 0.5)
    """
    return _impacts(x, True, separation, tolerance, budget)


def edge_edge_impact(
    x: ArrayLike, separation: float = 0.0, tolerance: float | None = None, budget: int = MOST_BOXES
) -> FeatureImpact:
    """Whether two edges meet. x (..., 8, 3): a0, a1, b0, b1 at the start, then at the end; see `vertex_face_impact`.

    >>> a, above, below = [(-1, 0, 0), (1, 0, 0)], [(0, -1, 3), (0, 1, 3)], [(0, -1, -1), (0, 1, -1)]
    >>> round(edge_edge_impact([*a, *above, *a, *below]).upper, 3)
    0.75
    """
    return _impacts(x, False, separation, tolerance, budget)


def _impacts(x: ArrayLike, face: bool, separation: float, tolerance: float | None, budget: int) -> FeatureImpact:
    points = np.ascontiguousarray(as_numbers(x, "x"))
    if points.ndim < 2 or points.shape[-2:] != (8, 3):
        raise InputError(f"x: expected four points at the start and at the end, (..., 8, 3), got shape {points.shape}")
    if not (np.abs(points) <= LARGEST_INPUT).all():
        raise InputError(f"x: expected finite coordinates up to {LARGEST_INPUT:g}, got NaN, infinity or larger")
    wanted, most = checked_number(separation, "separation", least=0.0), checked_whole(budget, "budget")
    near = 0.0 if tolerance is None else checked_number(tolerance, "tolerance", least=0.0, above=True)
    flat = points.reshape(-1, 8, 3)
    status, lower, upper = np.empty(len(flat), np.uint8), np.empty(len(flat)), np.empty(len(flat))
    _solve(flat, face, wanted, near, most, (status, lower, upper))
    leading = points.shape[:-2]
    if leading == ():
        return FeatureImpact(str(_NAMES[status[0]]), float(lower[0]), float(upper[0]))
    return FeatureImpact(_NAMES[status].reshape(leading), lower.reshape(leading), upper.reshape(leading))


# In the kernels, terms is (_AXES, 7): A, B, C at the start and at the end along an axis, and the round-off of F.


@allocating_kernel
def _solve(x: Any, face: bool, separation: float, tolerance: float, most: int, answers: Any) -> None:
    status, lower, upper = answers
    terms = np.zeros((_AXES, 7))
    boxes = np.zeros((_DEPTH, 6))
    for q in range(x.shape[0]):
        scale = _set_terms(x[q], face, separation, terms)
        near = tolerance if tolerance > 0.0 else TOLERANCE * scale
        begin = 0.0
        if separation > 0.0:
            # boxes all around the features come near at the same time, so advancement is faster
            begin, settled = _advance(terms, face, separation, near, scale)
            if begin > 1.0 or settled:
                status[q] = _HIT if settled else _CLEAR
                lower[q] = upper[q] = begin if settled else math.inf
                continue
        status[q], lower[q], upper[q] = _first_root(terms, boxes, face, separation, near, most, begin)


@device
def _set_terms(x: Any, face: bool, separation: float, terms: Any) -> float:
    """Fill the terms (_AXES, 7) of one query; return the largest difference of its coordinates (m).

    Differences of coordinates are rounded relative to themselves, so a position far from the origin costs no accuracy.
    """
    scale = 0.0
    for k in range(3):
        for end in range(2):
            p0, p1, p2, p3 = x[4 * end, k], x[4 * end + 1, k], x[4 * end + 2, k], x[4 * end + 3, k]
            if face:
                a, b, c = p0 - p1, p1 - p2, p1 - p3
            else:
                a, b, c = p0 - p2, p1 - p0, p2 - p3
            terms[k, 3 * end], terms[k, 3 * end + 1], terms[k, 3 * end + 2] = a, b, c
            scale = max(scale, abs(a), abs(b), abs(c))
    # frame of the features at half time: along the longer of B and C, and perpendicular to both
    b0, b1, b2 = terms[0, 1] + terms[0, 4], terms[1, 1] + terms[1, 4], terms[2, 1] + terms[2, 4]
    c0, c1, c2 = terms[0, 2] + terms[0, 5], terms[1, 2] + terms[1, 5], terms[2, 2] + terms[2, 5]
    b = math.sqrt(b0 * b0 + b1 * b1 + b2 * b2)
    c = math.sqrt(c0 * c0 + c1 * c1 + c2 * c2)
    if b < c:
        b0, b1, b2, b, c0, c1, c2, c = c0, c1, c2, c, b0, b1, b2, b
    framed = b > 0.0
    if framed:
        b0, b1, b2 = b0 / b, b1 / b, b2 / b
        n0, n1, n2 = b1 * c2 - b2 * c1, b2 * c0 - b0 * c2, b0 * c1 - b1 * c0
        n = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        if not n > 1e-6 * b:
            # B and C are parallel: perpendicular to them, towards their offset at the start
            a0, a1, a2 = terms[0, 0], terms[1, 0], terms[2, 0]
            along = a0 * b0 + a1 * b1 + a2 * b2
            n0, n1, n2 = a0 - along * b0, a1 - along * b1, a2 - along * b2
            n = math.sqrt(n0 * n0 + n1 * n1 + n2 * n2)
        framed = n > 1e-12 * b
    for k in range(3, _AXES):
        d0, d1, d2 = 0.0, 0.0, 0.0
        if framed:
            if k == 3:
                d0, d1, d2 = n0 / n, n1 / n, n2 / n
            elif k == 4:
                d0, d1, d2 = b0, b1, b2
            else:
                d0, d1, d2 = (n1 * b2 - n2 * b1) / n, (n2 * b0 - n0 * b2) / n, (n0 * b1 - n1 * b0) / n
        for m in range(6):
            terms[k, m] = d0 * terms[0, m] + d1 * terms[1, m] + d2 * terms[2, m]
    for k in range(_AXES):
        size = 0.0
        if k < 3:
            for m in range(6):
                size += abs(terms[k, m])
        else:
            size = 18.0 * scale  # a projection is rounded relative to the vectors, not to its own size
        terms[k, 6] = _ROUND_OFF * (size + separation) + 1e-300
    return scale


@device
def _may_hold(terms: Any, face: bool, separation: float, t: Any, u: Any, w: Any) -> bool:
    """Whether F may come within the separation of 0 in the box of three intervals (begin, end)."""
    t0, t1 = t
    u0, u1 = u
    w0, w1 = w
    if face:  # the corner beyond u + w = 1 is outside the triangle
        u1, w1 = min(u1, 1.0 - w0), min(w1, 1.0 - u0)
    squared, slack = 0.0, separation
    for k in range(_AXES):
        low, high = math.inf, -math.inf
        for end in range(2):
            at = t0 if end == 0 else t1
            a = terms[k, 0] + at * (terms[k, 3] - terms[k, 0])
            b = terms[k, 1] + at * (terms[k, 4] - terms[k, 1])
            c = terms[k, 2] + at * (terms[k, 5] - terms[k, 2])
            low = min(low, a + min(u0 * b, u1 * b) + min(w0 * c, w1 * c))
            high = max(high, a + max(u0 * b, u1 * b) + max(w0 * c, w1 * c))
        gap = max(low, -high, 0.0)
        if gap > separation + terms[k, 6]:
            return False
        if k < 3:
            squared += gap * gap
            slack += terms[k, 6]
    return squared <= slack * slack


@device
def _first_root(terms: Any, boxes: Any, face: bool, separation: float, near: float, most: int, begin: float) -> Any:
    """Return (status, lower, upper) of one query, which has no root before `begin`."""
    along_t = along_u = along_w = 0.0
    for k in range(3):
        along_t = max(
            along_t,
            abs(terms[k, 3] - terms[k, 0]) + abs(terms[k, 4] - terms[k, 1]) + abs(terms[k, 5] - terms[k, 2]),
        )
        along_u = max(along_u, abs(terms[k, 1]), abs(terms[k, 4]))
        along_w = max(along_w, abs(terms[k, 2]), abs(terms[k, 5]))
    boxes[0, 0], boxes[0, 2], boxes[0, 4] = begin, 0.0, 0.0
    boxes[0, 1] = boxes[0, 3] = boxes[0, 5] = 1.0
    waiting, looked, settled = 1, 0, False
    lower = upper = latest = math.inf
    while waiting > 0:
        waiting -= 1
        t0, t1 = boxes[waiting, 0], boxes[waiting, 1]
        u0, u1 = boxes[waiting, 2], boxes[waiting, 3]
        w0, w1 = boxes[waiting, 4], boxes[waiting, 5]
        if t0 >= latest:  # hardly before the known root: to separate the two would take as long again
            lower = min(lower, t0)
            continue
        if t1 > latest:  # only the part of the box clearly before the known root matters
            t1 = latest
            lower = min(lower, latest)
        if looked == most:
            for k in range(waiting + 1):
                lower = min(lower, boxes[k, 0])
            break
        looked += 1
        if (face and u0 + w0 > 1.0) or not _may_hold(terms, face, separation, (t0, t1), (u0, u1), (w0, w1)):
            continue
        by_t, by_u, by_w = along_t * (t1 - t0), along_u * (u1 - u0), along_w * (w1 - w0)
        largest = max(by_t, by_u, by_w)
        side = 0 if largest == by_t else (2 if largest == by_u else 4)
        small = 2.0 * (by_t + by_u + by_w) <= near
        if small or largest <= _SHORTEST * max(along_t, along_u, along_w):
            if small and _is_apart(terms, separation, near, 0.5 * (t0 + t1), 0.5 * (u0 + u1), 0.5 * (w0 + w1)):
                continue
            settled |= small
            lower, upper = min(lower, t0), min(upper, t1)
            latest = min(latest, t0 - (t1 - t0))
            continue
        # the earlier half is examined first, so it goes on top
        for m in range(6):
            boxes[waiting + 1, m] = boxes[waiting, m]
        boxes[waiting, 1] = boxes[waiting + 1, 1] = t1
        middle = 0.5 * (boxes[waiting, side] + boxes[waiting, side + 1])
        boxes[waiting, side] = middle
        boxes[waiting + 1, side + 1] = middle
        waiting += 2
    if lower == math.inf:
        return _CLEAR, math.inf, math.inf
    if settled:
        return _HIT, lower, upper
    return _UNRESOLVED, lower, math.inf


@device
def _advance(terms: Any, face: bool, separation: float, near: float, scale: float) -> Any:
    """Conservative advancement: return (t, whether they are within separation + near at t). No contact is before t.

    t > 1: no contact in the whole step. (Mirtich, 1996; Li, Kaufman and Jiang, 2021)
    """
    fastest = 0.0
    for corner in range(3 if face else 4):
        u, w = (corner & 1) * 1.0, (corner >> 1) * 1.0
        squared = 0.0
        for k in range(3):
            a = terms[k, 3] - terms[k, 0]
            squared += (a + u * (terms[k, 4] - terms[k, 1]) + w * (terms[k, 5] - terms[k, 2])) ** 2
        fastest = max(fastest, math.sqrt(squared))
    t = 0.0
    for _ in range(_STEPS):
        gap = _distance(terms, face, t) - separation
        if gap <= near:
            return t, True
        step = (gap - _DISTANCE_ERROR * scale) * (1.0 - 1e-12)
        if step >= (1.0 - t) * fastest:
            return 2.0, False
        if not t + step / fastest > t:
            break
        t += step / fastest
    return t, False


@device
def _distance(terms: Any, face: bool, t: float) -> float:
    """Least |F| at t, over the border, edge by edge, and over the inside if F has a minimum there."""
    a = (terms[0, 0] + t * (terms[0, 3] - terms[0, 0]), terms[1, 0] + t * (terms[1, 3] - terms[1, 0]),
         terms[2, 0] + t * (terms[2, 3] - terms[2, 0]))  # fmt: skip
    b = (terms[0, 1] + t * (terms[0, 4] - terms[0, 1]), terms[1, 1] + t * (terms[1, 4] - terms[1, 1]),
         terms[2, 1] + t * (terms[2, 4] - terms[2, 1]))  # fmt: skip
    c = (terms[0, 2] + t * (terms[0, 5] - terms[0, 2]), terms[1, 2] + t * (terms[1, 5] - terms[1, 2]),
         terms[2, 2] + t * (terms[2, 5] - terms[2, 2]))  # fmt: skip
    best, u = _on_edge(a, b, 0.0, c)
    w = 0.0
    squared, s = _on_edge(a, c, 0.0, b)
    if squared < best:
        best, u, w = squared, 0.0, s
    if face:
        squared, s = _on_edge(a, (c[0] - b[0], c[1] - b[1], c[2] - b[2]), 1.0, b)
        if squared < best:
            best, u, w = squared, 1.0 - s, s
    else:
        squared, s = _on_edge(a, b, 1.0, c)
        if squared < best:
            best, u, w = squared, s, 1.0
        squared, s = _on_edge(a, c, 1.0, b)
        if squared < best:
            best, u, w = squared, 1.0, s
    n = cross(b, c)
    nn = dot(n, n)
    if nn > _PARALLEL_SIN2 * dot(b, b) * dot(c, c):
        # start at the border's point, not at a: the rest is short, and so is the effect of n's round-off on it
        f = (a[0] + u * b[0] + w * c[0], a[1] + u * b[1] + w * c[1], a[2] + u * b[2] + w * c[2])
        u -= dot(cross(f, c), n) / nn
        w += dot(cross(f, b), n) / nn
        outside = max(-u, -w, u + w - 1.0) if face else max(-u, -w, u - 1.0, w - 1.0)
        if outside <= _BORDER:
            best = min(best, dot(f, n) ** 2 / nn)
    return math.sqrt(best)


@inlined
def _on_edge(a: Any, along: Any, fixed: float, across: Any) -> Any:
    """Least squared distance of the origin from a + fixed across + s along for s in 0 … 1, and s."""
    x, y, z = a[0] + fixed * across[0], a[1] + fixed * across[1], a[2] + fixed * across[2]
    squared = dot(along, along)
    s = -(x * along[0] + y * along[1] + z * along[2]) / squared if squared > 0.0 else 0.0
    s = min(max(s, 0.0), 1.0)
    x, y, z = x + s * along[0], y + s * along[1], z + s * along[2]
    return x * x + y * y + z * z, s


@device
def _is_apart(terms: Any, separation: float, near: float, t: float, u: float, w: float) -> bool:
    """Whether |F| exceeds the separation in the whole box about (t, u, w), in which F varies by at most near / 2."""
    squared, slack = 0.0, 0.5 * near
    for k in range(3):
        a = terms[k, 0] + t * (terms[k, 3] - terms[k, 0])
        b = terms[k, 1] + t * (terms[k, 4] - terms[k, 1])
        c = terms[k, 2] + t * (terms[k, 5] - terms[k, 2])
        squared += (a + u * b + w * c) ** 2
        slack += terms[k, 6]
    return squared > (separation + slack) ** 2

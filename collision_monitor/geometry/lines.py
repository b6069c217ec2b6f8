"""Lines, rays and segments in the plane: equations, side tests and intersections.

A line is given by two points a, b (..., 2) in parametric form a + t (b - a). (Slides "Types of equations",
"Parametric line equation", "Line intersection – two equations")
"""

from __future__ import annotations

from enum import Enum, IntEnum
from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from collision_monitor.checks.numbers import checked_array
from collision_monitor.errors import InputError
from collision_monitor.geometry.coordinates import Array, Booleans, Signs, coordinates
from collision_monitor.geometry.orientation import orient2d, segments_cross


class LineKind(Enum):
    """Extent of a + t (b - a): the least and the greatest t."""

    LINE = (-inf, inf)
    RAY = (0.0, inf)
    SEGMENT = (0.0, 1.0)


class Relation(IntEnum):
    """Intersection of two lines, rays or segments: nothing, a point or a stretch."""

    NONE = 0
    POINT = 1
    OVERLAP = 2


class Intersection(NamedTuple):
    """relation (...): a Relation; if it is POINT, also parameters t_a, t_b (...) and the point (..., 2), else NaN."""

    relation: Signs
    t_a: Array
    t_b: Array
    point: Array


def point_at(a: ArrayLike, b: ArrayLike, t: ArrayLike) -> Array:
    """Parametric form: the points a + t (b - a) (..., 2 or 3)."""
    a = coordinates(a, "a")
    return np.asarray(a + checked_array(t, "t")[..., None] * (coordinates(b, "b") - a))


def implicit_line(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array, Array]:
    """Implicit form f(x, y) = A x + B y + C (m²) of lines through a, b (..., 2), > 0 on the left. Raises InputError."""
    a, b = _distinct(a, b, "line")
    u = b - a
    return -u[..., 1], u[..., 0], u[..., 1] * a[..., 0] - u[..., 0] * a[..., 1]


def explicit_line(a: ArrayLike, b: ArrayLike) -> tuple[Array, Array]:
    """Explicit form y = m x + k: slope m and intercept k (m). Raises InputError for a vertical line, which has none."""
    a, b = _distinct(a, b, "line")
    u = b - a
    if (u[..., 0] == 0.0).any():
        raise InputError("line: a vertical line has no explicit form y = m x + k; use the implicit one")
    slope = u[..., 1] / u[..., 0]
    return slope, a[..., 1] - slope * a[..., 0]


def side(p: ArrayLike, a: ArrayLike, b: ArrayLike) -> Signs:
    """1 if p (..., 2) is left of the line a to b, -1 right, 0 on it, exactly (slide "Point in convex polygon")."""
    return np.sign(orient2d(a, b, p)).astype(np.int8)


def intersect(
    a: ArrayLike,
    b: ArrayLike,
    c: ArrayLike,
    d: ArrayLike,
    first: LineKind = LineKind.SEGMENT,
    second: LineKind = LineKind.SEGMENT,
) -> Intersection:
    """Intersection of a, b and c, d (..., 2), each a line, a ray from its first point or a segment; ends included.

    The relation is exact. A segment may have no length; a line or ray must have a direction. Raises InputError.
    (Slide "Line intersection – two equations": the vector equation's t_a and t_b, here by Cramer's rule)
    """
    a, b = (coordinates(a, "a", 2), coordinates(b, "b", 2)) if first is LineKind.SEGMENT else _distinct(a, b, "a, b")
    c, d = (coordinates(c, "c", 2), coordinates(d, "d", 2)) if second is LineKind.SEGMENT else _distinct(c, d, "c, d")
    try:
        a, b, c, d = np.broadcast_arrays(a, b, c, d)
    except ValueError:
        raise InputError(f"expected shapes that broadcast, got {a.shape}, {b.shape}, {c.shape}, {d.shape}") from None
    turn = np.asarray(segments_cross(a, b, c, d))
    at_a, at_b = np.asarray(orient2d(c, d, a)), np.asarray(orient2d(c, d, b))
    at_c, at_d = np.asarray(orient2d(a, b, c)), np.asarray(orient2d(a, b, d))
    parallel = turn == 0.0
    way = np.sign(turn)
    meets = ~parallel
    if first is not LineKind.LINE:
        meets &= at_a * way >= 0.0  # t_a >= 0
    if first is LineKind.SEGMENT:
        meets &= at_b * way <= 0.0  # t_a <= 1
    if second is not LineKind.LINE:
        meets &= at_c * way <= 0.0  # t_b >= 0
    if second is LineKind.SEGMENT:
        meets &= at_d * way >= 0.0  # t_b <= 1

    divisor = np.where(meets, turn, 1.0)
    t_a = _parameter(at_a / divisor, at_a, at_b, first)
    t_b = _parameter(-at_c / divisor, at_c, at_d, second)
    point = _along(a, b, t_a)
    # an end that lies on the other line is the intersection, to the last bit
    point = np.where((at_d == 0.0)[..., None], d, np.where((at_c == 0.0)[..., None], c, point))
    point = np.where((at_b == 0.0)[..., None], b, np.where((at_a == 0.0)[..., None], a, point))
    relation = np.where(meets, Relation.POINT, Relation.NONE).astype(np.int8)

    in_line = parallel & (at_a == 0.0) & (at_b == 0.0) & (at_c == 0.0) & (at_d == 0.0)
    low = np.maximum(_ends(a, b, first)[0], _ends(c, d, second)[0])
    high = np.minimum(_ends(a, b, first)[1], _ends(c, d, second)[1])
    shared = in_line & (low <= high).all(axis=-1)
    single = shared & (low == high).all(axis=-1)
    relation[shared] = Relation.OVERLAP
    relation[single] = Relation.POINT
    point = np.where(single[..., None], low, point)
    t_a, t_b = np.where(single, _position(low, a, b), t_a), np.where(single, _position(low, c, d), t_b)
    one = relation == Relation.POINT
    return Intersection(
        relation, np.where(one, t_a, np.nan), np.where(one, t_b, np.nan), np.where(one[..., None], point, np.nan)
    )


def segments_intersect(a: ArrayLike, b: ArrayLike, c: ArrayLike, d: ArrayLike) -> Booleans:
    """Whether the segments a, b and c, d (..., 2) have a point in common, exactly. (Slide "Line intersection")"""
    return np.asarray(intersect(a, b, c, d).relation != Relation.NONE)


def _distinct(a: ArrayLike, b: ArrayLike, what: str) -> tuple[Array, Array]:
    a, b = coordinates(a, what, 2), coordinates(b, what, 2)
    if (a == b).all(axis=-1).any():
        raise InputError(f"{what}: expected two different points, which give a direction, got the same point twice")
    return a, b


def _parameter(t: Array, at_start: Array, at_end: Array, extent: LineKind) -> Array:
    t = np.where(at_start == 0.0, 0.0, np.where(at_end == 0.0, 1.0, t))
    return np.clip(t, *extent.value)


def _along(a: Array, b: Array, t: Array) -> Array:
    near_b = ((t > 0.5) & (t < 2.0))[..., None]
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(near_b, b - (1.0 - t)[..., None] * (b - a), a + t[..., None] * (b - a))


def _position(p: Array, a: Array, b: Array) -> Array:
    """Parameters t of points p that lie on a, b; 0 if a equals b."""
    u, w = b - a, p - a
    axis = np.abs(u).argmax(axis=-1)[..., None]
    u, w = np.take_along_axis(u, axis, -1)[..., 0], np.take_along_axis(w, axis, -1)[..., 0]
    return np.asarray(np.where(u == 0.0, 0.0, w / np.where(u == 0.0, 1.0, u)))


def _ends(a: Array, b: Array, extent: LineKind) -> tuple[Array, Array]:
    """Least and greatest coordinates (..., 2) of a line, ray or segment."""
    low, high = np.minimum(a, b), np.maximum(a, b)
    if extent is not LineKind.SEGMENT:
        high = np.where(b > a, inf, high)
        low = np.where(b < a, -inf, low)
    if extent is LineKind.LINE:
        low, high = np.where(a == b, a, -inf), np.where(a == b, a, inf)
    return low, high

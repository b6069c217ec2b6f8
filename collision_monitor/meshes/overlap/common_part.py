"""The common part of two triangles that touch: a piece of a plane, a segment or a point, and its middle."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, along, cross, direction, dot, minus, plus, scaled
from collision_monitor.meshes.distance.triangle_pair import Corners, corner, normal


class CommonPart(NamedTuple):
    """Mean of the corners of the common part (m), and the root mean square of their distances from it (m).

    room (m): distance of the mean from the nearest edge of either, in its plane. The reach is 0, and the other numbers
    say nothing, if there is no common part.
    """

    middle: Vector
    reach: Any
    room: Any


@inlined
def normal_of(T: Corners) -> Vector:
    """Unit normal of a triangle, +z for a flat one."""
    _, n = direction(normal(T))
    return n


@inlined
def _inward(T: Corners, k: int, n: Vector) -> tuple[Vector, Vector]:
    """Corner k of a triangle, and the unit vector across the edge from it, into the triangle; n: its unit normal."""
    a = corner(T, k)
    _, side = direction(cross(n, minus(corner(T, (k + 1) % 3), a)))
    return a, side


@inlined
def _over(p: Vector, d: Vector, T: Corners, n: Vector, slack: float) -> tuple[float, float]:
    """First and last s in [0, 1] for which p + s d is over a triangle enlarged by the slack (m); none if first > last.

    n: its unit normal. (Cyrus and Beck, Generalized two- and three-dimensional clipping, 1978)
    """
    first, last = 0.0, 1.0
    for k in range(3):
        a, side = _inward(T, k, n)
        at, change = dot(minus(p, a), side) + slack, dot(d, side)
        if change > 0.0:
            first = max(first, -at / change)
        elif change < 0.0:
            last = min(last, -at / change)
        elif at < 0.0:
            last = -1.0
    return first, last


@inlined
def _is_in_plane(S: Corners, x: Vector, n: Vector, slack: float) -> bool:
    """Whether the corners of a triangle are at most the slack (m) from a plane through x with a unit normal."""
    a, b, c = dot(minus(S.a, x), n), dot(minus(S.b, x), n), dot(minus(S.c, x), n)
    return max(abs(a), max(abs(b), abs(c))) <= slack


@inlined
def is_flat(S: Corners, T: Corners, n: Vector, m: Vector, slack: float) -> bool:
    """Whether two triangles with these unit normals are in one plane, but for the slack (m)."""
    return _is_in_plane(S, T.a, m, slack) and _is_in_plane(T, S.a, n, slack)


@device
def common_part(S: Corners, T: Corners, n: Vector, m: Vector, slack: float) -> CommonPart:
    """`CommonPart` of two triangles with these unit normals that are at most the slack (m) apart.

    Its corners are where edges of one leave the other, or pass through it.
    """
    count, first_corner, total, squares = 0, S.a, (0.0, 0.0, 0.0), 0.0
    for k in range(6):
        U, V, up = (S, T, m) if k < 3 else (T, S, n)
        p = corner(U, k % 3)
        d = minus(corner(U, (k + 1) % 3), p)
        first, last = _over(p, d, V, up, slack)
        height, change = dot(minus(p, V.a), up), dot(d, up)
        if abs(height) > slack or abs(height + change) > slack:  # not along the plane
            s = min(max(-height / change, 0.0), 1.0) if change != 0.0 else 0.0
            if abs(height + s * change) > slack or s < first or s > last:
                continue
            first = last = s
        if first > last:
            continue
        for s in (first, last):
            x = along(p, s, d)
            if count == 0:
                first_corner = x
            x = minus(x, first_corner)
            count, total, squares = count + 1, plus(total, x), squares + dot(x, x)
    if count == 0:
        return CommonPart(S.a, 0.0, 0.0)
    mean = scaled(total, 1.0 / count)
    middle, room = plus(mean, first_corner), inf
    for k in range(6):
        U, up = (S, n) if k < 3 else (T, m)
        a, side = _inward(U, k % 3, up)
        room = min(room, dot(minus(middle, a), side))
    return CommonPart(middle, sqrt(max(squares / count - dot(mean, mean), 0.0)), room)

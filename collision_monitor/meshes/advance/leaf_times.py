"""Time until which the triangles of two leaves stay apart, while both move: one step of conservative advancement.

The direction between the closest points of one pair of triangles bounds the times of all 64 pairs at once, as does the
line of the centres of both boxes. The pair with the least bound is looked at next, until it has been.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from collision_monitor._jit import device
from collision_monitor._jit.lanes import Lanes, load_lanes, store
from collision_monitor.geometry.vector import Vector, cross, dot, minus, opposite
from collision_monitor.meshes.advance.approach import Approach, time_until
from collision_monitor.meshes.advance.box_times import curvature_until, times_open
from collision_monitor.meshes.boxes import Block, inner
from collision_monitor.meshes.boxes_below import is_all_above_zero
from collision_monitor.meshes.distance.leaf_bounds import least_of_pairs
from collision_monitor.meshes.distance.nearest import toward, triangle_at
from collision_monitor.meshes.distance.triangle_pair import closest_triangle_points
from collision_monitor.meshes.layout import CORNERS, RADIUS, WIDTH
from collision_monitor.meshes.placing import Placing, place_triangle, turn_back

SHARE: Final = 0.7
"""Share of the time of the best pair known that is a good enough bound. Larger: more pairs are looked at. Smaller: more
steps."""

FACTS: Final = 4
"""Rows of a leaf's triangles: largest n . x with the radius, k . x, u . x (`_extents`), and |x| (`_reaches`) over the
points x of a triangle."""

# in the scratch memory of a query, instead of the boxes that wait
_TIMES: Final = 0
_OWN: Final = _TIMES + WIDTH * WIDTH
_OTHER: Final = _OWN + FACTS * WIDTH
_REACH: Final = 3 * WIDTH


@intrinsic
def _extents(typing_context: Any, directions: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(directions, blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        numbers = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        members = Block(context, builder, signature.args[1], arguments[1], arguments[2])
        corners = [members.vector(CORNERS + 3 * i) for i in range(3)]
        for k in range(3):
            x, y, z = (inner(numbers[3 * k : 3 * k + 3], corner) for corner in corners)
            largest = x.largest(y).largest(z)
            row = largest + members.row(RADIUS) if k == 0 else largest
            store(context, builder, row, signature.args[3], arguments[3], arguments[4], WIDTH * k)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _reaches(typing_context: Any, blocks: Any, block: Any, out: Any, at: Any) -> Any:
    signature = types.void(blocks, types.int64, out, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        members = Block(context, builder, signature.args[0], arguments[0], arguments[1])
        x, y, z = (inner(corner, corner) for corner in (members.vector(CORNERS + 3 * i) for i in range(3)))
        far = x.largest(y).largest(z).root()
        store(context, builder, far, signature.args[2], arguments[2], arguments[3], _REACH)
        return context.get_dummy_value()

    return signature, codegen


@intrinsic
def _raise_times(typing_context: Any, numbers: Any, enough: Any, work: Any, other: Any, times: Any) -> Any:
    """Raise the times of eight pairs to those until which they stay apart, or to `enough` if all of them are later."""
    signature = types.void(numbers, types.float64, work, types.int64, types.int64)

    def codegen(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        fields = [Lanes.constant(builder, each) for each in cgutils.unpack_tuple(builder, arguments[0])]
        gap, speed, bent, largest, change, bend, jerk, until = fields
        enough, array = Lanes.constant(builder, arguments[1]), (signature.args[2], arguments[2])
        far, forth, curving, reach = (
            load_lanes(context, builder, *array, arguments[3], WIDTH * k) for k in range(FACTS)
        )
        curvature = curvature_until(until, largest + bend * reach, bent + curving, change + jerk * reach)
        gap, speed, known = gap - far, speed + forth, load_lanes(context, builder, *array, arguments[4])
        rest = gap - enough * (speed + enough * curvature * Lanes.constant(builder, 0.5))
        # with a curvature of at least 0, a gap that is open now and at the end of a time is open within it; NaN is not
        with builder.if_else(is_all_above_zero(gap.least(rest)), likely=True) as (open_, closing):
            with open_:
                store(context, builder, known.largest(enough), *array, arguments[4])
            with closing:  # with a root and a quotient
                store(context, builder, known.largest(times_open(gap, speed, curvature)), *array, arguments[4])
        return context.get_dummy_value()

    return signature, codegen


@device
def _raise_along(
    n: Vector,
    blocks_a: Any,
    leaf_a: int,
    blocks_b: Any,
    leaf_b: int,
    X: Placing,
    move: Approach,
    aim: float,
    enough: float,
    pair: int,
    work: Any,
) -> None:
    """Raise the times of all pairs to those until which they stay `aim` (m) apart along a direction n.

    Times later than `enough` (s), or than that of a pair that is not -1, are as good as that.
    """
    k, m = cross(n, move.w_a), cross(n, move.w_b)
    u = cross(k, move.w_a)
    _extents((n[0], n[1], n[2], k[0], k[1], k[2], u[0], u[1], u[2]), blocks_a, leaf_a, work, _OWN)
    gap = n[0] * X.x + n[1] * X.y + n[2] * X.z - move.start - aim
    d, f, u = turn_back(X, opposite(n)), turn_back(X, opposite(m)), turn_back(X, cross(move.w_b, m))
    _extents((d[0], d[1], d[2], f[0], f[1], f[2], u[0], u[1], u[2]), blocks_b, leaf_b, work, _OTHER)
    speed, bent = move.growth - dot(n, move.v), -dot(n, move.a)
    if pair >= 0:
        i, j = _OWN + pair // WIDTH, _OTHER + pair % WIDTH
        reach, other = work[i + _REACH], work[j + _REACH]
        curving = bent + work[i + 2 * WIDTH] + work[j + 2 * WIDTH]
        change = move.jerk + move.jerk_a * reach + move.jerk_b * other
        largest = move.bend + move.bend_a * reach + move.bend_b * other
        curvature = min(largest, max(curving + move.until * change / 3.0, 0.0))
        time = time_until(gap - work[i] - work[j], speed + work[i + WIDTH] + work[j + WIDTH], curvature)
        enough = min(enough, time)
    for i in range(WIDTH):
        reach = work[_OWN + _REACH + i]
        numbers = (
            gap - work[_OWN + i],
            speed + work[_OWN + WIDTH + i],
            bent + work[_OWN + 2 * WIDTH + i],
            move.bend + move.bend_a * reach,
            move.jerk + move.jerk_a * reach,
            move.bend_b,
            move.jerk_b,
            move.until,
        )
        _raise_times(numbers, enough, work, _OTHER, _TIMES + WIDTH * i)


@device
def leaf_time(
    blocks_a: Any,
    place_a: int,
    leaf_a: int,
    blocks_b: Any,
    place_b: int,
    leaf_b: int,
    X: Placing,
    move: Approach,
    tolerance: float,
    enough: float,
    pair: int,
    work: Any,
) -> tuple[float, int]:
    """Return a time until which all triangles of two leaves stay apart, and the pair that limits it.

    place_a, place_b: their boxes, WIDTH * block + member. pair: the one to look at first, -1 for none. The time is 0 if
    a pair is within the tolerance (m) beyond the wanted gap; else the advance aims at half the tolerance, unless a time
    of `enough` is certain earlier.
    """
    for k in range(WIDTH * WIDTH):
        work[_TIMES + k] = 0.0
    _reaches(blocks_a, leaf_a, work, _OWN)
    _reaches(blocks_b, leaf_b, work, _OTHER)
    seen, best, first, is_bounded = 0, inf, pair, False
    while True:  # terminates: each pair is looked at once
        if pair >= 0 and not (seen >> pair) & 1:
            seen |= 1 << pair
            i, j = pair // WIDTH, pair % WIDTH
            T = place_triangle(X, triangle_at(blocks_b, leaf_b, j))
            found = closest_triangle_points(triangle_at(blocks_a, leaf_a, i), T)
            length = sqrt(found.squared)
            gap = length - blocks_a[leaf_a, RADIUS, i] - blocks_b[leaf_b, RADIUS, j] - move.start
            if gap <= tolerance or length == 0.0:
                return 0.0, pair
            w = minus(found.on_b, found.on_a)
            n = w[0] / length, w[1] / length, w[2] / length
            _raise_along(n, blocks_a, leaf_a, blocks_b, leaf_b, X, move, 0.5 * tolerance, best, pair, work)
            if work[_TIMES + pair] < best:
                best, first = work[_TIMES + pair], pair
        elif not is_bounded:
            is_bounded = True
            n = toward(blocks_a, place_a // WIDTH, place_a % WIDTH, blocks_b, place_b // WIDTH, place_b % WIDTH, X)
            _raise_along(n, blocks_a, leaf_a, blocks_b, leaf_b, X, move, 0.5 * tolerance, best, -1, work)
        soon, pair = least_of_pairs(work, _TIMES)
        if soon >= SHARE * best or soon > enough or soon >= move.until or (seen >> pair) & 1:
            return soon, first
        if not is_bounded:
            pair = -1

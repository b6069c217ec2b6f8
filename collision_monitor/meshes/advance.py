"""A time until which two moving trees certainly stay apart, through their boxes: conservative advancement of meshes.

(Mirtich, 1996; Tang, Kim, Manocha, C2A: controlled conservative advancement for continuous collision detection, 2009)
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.meshes.approach import Approach, box_times, time_along
from collision_monitor.meshes.boxes import triangle_bounds
from collision_monitor.meshes.contact import reach_in
from collision_monitor.meshes.layout import CHILD, RADIUS, WIDTH
from collision_monitor.meshes.nearest import (
    BOUNDS,
    NEAR_A,
    NEAR_B,
    PLACE_A,
    PLACE_B,
    opens_b,
    push_nearest_last,
    triangle_at,
)
from collision_monitor.meshes.placing import Placing, inverse, place_triangle, turn_back
from collision_monitor.meshes.touching import repeats
from collision_monitor.meshes.triangle_pair import Triangle, closest_points
from collision_monitor.narrow_phase.vector import Vector, dot, minus, opposite

FAR: Final = 0.03
NEAR: Final = 0.001
"""Gaps, as parts of both reaches together, beyond which a step may be shorter than the exact search allows."""

SHARE_FAR: Final = 0.5
SHARE_NEAR: Final = 0.8
"""Shares of the best step that are enough far apart and near each other. Smaller: more steps. Larger: the first steps
of two tori of 32,768 triangles take 10 ms each instead of 10 µs."""


@device
def pair_time(
    S: Triangle, T: Triangle, radius: float, aim: float, at: Vector, move: Approach
) -> tuple[float, float, Vector]:
    """Time until which two triangles stay `aim` (m) apart; their gap (m), and its direction from S to T."""
    found = closest_points(S, T)
    w = minus(found.on_b, found.on_a)
    length = sqrt(found.squared)
    gap = length - radius - move.start
    if not (gap > aim and length > 0.0):
        return 0.0, gap, (0.0, 0.0, 0.0)
    n = w[0] / length, w[1] / length, w[2] / length
    return time_along(S, T, n, radius + aim, at, move), gap, n


@inlined
def _reversed(X: Placing, move: Approach) -> Approach:
    """The same motion from A as seen from B, in B's axes; X: pose of B in A's frame."""
    return Approach(
        opposite(turn_back(X, move.v)),
        turn_back(X, move.w_b),
        turn_back(X, move.w_a),
        move.bend_b,
        move.bend_a,
        move.bend,
        move.start,
        move.growth,
    )


@inlined
def _share(gap: float, size: float) -> float:
    """Share of the best time that is enough: pairs with a later bound are dropped. gap: of the best pair; -1: none yet.

    Far apart, very many pairs would meet at nearly the same time, and a shorter step costs less than to order them.
    """
    if gap > FAR * size:
        return SHARE_FAR
    return 1.0 if gap < NEAR * size else SHARE_NEAR


@device
def advance_trees(
    blocks_a: Any, root_a: int, blocks_b: Any, root_b: int, X: Placing, move: Approach, until: float, tolerance: float,
    answer: Any, work: Any,
) -> tuple[float, float]:
    """Return a time in (0, until] up to which two trees stay apart, and the gap of the pair that limits it (m).

    The time is 0 if a pair of triangles is within the tolerance (m) beyond the wanted gap; else the advance aims at
    half the tolerance. answer: as in `nearest`; its places are a hint, and then those of the pair that limits the time.
    """
    aim = 0.5 * tolerance
    at = X.x, X.y, X.z
    best, least, n = until, -1.0, (0.0, 0.0, 0.0)
    if answer[PLACE_A] >= 0.0:
        a, b = int(answer[PLACE_A]), int(answer[PLACE_B])
        S = triangle_at(blocks_a, a // WIDTH, a % WIDTH)
        T = place_triangle(X, triangle_at(blocks_b, b // WIDTH, b % WIDTH))
        radius = blocks_a[a // WIDTH, RADIUS, a % WIDTH] + blocks_b[b // WIDTH, RADIUS, b % WIDTH]
        time, gap, n = pair_time(S, T, radius, aim, at, move)
        if gap <= tolerance:
            return 0.0, gap
        if time < best:
            best, least = time, gap
    Y = inverse(X)
    back = _reversed(X, move)
    speed = sqrt(dot(move.v, move.v)) + sqrt(move.bend_a) * reach_in(blocks_a, root_a)
    speed += sqrt(move.bend_b) * reach_in(blocks_b, root_b) + move.growth
    curvature = move.bend + move.bend_a * reach_in(blocks_a, root_a) + move.bend_b * reach_in(blocks_b, root_b)
    size = reach_in(blocks_a, root_a) + reach_in(blocks_b, root_b)
    work[0], work[1], work[2] = 0.0, WIDTH * root_a, WIDTH * root_b
    waiting = 1
    while waiting > 0:  # terminates: each pair of boxes is opened once
        waiting -= 1
        share = _share(least, size)
        if not work[3 * waiting] < share * best:
            continue
        place_a, place_b = int(work[3 * waiting + 1]), int(work[3 * waiting + 2])
        a, i, b, j = place_a // WIDTH, place_a % WIDTH, place_b // WIDTH, place_b % WIDTH
        child_a, child_b = blocks_a[a, CHILD, i], blocks_b[b, CHILD, j]
        if child_a < 0.0 and child_b < 0.0:
            leaf_a, leaf_b = root_a - int(child_a), root_b - int(child_b)
            # pairs farther apart than this cannot meet before the best time
            soon = share * best
            limit = move.start + aim + soon * (speed + 0.5 * curvature * soon)
            limit *= limit
            triangle_bounds(blocks_a, a, i, blocks_b, leaf_b, X, work, NEAR_B)
            triangle_bounds(blocks_b, b, j, blocks_a, leaf_a, Y, work, NEAR_A)
            for m in range(WIDTH):
                if not work[NEAR_B + m] < limit or repeats(blocks_b, leaf_b, m):
                    continue
                T = place_triangle(X, triangle_at(blocks_b, leaf_b, m))
                for k in range(WIDTH):
                    if not work[NEAR_A + k] < limit or repeats(blocks_a, leaf_a, k):
                        continue
                    S = triangle_at(blocks_a, leaf_a, k)
                    radius = blocks_a[leaf_a, RADIUS, k] + blocks_b[leaf_b, RADIUS, m]
                    # along the direction of the best pair, most others prove to be later
                    if time_along(S, T, n, radius + aim, at, move) >= share * best:
                        continue
                    time, gap, direction = pair_time(S, T, radius, aim, at, move)
                    if time < best or gap <= tolerance:
                        best, least, n = time, gap, direction
                        share = _share(least, size)
                        answer[PLACE_A], answer[PLACE_B] = WIDTH * leaf_a + k, WIDTH * leaf_b + m
                        if gap <= tolerance:
                            return 0.0, gap
        elif opens_b(blocks_a, a, i, child_a, blocks_b, b, j, child_b):
            block = root_b + int(child_b)
            box_times(blocks_a, a, i, blocks_b, block, X, move, work, BOUNDS)
            waiting = push_nearest_last(blocks_b, block, work, waiting, share * best, float(place_a), True)
        else:
            block = root_a + int(child_a)
            box_times(blocks_b, b, j, blocks_a, block, Y, back, work, BOUNDS)
            waiting = push_nearest_last(blocks_a, block, work, waiting, share * best, float(place_b), False)
    return _share(least, size) * best, least

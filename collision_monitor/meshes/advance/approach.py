"""Approach of two moving trees, and the time for which a gap between them stays open.

Along a unit direction n from A to B, a point at x in a body that turns at w moves by n.(v + w x x) per second now. It
accelerates by n.(a + w x (w x x)) now, which changes by at most |w|^3 |x| per second, and by at most |a| + |w|^2 |x| at
any time. So a gap g along n that closes at most at the speed s stays open until g - s d - c d^2 / 2 = 0, where c is
either bound on the acceleration. (Mirtich, 1996; Tang, Kim, Manocha, C2A, 2009, take the second)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, opposite
from collision_monitor.meshes.placing import Placing, turn_back

STRETCH: Final = 2.0
"""Factor by which a step may exceed that with the largest acceleration of any time. Larger: the bounds on the speed and
the acceleration within the step are looser. Smaller: the step may stop short."""


class Approach(NamedTuple):
    """How two trees move now, in the axes of one of them, A. m, s, rad.

    v, a: velocity and acceleration of B's origin relative to A's. w_a, w_b: angular velocities. bend_a, bend_b: |w|^2;
    bend: largest acceleration of the origins at any time. jerk_a, jerk_b: |w|^3; jerk: largest change of the origins'
    acceleration per second. start, growth: gap that counts as contact now, and its growth per second. until: longest
    time of interest.
    """

    v: Vector
    a: Vector
    w_a: Vector
    w_b: Vector
    bend_a: Any
    bend_b: Any
    bend: Any
    jerk_a: Any
    jerk_b: Any
    jerk: Any
    start: Any
    growth: Any
    until: Any


@inlined
def time_until(gap: float, speed: float, curvature: float) -> float:
    """Largest time until which gap - speed d - curvature d^2 / 2 stays at least 0; 0 if the gap is not open."""
    if not gap > 0.0:
        return 0.0
    root = sqrt(speed * speed + 2.0 * curvature * gap)
    if speed > 0.0:
        return 2.0 * gap / (speed + root)
    return (root - speed) / curvature if curvature > 0.0 else inf


@inlined
def seen_from_b(X: Placing, move: Approach) -> Approach:
    """The motion of A relative to B, in B's axes; X: pose of B in A's frame."""
    return Approach(
        opposite(turn_back(X, move.v)),
        opposite(turn_back(X, move.a)),
        turn_back(X, move.w_b),
        turn_back(X, move.w_a),
        move.bend_b,
        move.bend_a,
        move.bend,
        move.jerk_b,
        move.jerk_a,
        move.jerk,
        move.start,
        move.growth,
        move.until,
    )

"""Samples whose outcome is foretold by the first ones, so that they need not be followed.

Bodies that just touch do so at two points. A small error of position or orientation widens their gap there in
proportion, so that one number, the widening, orders the samples from those that surely meet to those that surely miss.
In between, both outcomes occur among the samples that were followed. The bodies may miss each other on two sides, the
low one and the high one of the first coordinate, which is the error along the miss.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS

MISSES, MEETS, OPEN = 0, 1, 2
"""Outcomes that are foretold."""

SPARE: Final = 0.1
"""Standard deviations of the widening beyond those with both outcomes that count as open too; SPARE_PART of the width
of the open part comes on top. Larger: more samples are followed. Smaller: the probability is less exact."""

SPARE_PART: Final = 0.05


SIDES = np.dtype(
    [
        ("ends", np.float64, 2),  # the first coordinates between which the bodies meet
        ("turns", np.float64, (2, 3, 3)),  # rotation vectors of both bodies for unit errors of orientation (rad)
        ("widening", np.float64, (2, DIMENSIONS)),  # of the gap (m), for unit errors
        ("below", np.float64, 2),  # the bodies surely meet if the widening is below both numbers (m)
        ("above", np.float64, 2),  # they surely miss if it is above one of them (m)
        ("followed", np.float64, 2),  # weights of the samples that were followed and are foretold to miss, and to meet
        ("skipped", np.float64, 2),  # the same of those for which they stand
    ]
)
"""Where samples miss: on the low and on the high side of the first coordinate. One record, see obstacle_planes.NODE."""


@device
def find_ends(points: Any, times: Any, first: int, ends: Any) -> float:
    """Write the first coordinates (2,) between which bodies meet, from the times (S,) of the first samples.

    It is infinite on a side on which none misses. points: (S, DIMENSIONS). Returns the middle.
    """
    count = total = squares = 0.0
    for n in range(first):
        if times[n] < inf:
            z = points[n, 0]
            count, total, squares = count + 1.0, total + z, squares + z * z
    mean = total / max(count, 1.0)
    spread = sqrt(3.0 * max(squares / max(count, 1.0) - mean * mean, 0.0))  # half the length of an even distribution
    ends[0], ends[1] = -inf, inf
    for n in range(first):
        if times[n] == inf:
            if points[n, 0] < mean:
                ends[0] = mean - spread
            else:
                ends[1] = mean + spread
    return mean


@device
def set_widening(normal: Any, arms: Any, turns: Any, joint: Any, frame: Any, widening: Any) -> None:
    """Write the widening (DIMENSIONS,) for unit errors of bodies that touch.

    normal (3,): from A to B; arms (2, 3): from both origins to the points where they touch (m); turns (2, 3, 3):
    rotation vectors of both bodies for unit errors of orientation (rad); joint (6, 6): root of the covariance of the
    relative position and velocity, along the rows of frame (3, 3).
    """
    widening[:] = 0.0
    for r in range(3):
        along = frame[r, 0] * normal[0] + frame[r, 1] * normal[1] + frame[r, 2] * normal[2]
        for c in range(r + 1):
            widening[c] += along * joint[r, c]
    for body in range(2):
        x, y, z = arms[body, 0], arms[body, 1], arms[body, 2]
        u, v, w = normal[0], normal[1], normal[2]
        ax, ay, az = y * w - z * v, z * u - x * w, x * v - y * u
        sign = -1.0 if body == 0 else 1.0
        for c in range(3):
            T = turns[body]
            widening[6 + 3 * body + c] = sign * (ax * T[0, c] + ay * T[1, c] + az * T[2, c])


@inlined
def _widened(widening: Any, z: Any) -> float:
    """Widening (m) for the errors z (DIMENSIONS,)."""
    total = 0.0
    for c in range(DIMENSIONS):
        total += widening[c] * z[c]
    return total


@device
def set_limits(points: Any, times: Any, first: int, middle: float, sides: Any) -> None:
    """Set the limits of the widenings from the times (S,) of the first samples; middle: see `find_ends`."""
    for side in range(2):
        sides.below[side] = sides.above[side] = inf
        if not -inf < sides.ends[side] < inf:
            continue
        w = sides.widening[side]
        least, most = inf, -inf
        for n in range(first):
            if times[n] < inf:
                most = max(most, _widened(w, points[n]))
            elif (points[n, 0] >= middle) == (side == 1):
                least = min(least, _widened(w, points[n]))
        spread = 0.0
        for c in range(DIMENSIONS):
            spread += w[c] * w[c]
        spare = SPARE * sqrt(spread) + SPARE_PART * max(most - least, 0.0)
        sides.below[side], sides.above[side] = min(least, most) - spare, max(least, most) + spare


@inlined
def predict_outcome(sides: Any, z: Any) -> int:
    """Outcome of the sample with errors z (DIMENSIONS,): MISSES, OPEN or MEETS."""
    low, high = _widened(sides.widening[0], z), _widened(sides.widening[1], z)
    if low > sides.above[0] or high > sides.above[1]:
        return MISSES
    return MEETS if low < sides.below[0] and high < sides.below[1] else OPEN


@device
def weigh_followed(points: Any, weights: Any, first: int, sides: Any) -> None:
    """Begin the sums of the weights with those of the first samples, which are followed."""
    for outcome in range(2):
        sides.followed[outcome] = sides.skipped[outcome] = 0.0
    for n in range(first):
        outcome = predict_outcome(sides, points[n])
        if outcome != OPEN:
            sides.followed[outcome] += weights[n]


@device
def stand_for_skipped(points: Any, share: Any, first: int, sides: Any) -> None:
    """Add the weights of the samples that were skipped to the share (S,) of those that stand for them."""
    for n in range(first):
        outcome = predict_outcome(sides, points[n])
        if outcome != OPEN:
            share[n] *= 1.0 + sides.skipped[outcome] / sides.followed[outcome]

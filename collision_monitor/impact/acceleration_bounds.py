"""Intervals of impacts under declared bounds on accelerations: earliest possible and certain contact.

A body accelerates by at most a (m/s^2) and alpha (rad/s^2). Then t seconds after its last state, each of its points is
within (a + alpha r) t^2 / 2 of its stated position; r is the body's radius. Contact is impossible before the stated
gap is as small as the deviations of both bodies together. Contact is certain when the stated overlap exceeds them.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined, kernel, outlined
from collision_monitor.geometry.vector import Vector, magnitude
from collision_monitor.impact.body_impact import ShapePair, Tube, Window, contact_at, shape_impact
from collision_monitor.impact.impact_record import CLEAR, UNRESOLVED
from collision_monitor.motion.bodies import next_pair
from collision_monitor.motion.course import ARC
from collision_monitor.motion.last_state import age_of, bending_now, carry_on, twist_now
from collision_monitor.narrow_phase.contact_row import BOUND

SEGMENTS: Final = 8
"""In each segment of the time a chord bounds the deviation: too wide by at most 1 / 256 of the deviation at the end."""

CONTACT_NODES: Final = 16
"""Number of steps from the stated impact to the horizon, after each of which certain contact is tested."""


class Intervals(NamedTuple):
    """The predictions of pairs of bodies: the ends of their intervals and their statuses, changed in place."""

    pairs: Any  # (P, 2) int32: body slots
    lower: Any  # (P,) s
    upper: Any  # (P,) s
    status: Any  # (P,) PredictionStatus


@outlined
def _first_possible(
    table: Any, parts: Any, pair: ShapePair, until: float, off: Vector, query: Any, scratch: Any
) -> float:
    """Return a time in [0, until] before which two chains cannot touch; off: their deviation (m), a polynomial in t.

    pair: their motions and first slots.
    """
    A, B, first_a, first_b = pair
    first = until
    for segment in range(SEGMENTS):
        begin, end = until * segment / SEGMENTS, until * (segment + 1) / SEGMENTS
        tube = Tube(off[0] + begin * (off[1] + begin * off[2]), off[1] + (begin + end) * off[2])
        a, b = first_a, first_b
        while a >= 0:
            window = Window(begin, min(end, first))
            status, t, _, _ = shape_impact(table, parts, ShapePair(A, B, a, b), window, tube, query, scratch)
            if status != CLEAR:
                first = min(first, t)
            a, b = next_pair(parts, first_b, a, b)
        if first < end:
            break
    return first


@device
def _first_certain(multibody: Any, i: int, j: int, window: Window, off: Vector, margin: float, work: Any) -> float:
    """Return a time in the window at which the bodies touch however they accelerate; infinite: none found."""
    table, parts, bodies = multibody
    A, B = work.motion[0], work.motion[1]
    begin, end = window
    for node in range(CONTACT_NODES + 1):
        t = begin + (end - begin) * node / CONTACT_NODES
        wide = off[0] + t * (off[1] + t * off[2])
        a, first_b = bodies.first_shape[i], bodies.first_shape[j]
        b = first_b
        while a >= 0:
            distance = contact_at(table, parts, ShapePair(A, B, a, b), t, work.scratch)
            if distance + work.scratch.out[BOUND] - margin + wide <= 0.0:
                return t
            a, b = next_pair(parts, first_b, a, b)
    return inf


@device
def _bound(bodies: Any, spread: Any, i: int, horizon: float) -> float:
    """Largest acceleration of any point of body i relative to its stated motion (m/s^2), until the horizon (s).

    A body on an arc may leave it by going straight on, and one that turns harder leaves its path by v alpha t^3 / 6.
    """
    turning = spread.acceleration[i, 1]
    bound = spread.acceleration[i, 0] + (turning * bodies.spin_radius[i] if turning > 0.0 else 0.0)
    if bodies.course[i] == ARC and bound > 0.0:
        age = age_of(bodies, i, horizon)
        bound += bending_now(bodies, i, 0.0, age)
        bound += turning * magnitude(twist_now(bodies, i, 0.0).velocity) * age / 3.0
    return bound


@inlined
def _deviation(a_i: float, age_i: float, a_j: float, age_j: float) -> Vector:
    """Deviation (m) of two bodies from their stated motions, a polynomial in time (s from now).

    a: bounds on their accelerations (m/s^2); age: s since their last states.
    """
    return 0.5 * (a_i * age_i * age_i + a_j * age_j * age_j), a_i * age_i + a_j * age_j, 0.5 * (a_i + a_j)


@kernel
def widen_intervals(
    multibody: Any, spread: Any, intervals: Intervals, now: float, horizon: float, query: Any, work: Any
) -> None:
    """Widen intervals (Intervals) by the acceleration bounds that the bodies declare. horizon: s after `now`.

    That of a pair that is stated to pass is given as from the horizon on. If a body can avoid contact, the upper end
    becomes infinite and the status UNRESOLVED.
    """
    bodies = multibody.bodies
    pairs, lower, upper, status = intervals
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        a_i, a_j = _bound(bodies, spread, i, now + horizon), _bound(bodies, spread, j, now + horizon)
        if not a_i + a_j > 0.0:
            continue
        age_i = carry_on(bodies, i, now, work.quaternion, work.motion[0])
        age_j = carry_on(bodies, j, now, work.quaternion, work.motion[1])
        off = _deviation(a_i, age_i, a_j, age_j)
        chains = ShapePair(work.motion[0], work.motion[1], bodies.first_shape[i], bodies.first_shape[j])
        lower[k] = _first_possible(multibody.table, multibody.parts, chains, lower[k], off, query, work.scratch)
        if upper[k] < inf:
            end = max(horizon, upper[k])
            upper[k] = _first_certain(multibody, i, j, Window(upper[k], end), off, query.margin, work)
        if not upper[k] < inf:
            status[k] = UNRESOLVED

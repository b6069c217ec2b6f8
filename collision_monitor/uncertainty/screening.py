"""Screening of uncertain pairs: a bound on the probability of contact from one plane, in closed form.

Along one direction the gap of a pair is linear in time and normally distributed, so that two tails of the normal
distribution bound the probability that it closes. Most pairs are so far apart that no sample is needed.
"""

from __future__ import annotations

from math import inf, sqrt
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, magnitude
from collision_monitor.impact.body_impact import ImpactQuery, ShapePair, Tube, Window, shape_impact
from collision_monitor.impact.impact_record import CLEAR, HIT
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.motion.bodies import next_pair, place_shape
from collision_monitor.motion.motion import half_acceleration, most_turning, relative_position
from collision_monitor.narrow_phase.gjk import Accuracy
from collision_monitor.uncertainty.obstacle_planes import ABOUT_ALL, NO_TURNS, NOT_OFF, separation_at, set_nodes
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST
from collision_monitor.uncertainty.samples.sample_gaps import stated_gap

ROUGHLY: Final = 0.1
"""Tolerance (standard deviations) of the time from which bodies that turn may meet within FURTHEST."""

SAME_TIME: Final = 0.02
"""Fraction of the window by which two times of a design point differ at most when the search for it ends."""

DESIGN_STEPS: Final = 3
"""Largest number of separations towards a design point. The line between the origins is tried before them."""

NODES: Final = 8
"""Parts of a window at which the deviations are computed if accelerations are unknown, and also separations if bodies
turn, whose gap may be smallest at any time."""

SLACK: Final = 0.02
"""Part of the standard deviation of the surfaces by which a plane may be farther from a shape than one that touches."""

ENOUGH: Final = 0.2
"""Fraction of min_probability below which the bound along that line suffices, also of a body of several shapes."""

_FINENESS: Final = 32
"""Steps of TAIL for each standard deviation."""

TAIL: Final = np.array([NormalDist().cdf(-k / _FINENESS) for k in range(6 * _FINENESS)])
"""Probability that a normal error exceeds k / _FINENESS standard deviations."""


@inlined
def _tail(beta: float) -> float:
    """Probability, rounded up, that a normal error exceeds beta standard deviations."""
    if not beta > 0.0:
        return 1.0
    return TAIL[min(int(beta * _FINENESS), TAIL.size - 1)]


@inlined
def meeting(
    table: Any, parts: Any, pair: ShapePair, horizon: float, margin: float, tube: Tube, work: Any
) -> tuple[float, float]:
    """Interval (s) in which the bounding spheres of a pair of shapes meet within the tube; (inf, -inf): never."""
    A, B, a, b = pair
    reach = table.radius[a] + table.radius[b] + margin + tube.start
    if not reach < inf:
        return 0.0, horizon
    R_a, R_b = work.scratch.rotation[0], work.scratch.rotation[1]
    oa, ob = place_shape(table, parts, a, A.rotation, R_a), place_shape(table, parts, b, B.rotation, R_b)
    p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
    bent = half_acceleration(A, B, 0.0, horizon) * horizon
    bent += most_turning(A, 0.0, horizon) * magnitude(oa) + most_turning(B, 0.0, horizon) * magnitude(ob)
    return sphere_interval(p, (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz), reach, tube.growth + bent, horizon, 1.0)


class GapGrowth(NamedTuple):
    """How the gap of a pair may change, beside the errors of position and velocity."""

    turning: Any  # (m now, m/s): standard deviation of the surfaces from errors of orientation
    accelerations: Any  # (3,): see `acceleration_terms`
    bend: float  # m/s^2: bound on the acceleration of the surfaces, by which a gap may be smaller between two times
    # than on a straight line


@inlined
def _quadratic(block: Any, row: int, column: int, n: Vector) -> float:
    """n^T C n for the 3 x 3 block of a matrix that begins at (row, column)."""
    total = 0.0
    for r in range(3):
        for c in range(3):
            total += n[r] * block[row + r, column + c] * n[c]
    return total


@inlined
def _beta(gap: float, variance: Vector, accelerations: Vector, t: float) -> float:
    """Standard deviations between a pair and contact at time t; variance (3,): of position and velocity, by powers."""
    c, d, e = variance
    a, b, q = accelerations
    return gap / sqrt(max(c + t * (2.0 * d + t * (e + a + t * (b + t * q))), 1e-300))


@device
def _least_beta(
    gaps: Any, n: Vector, growth: GapGrowth, joint: Any, t: float, window: Window
) -> tuple[Vector, float, float]:
    """Deviations between a pair and contact along n (3,) as a function of time, when they are fewest, and a bound.

    gaps: at both ends of the window (m). growth: GapGrowth. joint (6, 6): covariance of position at time t and of
    velocity. The gap is linear in time, so that it closes in the window only if it is closed at one end: the bound is
    the sum of both probabilities. An acceleration towards the other body leaves that true, and one away from it only
    helps, so that twice the sum is a bound with accelerations.
    Returns the variance (3,) by powers of time, that time, and the bound.
    """
    turning, accelerations = growth.turning, growth.accelerations
    pp, pv, vv = _quadratic(joint, 0, 0, n), _quadratic(joint, 0, 3, n), _quadratic(joint, 3, 3, n)
    # variance c + 2 d s + e s^2
    c = pp - 2.0 * t * pv + t * t * vv + turning[0] * turning[0]
    d = pv - t * vv + turning[0] * turning[1]
    e = vv + turning[1] * turning[1]
    begin, end = window
    r = (gaps[1] - gaps[0]) / (end - begin) if end > begin else 0.0
    g = gaps[0] - r * begin
    variance, accelerates = (c, d, e), accelerations[2] > 0.0
    at_begin = _beta(gaps[0], variance, accelerations, begin)
    at_end = _beta(gaps[1], variance, accelerations, end)
    beta, when = (at_begin, begin) if at_begin < at_end else (at_end, end)
    slope = r * d - g * e
    for k in range(1, NODES if accelerates else 2):
        s = begin + k * (end - begin) / NODES if accelerates else (g * d - r * c) / slope if slope != 0.0 else begin
        if begin < s < end:
            between = _beta(g + r * s, variance, accelerations, s)
            if between < beta:
                beta, when = between, s
    times = 2.0 if turning[0] + turning[1] > 0.0 else 1.0  # a turn either way closes the gap
    times *= 2.0 if accelerates else 1.0
    return variance, when, times * (_tail(at_begin) + _tail(at_end))


@inlined
def _towards(A: Any, B: Any, t: float) -> Vector:
    """Unit vector from the origin of A to that of B at time t."""
    x, y, z = relative_position(A, B, t)
    length = sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length > 0.0 else (1.0, 0.0, 0.0)


@inlined
def _set_window(
    table: Any, parts: Any, pair: ShapePair, window: Window, bend: float, work: Any, obstacle: Any
) -> float:
    """Place the shapes of a pair at both ends of a window. Return how far a gap may bend between them (m)."""
    length = window.end - window.begin
    set_nodes(table, parts, pair, window, length, NO_TURNS, ABOUT_ALL, work.scratch, obstacle)
    return 0.125 * bend * length * length


@inlined
def _bound(
    table: Any, pair: ShapePair, n: Vector, times: Vector, growth: GapGrowth, margin: float, obstacle: Any, work: Any
) -> tuple[Vector, float, float]:
    """`_least_beta` along n (3,) in the window that is set.

    times: that of work.joint, and both ends of the window (s).
    """
    t, begin, end = times
    first = stated_gap(table, pair, n, obstacle.node[0], margin)
    last = stated_gap(table, pair, n, obstacle.node[1], margin) if begin < end else first
    return _least_beta((first, last), n, growth, work.joint, t, Window(begin, end))


@inlined
def design_point(
    multibody: Any, i: int, j: int, tube: Tube, growth: GapGrowth, sampling: Any, t: float, obstacle: Any, work: Any
) -> tuple[float, float]:
    """Return (bound, time): a bound on the probability of contact, and the time at which contact is likeliest.

    t: time of closest approach; growth: GapGrowth. Writes the direction of the gap then into work.frame[0]: the design
    point of reliability theory. The bound is that of one plane for each pair of shapes.
    work.joint: covariance of position at t and of velocity, in world axes, without accelerations from now on.
    """
    table, parts, bodies = multibody
    A, B, frame, scratch = work.motion[0], work.motion[1], work.frame, work.scratch
    margin, bend = sampling.query.margin, growth.bend
    wide = Tube(FURTHEST * tube.start, FURTHEST * tube.growth)
    bound, least, likeliest = 0.0, inf, t
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        begin, end = meeting(table, parts, pair, sampling.horizon, margin, wide, work)
        own = 0.0
        if begin <= end:
            own = 1.0
            if A.radius + B.radius < inf:
                bent = _set_window(table, parts, pair, Window(begin, end), bend, work, obstacle)
                at = min(max(t, begin), end)
                n = _towards(A, B, at)
                own = _bound(table, pair, n, (t, begin, end), growth, margin + bent, obstacle, work)[2]
        if own >= ENOUGH * sampling.min_probability:
            status = HIT
            if bend > 0.0 and begin < end:
                tolerance = max(sampling.query.tolerance, ROUGHLY * tube.start)
                roughly = ImpactQuery(margin, tolerance, sampling.query.iterations)
                there = Tube(wide.start + wide.growth * begin, wide.growth)
                status, begin, _, _ = shape_impact(table, parts, pair, Window(begin, end), there, roughly, scratch)
            if status == CLEAR or not begin <= end:
                own = 0.0
            else:
                bent = _set_window(table, parts, pair, Window(begin, end), bend, work, obstacle)
                at = min(max(t, begin), end)
                wanted = Accuracy(margin, SLACK * tube.start)
                stated = (NOT_OFF, NOT_OFF)
                scans = bend > 0.0 and growth.accelerations[2] > 0.0
                is_done = False
                for step in range(DESIGN_STEPS + (NODES if scans else 0)):
                    if step >= DESIGN_STEPS:
                        at = begin + (step - DESIGN_STEPS + 0.5) * (end - begin) / NODES
                    elif is_done:
                        continue
                    gap = separation_at(table, parts, pair, at, NOT_OFF, stated, wanted, obstacle, scratch) - margin
                    if gap <= 0.0:
                        own = 1.0
                        break
                    n = (scratch.out[0], scratch.out[1], scratch.out[2])
                    variance, when, outside = _bound(
                        table, pair, n, (t, begin, end), growth, margin + bent, obstacle, work
                    )
                    own = min(own, outside)
                    beta = _beta(gap, variance, growth.accelerations, at)
                    if beta < least:  # at `when`, another direction may keep the bodies farther apart
                        least, likeliest = beta, at
                        frame[0, 0], frame[0, 1], frame[0, 2] = n
                    is_done = abs(when - at) <= SAME_TIME * (end - begin)
                    at = when
        bound += own
        a, b = next_pair(parts, first_b, a, b)
    return bound, likeliest

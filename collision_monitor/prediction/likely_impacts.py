"""Time and probability of impact of two bodies with uncertain states, from linearised gaps.

`uncertainty.py` follows each sample as exactly as the stated motion. Here the samples meet planes that bound the
obstacle (obstacle_planes.py), which costs a few products for each plane and sample. The planes come from exact
separations at a few samples. Pairs with a mesh, with errors of orientation, or that turn fast, are left to
`uncertainty.py`. docs/uncertainty.md describes the method.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from statistics import NormalDist
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor.geometry.shape_table import SPHERE
from collision_monitor.prediction.bodies import next_pair, place_shape
from collision_monitor.prediction.body_impact import ImpactQuery, ShapePair, Tube, Window
from collision_monitor.prediction.cutting_planes import CutSettings, cut_planes
from collision_monitor.prediction.error_samples import add_covariance, orientation_spread, set_frame, take_root
from collision_monitor.prediction.impact_distribution import EARLIEST, PROBABILITY, summarise
from collision_monitor.prediction.motion import carry_on, half_acceleration
from collision_monitor.prediction.obstacle_planes import (
    AT_REST,
    GAP,
    MOST_SEGMENTS,
    RATE,
    Obstacle,
    make_obstacle,
    separation_at,
    set_nodes,
    set_plane,
)
from collision_monitor.prediction.sphere_interval import sphere_interval
from collision_monitor.prediction.spread import is_uncertain, surface_spread
from collision_monitor.prediction.straight_samples import ERRORS, enter_sphere, set_errors
from collision_monitor.prediction.time_order import sort_times
from collision_monitor.prediction.uncertainty import SAMPLE_TOLERANCE, body_has_mesh, first_contact

BENDING: Final = 0.05
"""Largest deviation of a gap from a straight line in a segment, in standard deviations of the gap."""

MOST_BENDS: Final = 4.0
"""Pairs that turn faster, so that the horizon has more parts than this, are left to the exact method."""

FACETS: Final = 0.015
"""Distance between the planes and the obstacle, in standard deviations of the gap, up to which no plane is added."""

VERIFIED_IN_PILOT: Final = 8
VERIFIED: Final = 64
"""Samples of the pilot lattice, and of all, that must need no new plane of a segment."""

FURTHEST: Final = 4.5
"""Standard deviations beyond which errors are neglected; 7 of a million are larger."""

LEFT: Final = -1.0
"""Probability of a pair that this method does not answer: errors of orientation, fast rotation, or a mesh."""

NO_ERROR: Final = (0.0, 0.0, 0.0)

SAME_TIME: Final = 0.02
"""Fraction of the window by which two times of a design point differ at most when the search for it ends."""

PILOT_PART: Final = 0.3
"""A pair of shapes that is stated to pass is left out if, in the first coarse lattice of samples, it meets with less
than this fraction of min_probability."""

_FINENESS: Final = 32
"""Steps of TAIL for each standard deviation."""

TAIL: Final = np.array([NormalDist().cdf(-k / _FINENESS) for k in range(6 * _FINENESS)])
"""Probability that a normal error exceeds k / _FINENESS standard deviations."""


@inlined
def _tail(beta):
    """Probability, rounded up, that a normal error exceeds beta standard deviations."""
    if not beta > 0.0:
        return 1.0
    return TAIL[min(int(beta * _FINENESS), TAIL.size - 1)]


@device
def _meeting(table, parts, pair, horizon, margin, tube, work):
    """Interval (s) in which the bounding spheres of a pair of shapes meet within the tube; (inf, -inf): never."""
    A, B, a, b = pair
    reach = table.radius[a] + table.radius[b] + margin + tube.start
    if not reach < inf:
        return 0.0, horizon
    R_a, R_b = work.scratch.rotation[0], work.scratch.rotation[1]
    oa, ob = place_shape(table, parts, a, A.rotation, R_a), place_shape(table, parts, b, B.rotation, R_b)
    p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
    bent = half_acceleration(A, B) * horizon
    bent += sqrt((A.wx * A.wx + A.wy * A.wy + A.wz * A.wz) * (oa[0] * oa[0] + oa[1] * oa[1] + oa[2] * oa[2]))
    bent += sqrt((B.wx * B.wx + B.wy * B.wy + B.wz * B.wz) * (ob[0] * ob[0] + ob[1] * ob[1] + ob[2] * ob[2]))
    return sphere_interval(p, (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz), reach, tube.growth + bent, horizon, 1.0)


@inlined
def _approach(A, B, horizon):
    """Time (s), from now to the horizon, at which the origins are closest."""
    px, py, pz = B.x - A.x, B.y - A.y, B.z - A.z
    vx, vy, vz = B.vx - A.vx, B.vy - A.vy, B.vz - A.vz
    vv = vx * vx + vy * vy + vz * vz
    return min(max(-(px * vx + py * vy + pz * vz) / vv, 0.0), horizon) if vv > 0.0 else 0.0


@inlined
def _quadratic(block, row, column, n):
    """n^T C n for the 3 x 3 block of a matrix that begins at (row, column)."""
    total = 0.0
    for r in range(3):
        for c in range(3):
            total += n[r] * block[row + r, column + c] * n[c]
    return total


@device
def _least_beta(plane, turning, joint, t, window):
    """Smallest number of standard deviations between a pair and contact along a plane; its time; a bound.

    turning: standard deviation of the surfaces from errors of orientation (m now, m/s). joint (6, 6): covariance of
    position at time t and of velocity. The gap is linear in time, so that it closes in the window only if it is closed
    at one end: the bound is the sum of both probabilities.
    """
    n = (plane[0], plane[1], plane[2])
    pp, pv, vv = _quadratic(joint, 0, 0, n), _quadratic(joint, 0, 3, n), _quadratic(joint, 3, 3, n)
    # variance c + 2 d s + e s^2
    c = pp - 2.0 * t * pv + t * t * vv + turning[0] * turning[0]
    d = pv - t * vv + turning[0] * turning[1]
    e = vv + turning[1] * turning[1]
    g, r = plane[GAP], plane[RATE]
    begin, end = window
    at_begin = (g + r * begin) / sqrt(max(c + begin * (2.0 * d + begin * e), 1e-300))
    at_end = (g + r * end) / sqrt(max(c + end * (2.0 * d + end * e), 1e-300))
    beta, when = (at_begin, begin) if at_begin < at_end else (at_end, end)
    slope = r * d - g * e
    if slope != 0.0:
        s = (g * d - r * c) / slope
        if begin < s < end:
            between = (g + r * s) / sqrt(max(c + s * (2.0 * d + s * e), 1e-300))
            if between < beta:
                beta, when = between, s
    both_signs = 2.0 if turning[0] + turning[1] > 0.0 else 1.0  # a turn either way closes the gap
    return beta, when, both_signs * (_tail(at_begin) + _tail(at_end))


DESIGN_STEPS: Final = 3
"""Largest number of separations towards a design point."""


@device
def _design_point(multibody, i, j, tube, turning, bend, sampling, t, obstacle, work):
    """Return (bound, time): a bound on the probability of contact, and the time at which contact is likeliest.

    t: time of closest approach. Writes the direction of the gap then into work.frame[0]: the design point of
    reliability theory. The bound is that of one plane for each pair of shapes, 1 if the gaps are not linear in time.
    work.joint: covariance of position at t and of velocity, in world axes.
    """
    table, parts, bodies = multibody
    A, B, frame, plane, scratch = work.motion[0], work.motion[1], work.frame, obstacle.planes[0, 0], work.scratch
    margin = sampling.query.margin
    wide = Tube(FURTHEST * tube.start, FURTHEST * tube.growth)
    bound, least, likeliest = 0.0, inf, t
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        window = Window(*_meeting(table, parts, pair, sampling.horizon, margin, wide, work))
        if window.begin <= window.end:
            set_nodes(table, parts, pair, window, 1, scratch, obstacle)
            at, own = min(max(t, window.begin), window.end), 1.0
            for _ in range(DESIGN_STEPS):
                if separation_at(table, parts, pair, at, NO_ERROR, obstacle, scratch) <= margin:
                    own = 1.0
                    break
                n = (scratch.out[0], scratch.out[1], scratch.out[2])
                set_plane(table, a, b, n, AT_REST, 0, at, margin, NO_ERROR, obstacle, plane)
                beta, when, outside = _least_beta(plane, turning, work.joint, t, window)
                own = min(own, outside)
                if beta < least:
                    least, likeliest = beta, when
                    frame[0, 0], frame[0, 1], frame[0, 2] = n
                if abs(when - at) <= SAME_TIME * (window.end - window.begin):
                    break
                at = when
            is_linear = bend * (window.end - window.begin) ** 2 <= 8.0 * BENDING * tube.start
            bound += own if is_linear else 1.0
        a, b = next_pair(parts, first_b, a, b)
    return bound, likeliest


@device
def _gap_covariance(multibody, spread, i, j, ages, t, sampling, work):
    """Write the covariance of relative position at t and of relative velocity, along work.frame, into work.joint."""
    bodies = multibody.bodies
    work.joint[:] = 0.0
    if not bodies.static[i]:
        add_covariance(spread, i, ages[0], t, sampling.stale_acceleration, sampling.planar, work)
    if not bodies.static[j]:
        add_covariance(spread, j, ages[1], t, sampling.stale_acceleration, sampling.planar, work)


@inlined
def _bends(A, B, length, bend, sigma):
    """Number of parts of a time of this length (s) in which the gaps are straight enough, less 1.

    bend: bound on the acceleration of the surfaces (m/s^2). A normal that turns while the bodies pass each other bends
    the gap too.
    """
    speed = sqrt((B.vx - A.vx) ** 2 + (B.vy - A.vy) ** 2 + (B.vz - A.vz) ** 2)
    return length * sqrt((bend + speed * (_rate(A) + _rate(B))) / (8.0 * BENDING * max(sigma, 1e-300)))


@device
def _enter_pair(table, parts, pair, window, bend, sigma, sampling, lattice, memory, work):
    """Lower memory.times to the samples' impacts of a pair of shapes (ShapePair) in the window.

    If the pair is stated to pass, and it hardly meets in the pilot lattice, the other samples are left out.
    """
    A, B, a, b = pair
    obstacle, off, times, weights = memory.obstacle, memory.off, memory.times, lattice.weights
    margin, size, pilot = sampling.query.margin, weights.size, lattice.pilot
    if table.kind[a] == SPHERE and table.kind[b] == SPHERE and bend == 0.0:
        R = work.scratch.rotation
        oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
        p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
        v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        reach = table.radius[a] + table.radius[b] + margin
        enter_sphere(p, v, reach, window.end, off, times)
        return
    segments = 1 + int(min(_bends(A, B, window.end - window.begin, bend, sigma), MOST_SEGMENTS - 1.0))
    set_nodes(table, parts, pair, window, segments, work.scratch, obstacle)
    tolerance, turn = max(FACETS * sigma, sampling.query.tolerance), (_rate(A) > 0.0, _rate(B) > 0.0)
    settings = CutSettings(margin, tolerance, pilot, VERIFIED_IN_PILOT, turn)
    alone = memory.alone
    for n in range(pilot):
        alone[n] = inf
    for k in range(segments):
        cut_planes(table, parts, pair, k, settings, memory, work.scratch)
    seen = 0.0
    for n in range(pilot):
        seen += weights[n] if alone[n] < inf else 0.0
    if seen * size < pilot * PILOT_PART * sampling.min_probability and not sampling.stated:
        return
    settings = CutSettings(margin, tolerance, size, VERIFIED, turn)
    for n in range(size):
        alone[n] = inf
    for k in range(segments):
        cut_planes(table, parts, pair, k, settings, memory, work.scratch)
    for n in range(size):
        times[n] = min(times[n], alone[n])


@allocating_kernel
def likely_impacts(multibody, spread, pairs, now, sampling, lattice, memory, work, answers):
    """Write times (s after `now`) and probabilities of impact of pairs (P, 2) of body slots into answers (P, 4).

    An answer is NaN if neither body has declared an uncertainty, or if the pair is stated to pass and its probability
    is below min_probability for certain. The probability is LEFT for pairs that `impact_probabilities` has to answer.
    sampling: its own samples are not used; lattice: sample_columns.
    """
    table, parts, bodies = multibody
    query, horizon, stale_acceleration = sampling.query, sampling.horizon, sampling.stale_acceleration
    weights, times, off = lattice.weights, memory.times, memory.off
    A, B = work.motion[0], work.motion[1]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        if body_has_mesh(table, parts, bodies.first_shape[i]) or body_has_mesh(table, parts, bodies.first_shape[j]):
            answers[k, PROBABILITY] = LEFT
            continue
        ages = (carry_on(bodies, i, now, work.quaternion, A), carry_on(bodies, j, now, work.quaternion, B))
        r_i, r_j = bodies.spin_radius[i], bodies.spin_radius[j]
        now_i, growth_i = surface_spread(spread, i, r_i, ages[0], horizon, stale_acceleration)
        now_j, growth_j = surface_spread(spread, j, r_j, ages[1], horizon, stale_acceleration)
        tube = Tube(now_i + now_j, growth_i + growth_j)
        bend = _bend(A, r_i) + _bend(B, r_j) + 2.0 * half_acceleration(A, B)
        t = _approach(A, B, horizon) if A.radius + B.radius < inf else 0.0
        turn_i, turn_j = orientation_spread(spread, i, r_i, ages[0], t), orientation_spread(spread, j, r_j, ages[1], t)
        far_i, far_j = r_i if r_i < inf else 0.0, r_j if r_j < inf else 0.0  # a half-space does not turn
        turning = (far_i * turn_i[0] + far_j * turn_j[0], far_i * turn_i[1] + far_j * turn_j[1])
        if not sampling.stated:
            _set_axes(work.frame)
            reach = A.radius + B.radius + query.margin + sampling.sigmas * tube.start
            growth = sampling.sigmas * tube.growth + half_acceleration(A, B) * horizon
            p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
            if reach < inf and sphere_interval(p, v, reach, growth, horizon, 1.0)[0] == inf:
                continue
            _gap_covariance(multibody, spread, i, j, ages, t, sampling, work)
            bound, t = _design_point(multibody, i, j, tube, turning, bend, sampling, t, memory.obstacle, work)
            if bound < sampling.min_probability:
                continue
        if turning[0] + turning[1] > 0.0:
            answers[k, PROBABILITY] = LEFT
            continue
        if sampling.stated:
            frame = work.frame
            frame[0, 0] = B.x - A.x + t * (B.vx - A.vx)
            frame[0, 1] = B.y - A.y + t * (B.vy - A.vy)
            frame[0, 2] = B.z - A.z + t * (B.vz - A.vz)
        set_frame(work.frame, B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        _gap_covariance(multibody, spread, i, j, ages, t, sampling, work)
        take_root(work.joint)
        _clear_upper(work.joint)
        balls = r_i == 0.0 and r_j == 0.0
        if not balls and _bends(A, B, horizon, bend, work.joint[0, 0]) > MOST_BENDS:
            answers[k, PROBABILITY] = LEFT
            continue
        set_errors(work.joint, work.frame, t, lattice.points, off)
        times[:] = inf
        wide = Tube(FURTHEST * tube.start, FURTHEST * tube.growth)
        a, first_b = bodies.first_shape[i], bodies.first_shape[j]
        b = first_b
        while a >= 0:
            pair = ShapePair(A, B, a, b)
            window = Window(*_meeting(table, parts, pair, horizon, query.margin, wide, work))
            if window.begin <= window.end:
                _enter_pair(table, parts, pair, window, bend, work.joint[0, 0], sampling, lattice, memory, work)
            a, b = next_pair(parts, first_b, a, b)
        sort_times(times, memory.order, memory.bucket, memory.ends)
        answer = answers[k]
        summarise(times, weights, memory.order, sampling.confidence, 0.0, answer)
        if answer[EARLIEST] == 0.0 and times[memory.order[0]] > 0.0:  # too few samples meet
            wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
            roughly = ImpactQuery(query.margin, max(query.tolerance, SAMPLE_TOLERANCE * tube.start), query.iterations)
            safe = first_contact(multibody, i, j, Window(0.0, horizon), wide, roughly, work)
            answer[EARLIEST] = min(safe, times[memory.order[0]])


@inlined
def _rate(m):
    """Magnitude of the angular velocity of a motion (rad/s)."""
    return sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)


@inlined
def _bend(m, radius):
    """Bound on the acceleration of a body's surface from its rotation (m/s^2)."""
    rate = _rate(m)
    return radius * rate * rate if rate > 0.0 else 0.0


@inlined
def _clear_upper(joint):
    """Set the numbers above the diagonal to 0, which `take_root` leaves."""
    for r in range(6):
        for c in range(r + 1, 6):
            joint[r, c] = 0.0


@inlined
def _set_axes(frame):
    """Set the frame (3, 3) to the world axes."""
    for r in range(3):
        for c in range(3):
            frame[r, c] = 1.0 if r == c else 0.0


class PlaneMemory(NamedTuple):
    """Scratch memory of one thread for S samples."""

    obstacle: Obstacle
    off: Any  # (ERRORS, S)
    times: Any  # (S,): s
    alone: Any  # (S,): those of one pair of shapes
    entry: Any  # (S,)
    leave: Any  # (S,)
    checked: Any  # (S,)
    trial: Any  # (2, S)
    order: Any  # (S,) int64
    bucket: Any  # (S,) int64
    ends: Any  # (S + 1,) int64


def make_plane_memory(samples: int) -> PlaneMemory:
    """Make the scratch memory of one thread."""
    def numbers() -> NDArray[np.float64]:
        return np.zeros(samples)

    def integers(count: int) -> NDArray[np.int64]:
        return np.zeros(count, np.int64)

    return PlaneMemory(
        obstacle=make_obstacle(),
        off=np.zeros((ERRORS, samples)),
        times=numbers(),
        alone=numbers(),
        entry=numbers(),
        leave=numbers(),
        checked=numbers(),
        trial=np.zeros((2, samples)),
        order=integers(samples),
        bucket=integers(samples),
        ends=integers(samples + 1),
    )

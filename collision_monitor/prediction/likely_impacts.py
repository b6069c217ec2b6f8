"""Time and probability of impact of two bodies with uncertain states, from planes that bound the obstacle.

`uncertainty.py` follows each sample as exactly as the stated motion. Here the samples meet planes
(obstacle_planes.py), which costs a few products for each plane and sample. The planes come from exact separations at a
few samples. Pairs with a mesh, or that turn very fast, are left to `uncertainty.py`. docs/uncertainty.md describes the
method.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor.geometry.shape_table import CYLINDER, HALF_SPACE, SPHERE
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.prediction.bodies import next_pair, place_shape
from collision_monitor.prediction.body_impact import ImpactQuery, ShapePair, Tube, Window, shape_impact
from collision_monitor.prediction.cutting_planes import CutSettings, carry_planes, cut_planes
from collision_monitor.prediction.error_samples import add_covariance, orientation_spread, set_frame, take_root
from collision_monitor.prediction.impact_distribution import EARLIEST, MOST_LIKELY, PROBABILITY, summarise
from collision_monitor.prediction.impact_record import CLEAR
from collision_monitor.prediction.motion import carry_on, half_acceleration
from collision_monitor.prediction.obstacle_planes import Obstacle, make_obstacle, set_nodes
from collision_monitor.prediction.sample_gaps import (
    FIRST_ORDER,
    NOT_TURNED,
    SERIES,
    TURNED_FARTHEST,
    SampleRows,
    make_sample_rows,
)
from collision_monitor.prediction.screening import FURTHEST, design_point, meeting
from collision_monitor.prediction.sphere_interval import sphere_interval
from collision_monitor.prediction.spread import is_uncertain, surface_spread
from collision_monitor.prediction.straight_samples import ERRORS, enter_cylinder, enter_sphere, set_errors
from collision_monitor.prediction.time_order import sort_times
from collision_monitor.prediction.uncertainty import SAMPLE_TOLERANCE, body_has_mesh, first_contact

BENDING: Final = 0.1
"""Largest deviation of a gap from a straight line in a segment, in standard deviations of the gap."""

FACETS: Final = 0.015
"""Distance between the planes and the obstacle, in standard deviations of the gap, up to which no plane is added."""

TURNED: Final = 2.0
"""Standard deviations of the errors of angular velocity for which gaps are that straight."""

FACETS_IN_PILOT: Final = 0.06
"""The same for the pilot lattice, which decides how many samples a pair needs."""

MOST_PARTS: Final = 2
SMALL: Final = 0.05
"""If bodies that turn divide the time into more than MOST_PARTS, and errors exceed SMALL rad, or twice SMALL radii of a
shape, the pair is left to the exact method unless it surely meets: it needs so many planes that it is no faster."""

SPINS: Final = 4.0
"""Standard deviations of the angular velocity above which a body counts as one that turns."""

VERIFIED_IN_PILOT: Final = 6
VERIFIED: Final = 48
"""Samples of the pilot lattice, and of all, that must need no new plane of a segment."""

SURE_SAMPLES: Final = 256
"""Number of samples of a pair that meets in all samples of the pilot lattice: they differ only in their times."""

LATER: Final = 0.5
"""Part of the range of the pilot's times after the last one until which such a pair is followed."""

LEFT: Final = -1.0
"""Probability of a pair that this method does not answer: very fast rotation, large errors of orientation, a mesh."""

PILOT_PART: Final = 0.3
"""A pair of shapes that is stated to pass is left out if, in the first coarse lattice of samples, it meets with less
than this fraction of min_probability."""


@inlined
def _approach(A, B, horizon):
    """Time (s), from now to the horizon, at which the origins are closest."""
    px, py, pz = B.x - A.x, B.y - A.y, B.z - A.z
    vx, vy, vz = B.vx - A.vx, B.vy - A.vy, B.vz - A.vz
    vv = vx * vx + vy * vy + vz * vz
    return min(max(-(px * vx + py * vy + pz * vz) / vv, 0.0), horizon) if vv > 0.0 else 0.0


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
def _part_length(A, B, errors):
    """Length (s) of a part of the time in which the gaps are straight enough.

    A normal that turns while the bodies pass each other bends the gap like an acceleration of the surfaces.
    """
    speed = sqrt((B.vx - A.vx) ** 2 + (B.vy - A.vy) ** 2 + (B.vz - A.vz) ** 2)
    rate = _rate(A) + _rate(B) + TURNED * (errors.turning[0][1] + errors.turning[1][1])
    bend = errors.bend + speed * rate
    return sqrt(8.0 * BENDING * max(errors.sigma, 1e-300) / bend) if bend > 0.0 else inf


class PairErrors(NamedTuple):
    """Uncertainty of a pair of bodies."""

    tube: Any  # Tube: bound on the standard deviation of their surfaces
    turning: Any  # ((rad, rad/s), (rad, rad/s)): errors of their orientations
    bend: float  # m/s^2: bound on the acceleration of their surfaces
    sigma: float  # m: standard deviation of the gap
    time: float  # s: of the likeliest contact
    radius: Any  # (m, m): of the bodies


@inlined
def _turned_at(errors, body):
    """Standard deviation of the orientation of a body at the time of the likeliest contact (rad)."""
    return errors.turning[body][0] + errors.turning[body][1] * errors.time


@inlined
def _order(errors, body, tolerance):
    """How errors of orientation turn a body: the second order counts if it moves the surface by the tolerance (m)."""
    off = _turned_at(errors, body)
    if off == 0.0:
        return NOT_TURNED
    return FIRST_ORDER if 0.5 * errors.radius[body] * (TURNED * off) ** 2 < tolerance else SERIES


@device
def _lay_planes(table, parts, pair, errors, until, sampling, lattice, memory, work):
    """Bound the obstacle of a pair of shapes (ShapePair) by planes where the pilot's samples need them, until `until`.

    Writes the times of the pilot's samples into memory.alone, infinite for the others. Returns (number of segments,
    settings of the cuts, whether the segments reach the end).
    """
    A, B, a, b = pair
    scratch, alone, sigma = work.scratch, memory.alone, errors.sigma
    margin, size, pilot = sampling.query.margin, lattice.weights.size, lattice.pilot
    tolerance = max(FACETS_IN_PILOT * sigma, sampling.query.tolerance)
    fine = max(FACETS * sigma, sampling.query.tolerance)
    turning = (_order(errors, 0, fine), _order(errors, 1, fine))
    flat = table.kind[a] == HALF_SPACE or table.kind[b] == HALF_SPACE
    follows = (not flat and turning[0] + _rate(A) > 0.0, not flat and turning[1] + _rate(B) > 0.0)
    settings = CutSettings(margin, tolerance, pilot, follows, turning)
    for n in range(size):
        alone[n] = inf
    wide = Tube(FURTHEST * errors.tube.start, FURTHEST * errors.tube.growth)
    begin, end = meeting(table, parts, pair, sampling.horizon, margin, wide, work)
    end = min(end, until)
    if not begin < end:
        return 0, settings, True
    length = _part_length(A, B, errors)
    if length < end - begin:
        coarse = max(sampling.query.tolerance, SAMPLE_TOLERANCE * sigma)
        roughly = ImpactQuery(margin, coarse, sampling.query.iterations)
        there = Tube(wide.start + wide.growth * begin, wide.growth)
        status, begin, _, _ = shape_impact(table, parts, pair, Window(begin, end), there, roughly, scratch)
        if status == CLEAR or not begin < end:
            return 0, settings, True
    length = (end - begin) / (1.0 + np.floor((end - begin) / length))
    window = Window(begin, end)
    segments = set_nodes(
        table, parts, pair, window, length, errors.turning, sampling.planar, scratch, memory.obstacle
    )
    turned = max(_turned_at(errors, 0), _turned_at(errors, 1))
    large = TURNED * turned > SMALL or sigma > 2.0 * SMALL * min(table.radius[a], table.radius[b])
    spins = _rate(A) + _rate(B) > SPINS * (errors.turning[0][1] + errors.turning[1][1])
    is_rough = segments > MOST_PARTS and large and spins
    if is_rough and not sampling.stated:
        return segments, settings, False
    left = pilot
    for k in range(segments):
        left = cut_planes(table, parts, pair, k, pilot, VERIFIED_IN_PILOT, settings, memory, lattice.points, scratch)
        if left == 0:
            break
        if k + 1 < segments:
            carry_planes(table, pair, k, settings, memory)
    return segments, settings, left == 0 or (memory.obstacle.node[segments].time >= end and not is_rough)


@device
def _enter_pair(table, parts, pair, laid, samples, wanted, tolerance, lattice, memory, work):
    """Lower memory.times to the impacts of the first `samples` with the planes of `_lay_planes`, and some more.

    laid: what it returned; wanted: number of samples that must need no more planes; tolerance (m): see CutSettings.
    """
    segments, pilots, _ = laid
    settings = CutSettings(pilots.margin, tolerance, pilots.pilot, pilots.follows, pilots.turning)
    alone, times = memory.alone, memory.times
    for n in range(samples):
        alone[n] = inf
    each = max(VERIFIED_IN_PILOT, wanted // max(segments - 3, 1)) if wanted > 0 else 0
    for k in range(segments):
        left = cut_planes(table, parts, pair, k, samples, each, settings, memory, lattice.points, work.scratch)
        if left == 0:
            break
    for n in range(samples):
        times[n] = min(times[n], alone[n])


@device
def _are_round(table, parts, pair, errors, margin, work):
    """Whether the closed form of round bodies holds: two balls, or two parallel cylinders, that move straight."""
    A, B, a, b = pair
    turning = errors.turning
    if errors.bend > 0.0 or turning[0][0] + turning[0][1] + turning[1][0] + turning[1][1] > 0.0:
        return False
    if table.kind[a] == SPHERE and table.kind[b] == SPHERE:
        return True
    if not (table.kind[a] == table.kind[b] == CYLINDER) or table.margin[a] + table.margin[b] + margin > 0.0:
        return False
    R_a, R_b = work.scratch.rotation[0], work.scratch.rotation[1]
    place_shape(table, parts, a, A.rotation, R_a)
    place_shape(table, parts, b, B.rotation, R_b)
    return is_parallel(table, a, PairPose(R_a, R_b, (0.0, 0.0, 0.0)))


@device
def _enter_round(table, parts, pair, end, margin, memory, work):
    """Lower memory.times to the samples' impacts of two balls or two parallel cylinders that move straight."""
    A, B, a, b = pair
    R = work.scratch.rotation
    oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    if table.kind[a] == SPHERE:
        enter_sphere(p, v, table.radius[a] + table.radius[b] + margin, end, memory.off, memory.times)
        return
    axis, size = (R[1, 0, 2], R[1, 1, 2], R[1, 2, 2]), table.size
    half = size[a, 1] + size[b, 1]
    enter_cylinder(p, v, axis, size[a, 0] + size[b, 0], half, end, memory.off, memory.times)


@allocating_kernel
def likely_impacts(multibody, spread, pairs, now, sampling, lattice, memory, work, answers):
    """Write times (s after `now`) and probabilities of impact of pairs (P, 2) of body slots into answers (P, 4).

    An answer is NaN if neither body has declared an uncertainty, or if the pair is stated to pass and its probability
    is below min_probability for certain. The probability is LEFT for pairs that `impact_probabilities` has to answer.
    sampling: its own samples are not used; lattice: sample_columns.
    sampling.only_screens: for pairs that are stated to pass, write a time before which the probability of contact is
    less than min_probability, the likeliest time of contact, and a bound on its probability, LEFT if unknown.
    """
    table, parts, bodies = multibody
    query, horizon, stale_acceleration = sampling.query, sampling.horizon, sampling.stale_acceleration
    weights, times = lattice.weights, memory.times
    A, B = work.motion[0], work.motion[1]
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        has_mesh = body_has_mesh(table, parts, bodies.first_shape[i])
        has_mesh |= body_has_mesh(table, parts, bodies.first_shape[j])
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
        flat = not (r_i < inf and r_j < inf)
        if not sampling.stated:
            _set_axes(work.frame)
            reach = A.radius + B.radius + query.margin + sampling.sigmas * tube.start
            growth = sampling.sigmas * tube.growth + half_acceleration(A, B) * horizon
            p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
            first = sphere_interval(p, v, reach, growth, horizon, 1.0)[0] if reach < inf else 0.0
            if first == inf:
                continue
            answer = answers[k]
            answer[EARLIEST], answer[MOST_LIKELY], answer[PROBABILITY] = first, first, LEFT
            if has_mesh:
                continue
            _gap_covariance(multibody, spread, i, j, ages, t, sampling, work)
            bound, t = design_point(multibody, i, j, tube, turning, bend, sampling, t, memory.obstacle, work)
            if bound < sampling.min_probability:
                answer[:] = nan
                continue
            if sampling.only_screens:
                answer[MOST_LIKELY], answer[PROBABILITY] = t, min(bound, 1.0)
                continue
            answer[:] = nan
        most = max(turn_i[0] + turn_i[1] * t, turn_j[0] + turn_j[1] * t)
        if has_mesh or most > TURNED_FARTHEST or (flat and most > 0.0):
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
        set_errors(work.joint, work.frame, t, lattice.points, memory.off)
        errors = PairErrors(tube, (turn_i, turn_j), bend, work.joint[0, 0], t, (far_i, far_j))
        samples = _enter_bodies(multibody, i, j, errors, sampling, lattice, memory, work)
        if samples < 0:
            answers[k, PROBABILITY] = LEFT
            continue
        if samples == 0:
            continue
        order, answer = memory.order[0:samples], answers[k]
        sort_times(times[0:samples], order, memory.bucket[0:samples], memory.ends[0 : samples + 1])
        part = 0.0
        for n in range(samples):
            part += weights[n]
        summarise(times[0:samples], weights[0:samples], order, sampling.confidence, 0.0, answer, part)
        if answer[EARLIEST] == 0.0 and times[order[0]] > 0.0:  # too few samples meet
            wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
            roughly = ImpactQuery(query.margin, max(query.tolerance, SAMPLE_TOLERANCE * tube.start), query.iterations)
            safe = first_contact(multibody, i, j, Window(0.0, horizon), wide, roughly, work)
            answer[EARLIEST] = min(safe, times[order[0]])


@device
def _enter_bodies(multibody, i, j, errors, sampling, lattice, memory, work):
    """Write the times of the samples' impacts of bodies i and j into memory.times. Return the number of samples.

    0: the bodies are stated to pass, and hardly meet in the pilot lattice. -1: they turn too fast.
    Bodies that meet in all samples of the pilot need few samples: only their times differ.
    """
    table, parts, bodies = multibody
    A, B = work.motion[0], work.motion[1]
    times, alone, weights, pilot = memory.times, memory.alone, lattice.weights, lattice.pilot
    size = weights.size
    margin = sampling.query.margin
    first_a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    single = parts.next[first_a] < 0 and parts.next[first_b] < 0
    for n in range(size):
        times[n] = inf
    if single and _are_round(table, parts, ShapePair(A, B, first_a, first_b), errors, margin, work):
        _enter_round(table, parts, ShapePair(A, B, first_a, first_b), sampling.horizon, margin, memory, work)
        return size
    a, b = first_a, first_b
    laid = _lay_planes(
        table, parts, ShapePair(A, B, a, b), errors, sampling.horizon, sampling, lattice, memory, work
    )
    reaches = laid[2]
    while True:
        for n in range(pilot):
            times[n] = min(times[n], alone[n])
        a, b = next_pair(parts, first_b, a, b)
        if a < 0 or not reaches:
            break
        laid = _lay_planes(
            table, parts, ShapePair(A, B, a, b), errors, sampling.horizon, sampling, lattice, memory, work
        )
        reaches = laid[2]
    latest = seen = part = 0.0
    for n in range(pilot):
        latest = max(latest, times[n])
        seen += weights[n] if times[n] < inf else 0.0
        part += weights[n]
    if not reaches:
        return -1
    if seen < part * PILOT_PART * sampling.min_probability and not sampling.stated:
        return 0
    is_sure = latest < inf
    samples, wanted = (min(SURE_SAMPLES, size), 0) if is_sure else (size, VERIFIED)
    tolerance = max((FACETS_IN_PILOT if is_sure else FACETS) * errors.sigma, sampling.query.tolerance)
    until = min(sampling.horizon, latest + LATER * (latest - _least(times, pilot))) if is_sure else sampling.horizon
    for n in range(size):
        times[n] = inf
    a, b = first_a, first_b
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        if not single:
            laid = _lay_planes(table, parts, pair, errors, until, sampling, lattice, memory, work)
        _enter_pair(table, parts, pair, laid, samples, wanted, tolerance, lattice, memory, work)
        a, b = next_pair(parts, first_b, a, b)
    return samples


@inlined
def _least(times, count):
    """Smallest of the first `count` times."""
    least = inf
    for n in range(count):
        least = min(least, times[n])
    return least


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
    rows: SampleRows
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
        rows=make_sample_rows(samples),
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

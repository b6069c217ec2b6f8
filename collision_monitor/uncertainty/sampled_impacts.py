"""Time and probability of impact of two bodies with uncertain states: earliest, most likely and latest time.

The relative motion is the stated one, off by a straight line whose start and velocity are normally distributed
(spread.py). Evenly spread samples of it, each followed exactly, give the distribution of the time of impact
(docs/uncertainty.md). The coordinates of the samples are ordered by importance. First comes the error of the position
at the time of closest approach, which decides whether the bodies meet, and of it the part across the path. The
remaining error of the velocity comes after it.
"""

from __future__ import annotations

from math import inf, nan, sqrt
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import allocating_kernel, device, inlined, kernel
from collision_monitor.geometry.vector import Vector
from collision_monitor.impact.body_impact import (
    ImpactQuery,
    ShapePair,
    Tube,
    Window,
    contact_at,
    shape_impact,
)
from collision_monitor.impact.impact_record import CLEAR
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.impact.tree_impact import spins
from collision_monitor.motion.bodies import next_pair
from collision_monitor.motion.last_state import carry_on
from collision_monitor.motion.motion import are_straight, half_acceleration, relative_position
from collision_monitor.narrow_phase.contact_row import NORMAL, POINT_A, POINT_B
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import POINTS
from collision_monitor.uncertainty.impact_distribution import summarise
from collision_monitor.uncertainty.obstacle_planes import NOT_OFF
from collision_monitor.uncertainty.pair_errors import closest_time, spin_rate, way_at
from collision_monitor.uncertainty.samples.chosen_samples import open_ranks
from collision_monitor.uncertainty.samples.error_samples import (
    LEFT_OVER,
    ORIENTATION,
    add_covariance,
    errors_turn,
    orientation_spread,
    set_frame,
    set_turn,
    shift,
    take_root,
    turn,
)
from collision_monitor.uncertainty.samples.known_axes import parted_until, remember
from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS, PILOT, pilot_of
from collision_monitor.uncertainty.samples.skipped_samples import (
    OPEN,
    find_ends,
    predict_outcome,
    set_limits,
    set_widening,
    stand_for_skipped,
    weigh_followed,
)
from collision_monitor.uncertainty.spread import (
    accelerates,
    is_uncertain,
    surface_spread,
    swing_radius,
    turns_by_yaw,
)

GAP_NODES: Final = 9
"""Number of times from now to the horizon at which the gap is compared with its uncertainty."""

SAMPLE_TOLERANCE: Final = 0.05
"""Tolerance of a sample's impact in standard deviations of the gap; it changes the probability by 0.004."""

MESH_TOLERANCE: Final = 0.015
"""The same with a mesh: a sample within the tolerance meets it, while other shapes are sought at half of it inside."""

NEAR: Final = 0.25
"""Largest tolerance of a sample's impact as a part of the gap now. Larger: bodies that are near each other now, and
part, count as touching."""

BISECTIONS: Final = 8
"""Steps towards the time of the stated contact."""

FAR: Final = 15.0
SPINNING_ITERATIONS: Final = 512
"""Iterations at least for a sample of convex bodies that spin by more than FAR (rad). Of a box that spins at 10 rad/s
for 5 s beside a floor, 64 reach a time before the impact, which counts as one. So such pairs have few samples."""

FARTHEST: Final = 100.0
"""rad within the horizon. Bodies that spin farther get SEARCH_ITERATIONS: at 168 rad, SPINNING_ITERATIONS took
97 ms for a step of 14 bodies. Larger: such pairs take longer. Smaller: more samples count as impacts too early."""

SEARCH_ITERATIONS: Final = 8
"""Iterations of the search for a sample's impact with one mesh: 4,000 boxes or 1.2 ms. Ordinary ones take a tenth. Each
sample of a disc of 100 km that turns beside a mesh took 20 ms. The same for bodies that turn too far for any search,
see `spins`: SPINNING_ITERATIONS took 75 ms for a step of a dozen bodies."""

PILOT_PART: Final = 0.2
"""A pair that is stated to pass is left out if it meets with less than this fraction of min_probability in the first
part of the samples. The test is repeated after each further one."""


COSTLY_PARTS: Final = 8
"""A pair with a mesh has the number of samples divided by this: each takes as long as a hundred of convex shapes."""

SPINNING_PARTS: Final = 4
"""The same for two bodies that together spin by more than FAR. Larger: the probability is less exact. Smaller: slower,
because each sample needs up to SPINNING_ITERATIONS."""

FEW_PARTS: Final = 4
"""Parts of so few samples. The samples of the first part decide which samples of the others are needed."""

FEWEST_FORETOLD: Final = 4
"""Parts of the samples, of about PILOT each, from which on two of them foretell the outcome of others."""

FEW_SPARE: Final = 5
"""SPARE of these, see chosen_samples.py."""


@device
def first_contact(multibody: Any, i: int, j: int, window: Window, tube: Tube, query: ImpactQuery, work: Any) -> float:
    """First time in the window at which bodies i and j are within query.margin and the tube; infinite: never.

    They move as in work.motion. Time 0 of the motions and of the tube is now.
    """
    table, parts, bodies = multibody
    A, B = work.motion[0], work.motion[1]
    begin, end = window
    first, last = begin, end
    reach = A.radius + B.radius + query.margin + tube.start
    if reach < inf:
        p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
        bent = half_acceleration(A, B, 0.0, end) * end
        first, last = sphere_interval(p, v, reach, tube.growth + bent, end, 1.0)
        if bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0 and bent == 0.0:  # single spheres
            return first
        first = max(first, begin)
        if first > last:
            return inf
    best = inf
    there = Tube(tube.start + tube.growth * first, tube.growth)
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(A, B, a, b)
        status, t, _, _ = shape_impact(table, parts, pair, Window(first, last), there, query, work.scratch)
        if status != CLEAR:
            best = last = t
        a, b = next_pair(parts, first_b, a, b)
    return best


@device
def gap_at(multibody: Any, i: int, j: int, t: float, work: Any) -> float:
    """Signed distance (m) of the shapes of bodies i and j at t.

    Writes its direction into work.block[0], and the points where they touch, about both origins, into work.block[1:3].
    """
    table, parts, bodies = multibody
    A, B, out, block = work.motion[0], work.motion[1], work.scratch.out, work.block
    origin = relative_position(A, B, t)
    best = inf
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        gap = contact_at(table, parts, ShapePair(A, B, a, b), t, work.scratch)
        if gap < best:
            best = gap
            for c in range(3):
                block[0, c] = out[NORMAL + c]
                block[1, c], block[2, c] = out[POINT_A + c], out[POINT_B + c] - origin[c]
        a, b = next_pair(parts, first_b, a, b)
    return best


@device
def likely_contact(multibody: Any, i: int, j: int, t: float, horizon: float, query: ImpactQuery, work: Any) -> float:
    """Time (s) from t on at which bodies i and j, which are stated to meet, do so if they are apart at t, else t.

    t: closest approach of their origins. The origin of a long wall may be closest long before it is touched.
    """
    gap = gap_at(multibody, i, j, t, work)
    if gap <= query.margin:
        return t
    first = first_contact(multibody, i, j, Window(t, horizon), Tube(0.0, 0.0), query, work)
    if first < inf:
        return first
    return horizon if gap_at(multibody, i, j, horizon, work) < gap else t


@inlined
def _is_straight(parts: Any, bodies: Any, i: int, j: int, A: Any, B: Any) -> bool:
    """Whether each body is one shape that moves straight and does not turn, and they are not both spheres."""
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    bends = A.wx != 0.0 or A.wy != 0.0 or A.wz != 0.0 or B.wx != 0.0 or B.wy != 0.0 or B.wz != 0.0
    round = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    bends = bends or not are_straight(A, B) or half_acceleration(A, B, 0.0, 1.0) > 0.0
    return not bends and not round and parts.next[a] < 0 and parts.next[b] < 0


@inlined
def body_has_mesh(table: Any, parts: Any, shape: int) -> bool:
    """Whether one of a body's shapes, from its first on, is a mesh or a cloud."""
    found = False
    while shape >= 0:
        found |= table.kind[shape] == MESH or table.kind[shape] == POINTS
        shape = parts.next[shape]
    return found


@inlined
def pair_has_mesh(table: Any, parts: Any, bodies: Any, i: int, j: int) -> bool:
    """Whether body i or body j has a mesh or a cloud."""
    first = bodies.first_shape
    return body_has_mesh(table, parts, first[i]) or body_has_mesh(table, parts, first[j])


@kernel
def find_divisors(multibody: Any, pairs: Any, horizon: float, divisors: Any) -> None:
    """Write the number by which the samples of each pair (P, 2) are divided to divisors (P,).

    COSTLY_PARTS for a body with a mesh or a cloud, or one that turns too far for any search within the horizon (s);
    SPINNING_PARTS for two bodies that spin far; else 1.
    """
    table, parts, bodies = multibody
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        A, B = bodies.motion[i], bodies.motion[j]
        is_costly = spins(A, B, horizon) or pair_has_mesh(table, parts, bodies, i, j)
        divisors[k] = COSTLY_PARTS if is_costly else (SPINNING_PARTS if spins_far(A, B, horizon) else 1)


@device
def _lay_along(multibody: Any, i: int, j: int, tube: Tube, sampling: Sampling, work: Any) -> float:
    """Return the time that matters most, and write the frame along which to lay the samples into work.frame.

    For bodies that are stated to meet, or two spheres: the closest approach of the centres, and the miss across the
    path. Otherwise, and with a half-space: the time and direction of the gap that is smallest in standard deviations,
    which is the design point of reliability theory.
    """
    bodies, horizon = multibody.bodies, sampling.horizon
    A, B, frame, normal = work.motion[0], work.motion[1], work.frame, work.block[0]
    round = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    t = 0.0
    if (sampling.stated or round) and A.radius + B.radius < inf:
        t = closest_time(A, B, horizon)
        if sampling.stated and not round:
            t = likely_contact(multibody, i, j, t, horizon, sampling.query, work)
        frame[0, 0], frame[0, 1], frame[0, 2] = way_at(A, B, t)[0]
    else:
        least = inf
        for node in range(GAP_NODES):
            at = horizon * node / (GAP_NODES - 1)
            gap = gap_at(multibody, i, j, at, work)
            beta = (gap - sampling.query.margin) / max(tube.start + at * tube.growth, 1e-300)
            if beta < least:
                t, least = at, beta
                frame[0, 0], frame[0, 1], frame[0, 2] = normal[0], normal[1], normal[2]
    set_frame(frame, *way_at(A, B, t)[1])
    return t


@device
def _least_tolerance(multibody: Any, i: int, j: int, turning: Any, t: float, margin: float, work: Any) -> float:
    """Tolerance (m) of the samples' impacts that suffices now, when errors may still be small; infinite for overlaps.

    The larger one of NEAR of the gap now and twice SAMPLE_TOLERANCE of its standard deviation along the first axis of
    work.frame. work.joint: root of the covariance of position at t and of velocity.
    """
    bodies, L = multibody.bodies, work.joint
    gap = gap_at(multibody, i, j, 0.0, work) - margin
    if gap <= 0.0:
        return inf
    variance = (L[0, 0] - t * L[3, 0]) ** 2 + t * t * (L[3, 1] ** 2 + L[3, 2] ** 2 + L[3, 3] ** 2)
    for side in range(2):
        off, radius = turning[side], bodies.spin_radius[i if side == 0 else j]
        if errors_turn(off):
            variance += (radius * radius) * (off[0] * off[0] + off[2] * off[2])
    return max(NEAR * gap, 2.0 * SAMPLE_TOLERANCE * sqrt(variance))


@device
def right_time(multibody: Any, spread: Any, i: int, j: int, t: float, sampling: Sampling, work: Any) -> float:
    """Time (s) at which unknown accelerations are right: that of the stated first contact, t, or the horizon if t is 0.

    Bodies touch where they meet first, and their origins may be closest long after that. t if there are none.
    """
    if not (accelerates(spread, i) or accelerates(spread, j)):
        return t
    if not (sampling.stated and t > 0.0):
        return t if t > 0.0 else sampling.horizon
    before, first = 0.0, t
    for _ in range(BISECTIONS):
        middle = 0.5 * (before + first)
        if gap_at(multibody, i, j, middle, work) > sampling.query.margin:
            before = middle
        else:
            first = middle
    return first


@inlined
def spins_far(A: Any, B: Any, horizon: float) -> bool:
    """Whether two bodies spin by more than FAR within the horizon (s)."""
    return (spin_rate(A) + spin_rate(B)) * horizon > FAR


@device
def _set_unit_turns(t: float, turning: Any, yaw_only: Any, work: Any, sides: Any) -> None:
    """Write the rotation vectors of both bodies at time t for unit errors of orientation at t into sides.turns."""
    for side in range(2):
        for r in range(3):
            for c in range(3):
                sides.turns[side, r, c] = 0.0
        off = turning[side]
        set_turn(work.motion[side], t, (off[0], off[1]), yaw_only[side], sides.turns[side])


@device
def _set_mirror(multibody: Any, i: int, j: int, t: float, turning: Any, yaw_only: Any, work: Any, sides: Any) -> None:
    """Write the vector that mirrors the first coordinate onto the errors that narrow the gap at time t most.

    sides.widening[0] becomes a unit vector, see `_mirrored`, or 0 if it is the first coordinate already. With few
    samples, the probability is only as good as the first coordinate decides it; errors of orientation may decide alone.
    """
    block, mirror = work.block, sides.widening[0]
    _set_unit_turns(t, turning, yaw_only, work, sides)
    gap_at(multibody, i, j, t, work)
    set_widening(block[0], block[1:3], sides.turns, work.joint, work.frame, mirror)
    length = _length(mirror)
    for c in range(DIMENSIONS):
        mirror[c] = -mirror[c] / length if length > 0.0 else 0.0
    mirror[0] += 1.0 if length > 0.0 else 0.0
    length = _length(mirror)
    for c in range(DIMENSIONS):
        mirror[c] = mirror[c] / length if length > 1e-6 else 0.0


@device
def _length(v: Any) -> float:
    """Length of a vector (DIMENSIONS,)."""
    total = 0.0
    for c in range(DIMENSIONS):
        total += v[c] * v[c]
    return sqrt(total)


@inlined
def _mirrored(z: Any, mirror: Any, out: Any) -> None:
    """Write the errors z (DIMENSIONS,) into out, mirrored at the plane with the normal `mirror` (Householder)."""
    along = 0.0
    for c in range(DIMENSIONS):
        along += z[c] * mirror[c]
    for c in range(DIMENSIONS):
        out[c] = z[c] - 2.0 * along * mirror[c]


@device
def _set_sides(
    multibody: Any, i: int, j: int, t: float, turning: Any, yaw_only: Any, times: Any, first: int, sampling: Sampling,
    work: Any, sides: Any,
) -> None:  # fmt: skip
    """Find out from the times (S,) of the first samples what foretells those of the others; see `predict_outcome`.

    The motions are the stated ones, t the time (s) that matters most, turning the errors of orientation, and yaw_only
    whether they are about the z axis alone.
    """
    points = sampling.points
    B, L, F, block = work.motion[1], work.joint, work.frame, work.block
    ends = sides.ends
    _set_unit_turns(t, turning, yaw_only, work, sides)
    middle = find_ends(points, times, first, ends)
    x, y, z = B.x, B.y, B.z
    for side in range(2):
        sides.widening[side, :] = 0.0
        if not -inf < ends[side] < inf:
            continue
        a, b, c = ends[side] * L[0, 0], ends[side] * L[1, 0], ends[side] * L[2, 0]
        B.x = x + a * F[0, 0] + b * F[1, 0] + c * F[2, 0]
        B.y = y + a * F[0, 1] + b * F[1, 1] + c * F[2, 1]
        B.z = z + a * F[0, 2] + b * F[1, 2] + c * F[2, 2]
        gap_at(multibody, i, j, t, work)
        set_widening(block[0], block[1:3], sides.turns, L, F, sides.widening[side])
    B.x, B.y, B.z = x, y, z
    set_limits(points, times, first, middle, sides)


@inlined
def _rank_of(value: float, firsts: Any) -> int:
    """Rank of the largest of some numbers (n,) that is at most the value; 0 for none."""
    rank = -1
    for m in range(firsts.size):
        rank += 1 if firsts[m] <= value else 0
    return max(rank, 0)


@inlined
def _unit(z: Any, first: int, level: float) -> Vector:
    """Three unit errors of orientation of a sample; level: 0.0 if they are about the z axis alone, else 1.0."""
    return level * z[first], level * z[first + 1], z[first + 2]


class Sampling(NamedTuple):
    """Settings and samples for the probabilities of pairs."""

    query: Any  # ImpactQuery
    horizon: float  # s
    stale_acceleration: float  # m/s^2
    stated: bool  # the stated motions of the pairs meet
    sigmas: float  # a pair that is stated to pass is left out unless it meets when grown by so many stddevs
    safe_sigmas: float  # bodies grown by so many standard deviations meet before nearly all impacts
    min_probability: float
    confidence: float
    planar: bool
    points: Any  # (S, DIMENSIONS): normal_samples
    weights: Any  # (S,)
    only_screens: bool = False  # bounds in place of answers, see likely_impacts
    stops_early: bool = False  # pairs that meet in the first part of the samples need no others


@allocating_kernel
def impact_probabilities(
    multibody: Any, spread: Any, pairs: Any, now: float, sampling: Sampling, work: Any, answers: Any
) -> int:
    """Write times (s after `now`) and probabilities of impact of pairs (P, 2) of body slots into answers (P, 4).

    An answer is NaN if neither body has declared an uncertainty, or if the pair is left out. Pairs that are stated to
    pass are left out if they do not meet within `sigmas` standard deviations, or only with a probability far below
    min_probability. Returns the number of samples of all pairs.
    """
    table, parts, bodies = multibody
    query, horizon, stated = sampling.query, sampling.horizon, sampling.stated
    points, weights, stale_acceleration = sampling.points, sampling.weights, sampling.stale_acceleration
    times = np.empty(weights.size)
    A, B, sides = work.motion[0], work.motion[1], work.sides[0]
    few = sampling.stops_early and PILOT <= weights.size < 2 * PILOT
    size = weights.size // FEW_PARTS if few else pilot_of(weights.size)
    count = -(-weights.size // size)
    firsts = points[0:size, 0].copy()
    order = np.argsort(firsts)
    followed = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        age_i = carry_on(bodies, i, now, work.quaternion, A)
        age_j = carry_on(bodies, j, now, work.quaternion, B)
        r_i, r_j = swing_radius(bodies, spread, i), swing_radius(bodies, spread, j)
        now_i, growth_i = surface_spread(bodies, spread, i, r_i, age_i, horizon, stale_acceleration)
        now_j, growth_j = surface_spread(bodies, spread, j, r_j, age_j, horizon, stale_acceleration)
        tube = Tube(now_i + now_j, growth_i + growth_j)
        coarse = max(query.tolerance, SAMPLE_TOLERANCE * tube.start)
        a, b = bodies.first_shape[i], bodies.first_shape[j]
        has_mesh = pair_has_mesh(table, parts, bodies, i, j)
        is_one_search = has_mesh and parts.next[a] < 0 and parts.next[b] < 0
        iterations = min(query.iterations, SEARCH_ITERATIONS) if is_one_search else query.iterations
        roughly, whole = ImpactQuery(query.margin, coarse, iterations), Window(0.0, horizon)
        if not stated:
            wide = Tube(sampling.sigmas * tube.start, sampling.sigmas * tube.growth)
            if first_contact(multibody, i, j, whole, wide, roughly, work) == inf:
                continue
        wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
        safe = first_contact(multibody, i, j, whole, wide, roughly, work)
        t = _lay_along(multibody, i, j, tube, sampling, work)
        work.joint[:], right = 0.0, right_time(multibody, spread, i, j, t, sampling, work)
        if not bodies.static[i]:
            add_covariance(spread, i, age_i, t, right, stale_acceleration, sampling.planar, work)
        if not bodies.static[j]:
            add_covariance(spread, j, age_j, t, right, stale_acceleration, sampling.planar, work)
        take_root(work.joint)
        turn_i = orientation_spread(spread, i, r_i, age_i, t, right)
        turn_j = orientation_spread(spread, j, r_j, age_j, t, right)
        turns_i, turns_j = errors_turn(turn_i), errors_turn(turn_j)
        for r in range(3):
            for c in range(3):
                work.rotation[0, r, c] = A.rotation[r, c]
                work.rotation[1, r, c] = B.rotation[r, c]
        yaw_only = (turns_by_yaw(spread, i, sampling.planar), turns_by_yaw(spread, j, sampling.planar))
        level_i, level_j = 0.0 if yaw_only[0] else 1.0, 0.0 if yaw_only[1] else 1.0
        coarse = (MESH_TOLERANCE if has_mesh else SAMPLE_TOLERANCE) * work.joint[0, 0]
        if not has_mesh:
            coarse = min(coarse, _least_tolerance(multibody, i, j, (turn_i, turn_j), t, query.margin, work))
        coarse = max(query.tolerance, coarse)
        if spins(A, B, horizon) or (spin_rate(A) + spin_rate(B)) * horizon > FARTHEST:
            iterations = min(iterations, SEARCH_ITERATIONS)
        elif spins_far(A, B, horizon) and not is_one_search:
            iterations = max(iterations, SPINNING_ITERATIONS)
        roughly = ImpactQuery(query.margin, coarse, iterations)
        begin = safe if safe < inf else 0.0
        # a search for the overlap of half a tolerance; the surface of a mesh has no gap below 0
        exact = has_mesh or (bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0)
        bias = 0.0 if exact else -0.75 * coarse
        w_i, w_j, v_i = (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz), (A.vx, A.vy, A.vz)
        motions = ((A.x, A.y, A.z), v_i), ((B.x, B.y, B.z), (B.vx, B.vy, B.vz), w_j)
        straight = _is_straight(parts, bodies, i, j, A, B) and not (turns_i or turns_j)
        work.axes[:, 3] = inf  # no axis is known yet
        share, is_open = weights.copy(), (0, size, size, size)
        foretells = sampling.stops_early and count >= FEWEST_FORETOLD and not (few or has_mesh)
        seen, met, begun = 0.0, 0, followed
        mirrors = has_mesh and not stated
        if mirrors:
            _set_mirror(multibody, i, j, t, (turn_i, turn_j), yaw_only, work, sides)
        likely, surely = True, False
        for nth in range(count):
            likely = stated or nth == 0 or seen * count >= PILOT_PART * sampling.min_probability * nth
            surely = stated and sampling.stops_early and nth == 1 and met == followed - begun
            if not likely or surely:
                break
            if few and nth == 1:
                is_open = open_ranks(times, order, FEW_SPARE)
            if foretells and nth == 2:
                shift(work, np.zeros(DIMENSIONS), t, motions)
                turn(A, work.rotation[0], w_i, v_i, turn_i, NOT_OFF, NOT_OFF)
                turn(B, work.rotation[1], w_j, (B.vx, B.vy, B.vz), turn_j, NOT_OFF, NOT_OFF)
                _set_sides(multibody, i, j, t, (turn_i, turn_j), yaw_only, times, 2 * size, sampling, work, sides)
                weigh_followed(points, weights, 2 * size, sides)
            for n in range(nth * size, min((nth + 1) * size, weights.size)):
                z = points[n]
                rank = _rank_of(z[0], firsts) if few else 0
                if few and nth > 0 and not (is_open[0] <= rank < is_open[1] or is_open[2] <= rank < is_open[3]):
                    share[order[rank]] += weights[n]
                    share[n], times[n] = 0.0, inf
                    seen += weights[n] if times[order[rank]] < inf else 0.0
                    continue
                outcome = predict_outcome(sides, z) if foretells and nth > 1 else OPEN
                if outcome != OPEN and sides.followed[outcome] > 0.0:
                    share[n], times[n] = 0.0, inf
                    sides.skipped[outcome] += weights[n]
                    continue
                followed += 1
                if mirrors:
                    _mirrored(z, sides.widening[0], work.sample)
                    z = work.sample
                shift(work, z, t, motions)
                if turns_i:
                    own, left = _unit(z, ORIENTATION, level_i), _unit(z, LEFT_OVER, level_i)
                    turn(A, work.rotation[0], w_i, v_i, turn_i, own, left)
                if turns_j:
                    own, left = _unit(z, ORIENTATION + 3, level_j), _unit(z, LEFT_OVER + 3, level_j)
                    turn(B, work.rotation[1], w_j, (B.vx, B.vy, B.vz), turn_j, own, left)
                parted = 0.0
                if straight:
                    parted = parted_until(work.axes, A, B, horizon, query.margin + bias + 0.5 * coarse)
                    if parted == inf:
                        times[n] = inf
                        continue
                window = Window(max(begin, parted), horizon)
                times[n] = first_contact(multibody, i, j, window, Tube(bias, 0.0), roughly, work)
                if straight:
                    pair = ShapePair(A, B, bodies.first_shape[i], bodies.first_shape[j])
                    remember(table, parts, pair, times[n] == inf, n, work.scratch, work.axes)
                met += 1 if times[n] < inf else 0
                seen += weights[n] if times[n] < inf else 0.0
        if foretells and likely and not surely:
            stand_for_skipped(points, share, 2 * size, sides)
        if surely:
            some, part = times[0:size].copy(), weights[0:size].copy()
            summarise(some, part, np.argsort(some), sampling.confidence, safe, answers[k], part.sum())
        elif likely:
            summarise(times, share, np.argsort(times), sampling.confidence, safe, answers[k], 1.0)
    return followed

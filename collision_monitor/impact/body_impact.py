"""Time of impact of two bodies on their courses, as an interval whose lower end is safe.

Conservative advancement along a separating axis (Mirtich 1996). It follows the rotation to first order (advance.py) and
therefore converges quadratically, while a bound by |w| r converges linearly.
Lecture topics: "predict the time to collide", "Compute fractional time at which collision actually occurred".
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined, outlined
from collision_monitor._jit.vectors import LANES
from collision_monitor.geometry.vector import Vector
from collision_monitor.impact.advance import advance_along_axis, in_motion
from collision_monitor.impact.apart import clear_until
from collision_monitor.impact.impact_record import (
    CLEAR,
    CLOSED_FORM,
    CONSERVATIVE_ADVANCEMENT,
    HIT,
    UNRESOLVED,
    write_pair,
)
from collision_monitor.impact.mesh_impact import mesh_impact
from collision_monitor.impact.mesh_pair import SURFACES, has_mesh, shapes_within, triangles_contact
from collision_monitor.impact.overlap_time import overlap_time
from collision_monitor.impact.sphere_interval import meeting_of_spheres, relative_motion_at, sphere_interval
from collision_monitor.impact.tree_impact import FULL
from collision_monitor.meshes.distance.nearest import MEMORY, PLACE_A, PLACE_B, answer_row
from collision_monitor.motion.bodies import next_pair
from collision_monitor.motion.motion import (
    MOTION,
    half_acceleration,
    position_at,
    set_piece,
    smooth_until,
)
from collision_monitor.motion.placed_pair import place_pair
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.dispatch import separation
from collision_monitor.narrow_phase.work_memory import WORK_SIZE
from collision_monitor.tolerances import EPSILON

AT_REST: Final = (0.0, 0.0, 0.0)

FARTHER: Final = 4.0
"""Factor by which the advance along a turning axis may exceed that along an axis at rest. Larger: the bound on where
the bodies are by then is looser. Smaller: the advance may stop short."""

NO_PLACES: Final = (-1, -1)
"""In place of the places of two triangles."""

NEWTON_STEPS: Final = 12
"""Steps towards a time of certain overlap; pairs that need more stay UNRESOLVED."""


class ImpactQuery(NamedTuple):
    """Query for the first time at which the gap is at most `margin`."""

    margin: float  # m
    tolerance: float  # m: gap beyond the margin at which the search ends
    iterations: int  # largest number of distance computations for a pair of shapes


class Window(NamedTuple):
    """The times to search (s after the monitor's origin)."""

    begin: Any
    end: Any


class Tube(NamedTuple):
    """Bound on the deviation of both bodies from their reference motions: start + growth t, t (s) after the begin."""

    start: Any  # m
    growth: Any  # m/s


class ShapePair(NamedTuple):
    """Shape a of a body in motion A and shape b of a body in motion B."""

    A: Any  # MOTION
    B: Any
    a: Any  # slots in the shape table
    b: Any


class Scratch(NamedTuple):
    """Scratch memory of one thread, so that the kernels allocate nothing."""

    rotation: Any  # (4, 3, 3)
    quaternion: Any  # (1, 4)
    out: Any  # (16,): a contact row, and the closing speed
    work: Any  # (WORK_SIZE,)
    tree: Any  # (MEMORY,), see meshes.nearest
    answer: Any  # (ANSWER,), see there
    triangle: Any  # (3, LANES), see meshes.solid
    piece: Any  # (2,) MOTION: pieces of the plans of two bodies


CLOSING: Final = CONTACT_SIZE
"""Column of Scratch.out with the closing speed (m/s), behind the contact row."""


def make_scratch() -> Scratch:
    """Make the scratch memory of one thread."""
    return Scratch(
        rotation=np.zeros((4, 3, 3)),
        quaternion=np.zeros((1, 4)),
        out=np.zeros(CLOSING + 1),
        work=np.zeros(WORK_SIZE),
        tree=np.zeros(MEMORY),
        answer=answer_row(),
        triangle=np.zeros((3, LANES)),
        piece=np.zeros(2, MOTION),
    )


@inlined
def _turning(before: Vector, n: Vector, elapsed: float) -> Vector:
    """Change per second, across n, of a unit vector that was `before` and is n after `elapsed` (s)."""
    x, y, z = (n[0] - before[0]) / elapsed, (n[1] - before[1]) / elapsed, (n[2] - before[2]) / elapsed
    along = x * n[0] + y * n[1] + z * n[2]
    return (x - along * n[0], y - along * n[1], z - along * n[2])


# Functions of one pair of shapes take only the table and the parts: a kernel passes its tuples of arrays on the stack,
# and with the bodies' 21 arrays a sample of an uncertain pair takes 1.7 times as long (fleet of 115 noisy objects).


@outlined
def shape_impact(
    table: Any, parts: Any, pair: ShapePair, window: Window, tube: Tube, query: ImpactQuery, scratch: Scratch
) -> tuple[int, float, int, float]:
    """Find the first time in the window at which the gap between the shapes of a pair (ShapePair) is the wanted one.

    The wanted gap is query.margin plus the tube, whose time begins with the window.
    Returns (status, t, queries, guess). The gap is wider at every time before t. HIT: at t it is within query.tolerance
    of the wanted one. CLEAR: t is the window's end. UNRESOLVED: the iterations, or the resolution of the time, ran out.
    guess: estimated time (s) after t at which the overlap exceeds the tube, from how fast the gap closed last; 0:
    unknown.
    """
    A, B, a, b = pair
    if has_mesh(table, a, b):
        return mesh_impact(table, parts, pair, window, tube, query, FULL, scratch)
    begin, end = window
    out = scratch.out
    n_before = AT_REST
    t = t_before = begin
    gap_before = inf
    status, iteration, guess = UNRESOLVED, 0, 0.0
    while iteration < query.iterations:
        iteration += 1
        placed = place_pair(table, parts, pair, t, scratch)
        gap = separation(table, a, b, placed.pose, out, scratch.work)
        gap -= query.margin + tube.start + tube.growth * (t - begin)
        if gap <= query.tolerance:
            if t > t_before:
                wanted = gap + query.tolerance + 2.0 * (tube.start + tube.growth * (t - begin))
                guess = wanted * (t - t_before) / (gap_before - gap)
            status = HIT
            break
        n, border = (out[0], out[1], out[2]), min(end, smooth_until(A, B, t))
        at = in_motion(pair, placed, t, border - t)
        # aim at half the tolerance, so that the last advance ends inside it
        aim = gap - 0.5 * query.tolerance
        d, m, until = 0.0, AT_REST, border - t
        for turns in range(2):
            d = max(d, advance_along_axis(table, at, n, m, -tube.growth, aim, until))
            if turns or (t == t_before and at.change.jerk == 0.0) or d >= until:
                break
            if t > t_before:
                m = _turning(n_before, n, t - t_before)
            if m[0] == 0.0 and m[1] == 0.0 and m[2] == 0.0 and at.change.jerk == 0.0:
                break
            until = min(until, FARTHER * d)
        t_before, gap_before, n_before = t, gap, n
        if d >= border - t:
            if border == end:
                return CLEAR, end, iteration, guess
            t = border  # where a body comes to rest
            continue
        if t + d <= t:  # the time has no finer resolution
            break
        t += d
    return status, t, iteration, guess


@device
def contact_at(table: Any, parts: Any, pair: ShapePair, t: float, scratch: Scratch) -> float:
    """Write the contact of a pair of shapes (ShapePair) at time t into scratch.out; return the signed distance (m).

    scratch.out holds a contact row about A's origin, followed by the closing speed (m/s).
    """
    return _contact_at(table, parts, pair, t, NO_PLACES, scratch)


@outlined
def _contact_at(table: Any, parts: Any, pair: ShapePair, t: float, places: Any, scratch: Scratch) -> float:
    """`contact_at`, or if there are places of two triangles (mesh_pair.py), the contact of these."""
    a, b, out = pair.a, pair.b, scratch.out
    oa, _, pose, state = place_pair(table, parts, pair, t, scratch)
    if places[0] >= 0:
        triangles_contact(table, a, b, pose, places, out)
    else:
        shapes_within(table, a, b, pose, inf, SURFACES, out, scratch)
    for k in range(3):
        out[POINT_A + k] += oa[k]
        out[POINT_B + k] += oa[k]
    out[CLOSING] = closing_speed(state.v, state.w_a, state.w_b, state.p, out)
    return out[DISTANCE]


@inlined
def closing_speed(v: Vector, wa: Vector, wb: Vector, p: Vector, out: Any) -> float:
    """Speed (m/s) at which the witness points of a contact row `out` about A's origin approach along its normal.

    v, p: velocity and position of B relative to A; wa, wb: angular velocities.
    """
    ax, ay, az = out[POINT_A], out[POINT_A + 1], out[POINT_A + 2]
    bx, by, bz = out[POINT_B] - p[0], out[POINT_B + 1] - p[1], out[POINT_B + 2] - p[2]
    vx = v[0] + (wb[1] * bz - wb[2] * by) - (wa[1] * az - wa[2] * ay)
    vy = v[1] + (wb[2] * bx - wb[0] * bz) - (wa[2] * ax - wa[0] * az)
    vz = v[2] + (wb[0] * by - wb[1] * bx) - (wa[0] * ay - wa[1] * ax)
    return -(vx * out[NORMAL] + vy * out[NORMAL + 1] + vz * out[NORMAL + 2])


@device
def _certain_overlap(
    table: Any, parts: Any, pair: ShapePair, start: float, guess: float, places: Any, window: Window, tube: Tube,
    query: ImpactQuery, scratch: Scratch,
) -> float:  # fmt: skip
    """Return a time in [start, window.end] at which a pair overlaps by more than the tube; inf: none found.

    places: as for `_contact_at`; two triangles that overlap are enough.

    Newton steps on the signed distance; start + guess is tried first if it lies in the interval. The contact at the
    returned time stays in scratch.out. The tube's time begins with the window.
    """
    begin, end = window
    guessed = 0.0 < guess < end - start
    t = start + guess if guessed else start
    for _ in range(NEWTON_STEPS):
        distance = _contact_at(table, parts, pair, t, places, scratch)
        excess = distance + scratch.out[BOUND] - query.margin + tube.start + tube.growth * (t - begin)
        if excess <= 0.0:
            return t
        speed = scratch.out[CLOSING] - tube.growth
        if speed > 0.0 and t < end:
            later = min(end, t + 1.001 * (excess + query.tolerance) / speed)
            if later == t:  # the time has no finer resolution
                return inf
            t = later
        elif guessed:
            t = start
        else:
            return inf
        guessed = False
    return inf


@outlined
def first_overlap(
    table: Any, parts: Any, pair: ShapePair, near: Any, window: Window, tube: Tube, query: ImpactQuery,
    scratch: Scratch,
) -> tuple[float, float]:  # fmt: skip
    """Return a time at which a pair of shapes certainly overlaps, infinite for none, and that of the contact found.

    near: what `shape_impact` found: status, time, guess, and places as for `_contact_at`. The contact in scratch.out is
    that at the first of these times, or at that of the impact if no triangles overlap because they are in one plane.
    """
    status, start, guess, places = near
    sure = _certain_overlap(table, parts, pair, start, guess, places, window, tube, query, scratch)
    if sure == inf and places[0] >= 0:  # the first triangles may slide off each other
        sure = _certain_overlap(table, parts, pair, start, 0.0, NO_PLACES, window, tube, query, scratch)
    first = sure
    if status == HIT and has_mesh(table, pair.a, pair.b):
        first = overlap_time(table, parts, pair, (start, sure), window, tube, query, scratch)
    if first == sure and sure < inf:
        return sure, sure
    contact_at(table, parts, pair, start, scratch)
    return first, start


@inlined
def tube_of(A: Any, B: Any, begin: float) -> Tube:
    """The tube of two motions (MOTION) together, from `begin` on. Stale objects have widened it (tracking.py)."""
    return Tube(
        A.tube_0 + B.tube_0 + A.tube_1 * (begin - A.tube_time) + B.tube_1 * (begin - B.tube_time),
        A.tube_1 + B.tube_1,
    )


class BodyPair(NamedTuple):
    """Two bodies as a search of their impact sees them: their motions (MOTION), first shapes and spin radii (m)."""

    A: Any
    B: Any
    first_a: Any
    first_b: Any
    spin_a: Any
    spin_b: Any


@device
def body_impact(
    multibody: Any, i: int, j: int, window: Window, query: ImpactQuery, scratch: Scratch, event: Any
) -> int:
    """Write the first impact of bodies i and j in the window into the IMPACT record `event`.

    event.status = CLEAR if there is none. Bodies that overlap, or are within query.margin, at the begin have their
    impact there. The reference motions and their tubes are those in `bodies`; in the record, i is the body with the
    smaller id. Bodies that follow plans are searched piece by piece. Returns the number of distance queries.
    """
    table, parts, bodies = multibody
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    a, b, spin_a, spin_b = bodies.first_shape[i], bodies.first_shape[j], bodies.spin_radius[i], bodies.spin_radius[j]
    begin, end = window
    queries, unresolved, is_near = 0, inf, False
    while True:
        if A.until <= begin:
            A = scratch.piece[0]
            _set_piece_at(bodies, i, begin, A)
        if B.until <= begin:
            B = scratch.piece[1]
            _set_piece_at(bodies, j, begin, B)
        pair = BodyPair(A, B, a, b, spin_a, spin_b)
        if min(A.until, B.until) < end and not is_near:
            least, tube = query.margin + query.tolerance, tube_of(A, B, begin)
            apart, n = clear_until(multibody, pair, (begin, end), least, tube, scratch)
            queries, is_near, begin = queries + n, apart == begin, apart
            if begin >= end:
                event.status = CLEAR
                break
            continue
        stop, is_near = min(end, A.until, B.until), False
        queries += chains_impact(table, parts, pair, Window(begin, stop), query, scratch, event)
        if event.status != CLEAR:
            unresolved = min(unresolved, event.lower)
        if event.status == HIT or stop >= end:
            break
        begin = stop
    if unresolved < inf:  # what is open in one piece may be certain in the next
        event.lower = unresolved
        if event.status == CLEAR:
            event.status, event.upper = UNRESOLVED, inf
    if event.status != CLEAR:
        write_pair(bodies, i, j, event)
    return queries


@device
def _set_piece_at(bodies: Any, i: int, t: float, piece: Any) -> None:
    """Write the piece of body i's plan that holds from time t on into `piece` (MOTION), with the body's tube."""
    m = bodies.motion[i]
    k = m.piece
    while bodies.pieces[k].until <= t:
        k += 1
    set_piece(bodies.pieces[k], piece)
    piece.radius, piece.cover, piece.covered = m.radius, m.cover, m.covered
    piece.tube_0, piece.tube_1, piece.tube_time = m.tube_0, m.tube_1, m.tube_time


@device
def chains_impact(
    table: Any, parts: Any, pair: BodyPair, window: Window, query: ImpactQuery, scratch: Scratch, event: Any
) -> int:
    """`body_impact` of two chains of shapes (`BodyPair`), without what names the bodies in the record.

    This is the impact of any two bodies: of the monitor, of single queries and of their batches.
    """
    A, B, a, first_b, spin_a, spin_b = pair
    begin, end = window
    event.status = CLEAR
    tube = tube_of(A, B, begin)
    approach = relative_motion_at(A, B, begin)
    bent = half_acceleration(A, B, begin, end) * (end - begin)  # m/s: the path deviates from its tangent by less
    # every impact lies in the time in which the bounding spheres overlap
    first, last = 0.0, end - begin
    reach = A.radius + B.radius + query.margin
    if reach < inf:
        first, last = sphere_interval(approach.p, approach.v, reach + tube.start, tube.growth + bent, last, 1.0)
        if first > last:
            return 0
    b = first_b
    if spin_a == 0.0 and spin_b == 0.0 and reach < inf and bent == 0.0:
        _sphere_impact(ShapePair(A, B, a, b), approach, reach, tube, window, first, event)
        return 1
    event.method = CONSERVATIVE_ADVANCEMENT
    queries = 0
    start, stop = begin + first, begin + last
    there = Tube(tube.start + tube.growth * first, tube.growth)
    lower, guess, places = inf, 0.0, NO_PLACES
    while a >= 0:
        shapes = ShapePair(A, B, a, b)
        scratch.answer[PLACE_A] = -1.0
        status, t, n, soon = shape_impact(table, parts, shapes, Window(start, stop), there, query, scratch)
        queries += n
        if status != CLEAR and t < lower:
            lower, guess, places = t, soon, (int(scratch.answer[PLACE_A]), int(scratch.answer[PLACE_B]))
            event.status = status
            event.shape_i, event.shape_j = a, b
            stop = t
        a, b = next_pair(parts, first_b, a, b)
    if event.status == CLEAR:
        return queries
    shapes = ShapePair(A, B, event.shape_i, event.shape_j)
    near = event.status, lower, guess, places
    sure, seen = first_overlap(table, parts, shapes, near, window, tube, query, scratch)
    event.lower, event.upper = lower, sure
    event.status = HIT if sure < inf else UNRESOLVED
    _set_geometry(event, A, seen, scratch.out)
    return queries


@inlined
def _set_geometry(event: Any, A: Any, t: float, out: Any) -> None:
    """Set point, normal and closing speed of the impact from a contact at time t about A's origin."""
    x, y, z = position_at(A, t)
    event.point_x = x + 0.5 * (out[POINT_A] + out[POINT_B])
    event.point_y = y + 0.5 * (out[POINT_A + 1] + out[POINT_B + 1])
    event.point_z = z + 0.5 * (out[POINT_A + 2] + out[POINT_B + 2])
    event.normal_x, event.normal_y, event.normal_z = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    event.closing_speed = out[CLOSING]


@inlined
def _sphere_impact(
    pair: ShapePair, approach: Any, reach: float, tube: Tube, window: Window, first: float, event: Any
) -> None:
    """Impact of two spheres, in closed form at both ends. first: the lower end (s after the window's begin)."""
    begin, end = window
    event.method = CLOSED_FORM
    event.shape_i, event.shape_j = pair.a, pair.b
    event.lower = begin + first
    sure = inf
    certain = reach * (1.0 - 8.0 * EPSILON) - tube.start  # the bounding radii are rounded up by nearly as much
    if certain > 0.0:
        sure, _ = sphere_interval(approach.p, approach.v, certain, -tube.growth, end - begin, -1.0)
        if certain - tube.growth * sure <= 0.0:  # the tube has outgrown the spheres: no contact is certain
            sure = inf
    event.status = HIT if sure < inf else UNRESOLVED
    event.upper = begin + sure if sure < inf else inf
    meeting_of_spheres(pair.A, pair.B, approach, begin, first if sure == inf else sure, event)

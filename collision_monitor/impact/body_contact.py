"""The deepest contact of two bodies now, from their last states."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.impact.body_impact import CLOSING, closing_speed
from collision_monitor.impact.mesh_pair import SURFACES, shapes_overlap, shapes_within
from collision_monitor.motion.bodies import next_pair, place_shape
from collision_monitor.motion.last_state import age_of, position_now, relative_state_now, rotation_now
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.records import ContactStatus

SHAPE_I: Final = CLOSING + 1
SHAPE_J: Final = CLOSING + 2
STATUS: Final = CLOSING + 3
RESULT: Final = CLOSING + 4
"""Numbers of a result row: a contact row about body i, the closing speed, the slots of the shapes, a ContactStatus."""

TOUCHING: Final = int(ContactStatus.TOUCHING)
UNSETTLED: Final = int(ContactStatus.UNRESOLVED)

ROUND_OFF: Final = 1.0 + 1e-14
"""Factor on the reach of two bounding spheres, so that no contact is lost to the rounding of their distance."""


class ContactQuery(NamedTuple):
    """What counts as a contact."""

    margin: float  # m: pairs whose distance is at most this touch
    stale_acceleration: float  # m/s^2: largest acceleration of a body after its last state


class Now(NamedTuple):
    """Body j relative to body i at one time, extrapolated from their last states."""

    p: Any  # (3,): position of j's origin from i's (m)
    v: Any  # (3,): its velocity (m/s)
    age_i: Any  # s since the last state; 0 for static bodies
    age_j: Any
    w_i: Any  # (3,): angular velocities (rad/s)
    w_j: Any


@inlined
def relative_now(bodies: Any, i: int, j: int, time: float) -> Now:
    """Compute body j relative to body i at `time` (s)."""
    age_i, age_j = age_of(bodies, i, time), age_of(bodies, j, time)
    p, v, w_i, w_j = relative_state_now(bodies, i, age_i, j, age_j)
    return Now(p, v, age_i, age_j, w_i, w_j)


@inlined
def widening(now: Now, stale_acceleration: float) -> float:
    """Deviation (m) of both bodies by unknown accelerations. A stale object widens the bounds of its contacts here."""
    return 0.5 * stale_acceleration * (now.age_i * now.age_i + now.age_j * now.age_j)


@inlined
def closing_now(now: Now, row: Any) -> float:
    """Speed (m/s) at which the witness points of a contact row about body i approach."""
    return closing_speed(now.v, now.w_i, now.w_j, now.p, row)


@inlined
def move_to_world(bodies: Any, i: int, now: Now, row: Any) -> None:
    """Move the witness points of a contact row about body i to the world's origin."""
    at = position_now(bodies, i, now.age_i)
    for c in range(3):
        row[POINT_A + c] += at[c]
        row[POINT_B + c] += at[c]


@device
def chains_contact(
    table: Any, parts: Any, first_a: int, first_b: int, pose: PairPose, limit: float, effort: int, scratch: Any,
    result: Any,
) -> tuple[float, int]:  # fmt: skip
    """Write the deepest contact of two chains of shapes (`Parts`), if it is at most `limit` (m), into a result row.

    pose: rotations of both bodies, not in scratch.rotation[2:4], and position of B relative to A. effort: see
    `mesh_within`. The row is about A's origin. Returns (signed distance, infinite for none; number of pair tests). This
    is the contact of any two bodies: of the monitor, of single queries and of their batches.
    """
    R_i, R_j, (px, py, pz) = pose
    R_a, R_b, out = scratch.rotation[2], scratch.rotation[3], scratch.out
    best, tests = inf, 0
    a, b, oa = first_a, first_b, (0.0, 0.0, 0.0)
    while a >= 0:
        if b == first_b:
            oa = place_shape(table, parts, a, R_i, R_a)
        ob = place_shape(table, parts, b, R_j, R_b)
        at = PairPose(R_a, R_b, (px + ob[0] - oa[0], py + ob[1] - oa[1], pz + ob[2] - oa[2]))
        tests += 1
        if shapes_within(table, a, b, at, min(limit, best), effort, out, scratch) and out[DISTANCE] < best:
            best = out[DISTANCE]
            for c in range(3):
                out[POINT_A + c] += oa[c]
                out[POINT_B + c] += oa[c]
            for c in range(CONTACT_SIZE):
                result[c] = out[c]
            result[SHAPE_I], result[SHAPE_J] = a, b
        a, b = next_pair(parts, first_b, a, b)
    return best, tests


@outlined
def chains_overlap(table: Any, parts: Any, first_a: Any, first_b: Any, pose: Any, scratch: Any) -> Any:
    """Whether two chains have a point in common. Arguments as for `chains_contact`."""
    R_a, R_b, p = scratch.rotation[2], scratch.rotation[3], pose.p
    a, b, oa = first_a, first_b, (0.0, 0.0, 0.0)
    while a >= 0:
        if b == first_b:
            oa = place_shape(table, parts, a, pose.R_A, R_a)
        ob = place_shape(table, parts, b, pose.R_B, R_b)
        at = PairPose(R_a, R_b, (p[0] + ob[0] - oa[0], p[1] + ob[1] - oa[1], p[2] + ob[2] - oa[2]))
        if shapes_overlap(table, a, b, at, scratch):
            return True
        a, b = next_pair(parts, first_b, a, b)
    return False


@outlined
def body_contact(
    multibody: Any, i: int, j: int, time: float, query: ContactQuery, scratch: Any, result: Any
) -> tuple[bool, int]:
    """Write the deepest contact of bodies i and j at `time` (s), from their last states, into a result row.

    The error bound includes the excess of the bodies' models, and what they may have accelerated since their last
    states (`widening`). A pair that may touch within its error bound counts as touching, with the status UNRESOLVED.
    Returns (touching, number of narrow-phase tests).
    """
    table, parts, bodies = multibody
    R_i, R_j = scratch.rotation[0], scratch.rotation[1]
    rotation_now(bodies, i, time, scratch.quaternion, R_i)
    rotation_now(bodies, j, time, scratch.quaternion, R_j)
    now = relative_now(bodies, i, j, time)
    px, py, pz = now.p
    widen = widening(now, query.stale_acceleration)
    wanted = query.margin + widen
    reach = bodies.motion[i].radius + bodies.motion[j].radius + wanted
    if px * px + py * py + pz * pz > reach * reach * ROUND_OFF:
        return False, 0
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    best, tests = chains_contact(table, parts, a, b, PairPose(R_i, R_j, now.p), wanted, SURFACES, scratch, result)
    if best == inf:
        return False, tests
    result[CLOSING] = closing_now(now, result)
    excess = bodies.excess[i] + bodies.excess[j]
    result[BOUND] += widen + excess
    certain = best + excess <= query.margin
    if excess > 0.0 and best <= 0.0 and (bodies.concave[i] or bodies.concave[j]):
        result[BOUND] -= best
        certain = excess <= query.margin
    result[STATUS] = TOUCHING if certain else UNSETTLED
    move_to_world(bodies, i, now, result)
    return True, tests


@device
def bounded_contact(bodies: Any, i: int, j: int, now: Now, reach: float, result: Any) -> None:
    """Write a contact from the bounding spheres alone into a result row, with the status UNRESOLVED.

    Its distance is that of the centres; the true one differs by at most `reach` (m). now: the two bodies (Now).
    """
    distance = sqrt(now.p[0] * now.p[0] + now.p[1] * now.p[1] + now.p[2] * now.p[2])
    result[:] = 0.0
    result[DISTANCE] = distance
    result[NORMAL] = 1.0
    if distance > 0.0:
        for c in range(3):
            result[NORMAL + c] = now.p[c] / distance
    at = position_now(bodies, i, now.age_i)
    for c in range(3):
        result[POINT_A + c] = at[c]
        result[POINT_B + c] = result[POINT_A + c] + now.p[c]
    result[BOUND] = reach
    for c in range(3):
        result[CLOSING] -= now.v[c] * result[NORMAL + c]
    result[SHAPE_I], result[SHAPE_J] = bodies.first_shape[i], bodies.first_shape[j]
    result[STATUS] = UNSETTLED

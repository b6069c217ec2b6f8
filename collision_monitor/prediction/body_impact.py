"""Time of impact of two bodies at constant twist, as an interval whose lower end is safe.

Conservative advancement along a separating axis (Mirtich 1996), with the rotation followed to first order
(advance.py), which makes it converge quadratically where a bound by |w| r converges linearly.
Lecture topics: "predict the time to collide", "Compute fractional time at which collision actually occurred".
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.narrow_phase.dispatch import pair_contact, separation
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.work_memory import WORK_SIZE
from collision_monitor.prediction.advance import Placed, advance
from collision_monitor.prediction.impact_record import CLEAR, CLOSED_FORM, CONSERVATIVE_ADVANCEMENT, HIT, UNRESOLVED
from collision_monitor.prediction.motion import (
    half_acceleration,
    place_shape,
    relative_position,
    relative_velocity,
    rotation_at,
)
from collision_monitor.prediction.sphere_interval import meeting_of_spheres, sphere_interval
from collision_monitor.tolerances import EPSILON

AT_REST: Final = (0.0, 0.0, 0.0)

FARTHER: Final = 4.0
"""How much farther than along an axis at rest it is looked for along one that turns. Larger: the bound on where the
bodies are by then is worse. Smaller: it may stop short."""


class Scratch(NamedTuple):
    """Room for one thread's intermediate results, so that the kernels allocate nothing."""

    rotation: Any  # (4, 3, 3)
    quaternion: Any  # (1, 4)
    out: Any  # (16,)
    work: Any  # (WORK_SIZE,)


def make_scratch() -> Scratch:
    """Scratch for one thread."""
    return Scratch(np.zeros((4, 3, 3)), np.zeros((1, 4)), np.zeros(16), np.zeros(WORK_SIZE))


@inlined
def _turning(before, n, elapsed):
    """How a unit vector that was `before` turns, across it (1/s)."""
    x, y, z = (n[0] - before[0]) / elapsed, (n[1] - before[1]) / elapsed, (n[2] - before[2]) / elapsed
    along = x * n[0] + y * n[1] + z * n[2]
    return (x - along * n[0], y - along * n[1], z - along * n[2])


@device
def shape_impact(table, parts, A, B, a, b, begin, end, margin, tube_0, tube_1, tolerance, budget, scratch):
    """When the gap between shape a in motion A and shape b in motion B (MOTION) first is within the wanted one.

    begin, end: seconds after the monitor's origin; the wanted gap is margin + tube_0 + tube_1 (t - begin) (m).
    Returns (status, t, queries, guess): no time in [begin, t) is within the wanted gap; at t it is within tolerance of
    it (HIT), t is end (CLEAR), or the budget of distance queries ran out (UNRESOLVED). guess: how long after t they
    overlap by as much as they should, from how fast the gap closed last; 0 where nothing tells.
    """
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    out = scratch.out
    acceleration = (B.ax - A.ax, B.ay - A.ay, B.az - A.az)
    w_a, w_b = (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz)
    n_before = AT_REST
    t = t_before = begin
    gap_before = inf
    status, query, guess = UNRESOLVED, 0, 0.0
    while query < budget:
        query += 1
        rotation_at(A, t, R_i)
        rotation_at(B, t, R_j)
        oa = place_shape(table, parts, a, R_i, R_a)
        ob = place_shape(table, parts, b, R_j, R_b)
        px, py, pz = relative_position(A, B, t)
        pose = PairPose(R_a, R_b, (px + ob[0] - oa[0], py + ob[1] - oa[1], pz + ob[2] - oa[2]))
        gap = separation(table, a, b, pose, out, scratch.work)
        gap -= margin + tube_0 + tube_1 * (t - begin)
        if gap <= tolerance:
            if t > t_before:
                wanted = gap + tolerance + 2.0 * (tube_0 + tube_1 * (t - begin))
                guess = wanted * (t - t_before) / (gap_before - gap)
            status = HIT
            break
        n, v = (out[0], out[1], out[2]), relative_velocity(A, B, t)
        at = Placed(a, b, R_a, R_b, oa, ob, (px, py, pz), v, acceleration, w_a, w_b)
        # aim at half the tolerance, so that the last advance ends inside it
        aim = gap - 0.5 * tolerance
        d, m, until = 0.0, AT_REST, end - t
        for turns in range(2):
            d = max(d, advance(table, at, n, m, -tube_1, aim, until))
            if turns or t == t_before or d >= until:
                break
            m = _turning(n_before, n, t - t_before)
            if m[0] == 0.0 and m[1] == 0.0 and m[2] == 0.0:
                break
            until = min(until, FARTHER * d)
        t_before, gap_before, n_before = t, gap, n
        if d >= end - t:
            return CLEAR, end, query, guess
        if t + d <= t:  # the resolution of the time is reached before the gap is
            break
        t += d
    return status, t, query, guess


@device
def contact_at(table, parts, A, B, a, b, t, scratch):
    """Contact of shape a in motion A with shape b in motion B at time t, into scratch.out; returns the signed distance.

    out as narrow_phase.dispatch.pair_contact gives it, but relative to A's origin; out[15]: closing speed (m/s).
    """
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    out = scratch.out
    rotation_at(A, t, R_i)
    rotation_at(B, t, R_j)
    oa = place_shape(table, parts, a, R_i, R_a)
    ob = place_shape(table, parts, b, R_j, R_b)
    px, py, pz = relative_position(A, B, t)
    pose = PairPose(R_a, R_b, (px + ob[0] - oa[0], py + ob[1] - oa[1], pz + ob[2] - oa[2]))
    pair_contact(table, a, b, pose, out, scratch.work)
    for k in range(3):
        out[4 + k] += oa[k]
        out[7 + k] += oa[k]
    v = relative_velocity(A, B, t)
    out[15] = closing_speed(v, (A.wx, A.wy, A.wz), (B.wx, B.wy, B.wz), px, py, pz, out)
    return out[0]


@inlined
def closing_speed(v, wa, wb, px, py, pz, out):
    """Speed (m/s) at which the witness points of a contact (out) approach along its normal.

    v: velocity of B relative to A; wa, wb: angular velocities; p: position of B relative to A.
    """
    ax, ay, az = out[4], out[5], out[6]
    bx, by, bz = out[7] - px, out[8] - py, out[9] - pz
    vx = v[0] + (wb[1] * bz - wb[2] * by) - (wa[1] * az - wa[2] * ay)
    vy = v[1] + (wb[2] * bx - wb[0] * bz) - (wa[2] * ax - wa[0] * az)
    vz = v[2] + (wb[0] * by - wb[1] * bx) - (wa[0] * ay - wa[1] * ax)
    return -(vx * out[1] + vy * out[2] + vz * out[3])


@inlined
def _touching_by(table, parts, A, B, a, b, start, guess, end, tube_0, tube_1, begin, margin, tolerance, scratch):
    """A time in [start, end] at which they overlap by more than the tube, whatever the motions inside it; inf: none.

    Newton steps on the signed distance, the first one to start + guess where that helps. The contact at the time found
    is left in scratch.out.
    """
    guessed = 0.0 < guess < end - start
    t = start + guess if guessed else start
    for _ in range(12):
        distance = contact_at(table, parts, A, B, a, b, t, scratch)
        excess = distance + scratch.out[10] - margin + tube_0 + tube_1 * (t - begin)
        if excess <= 0.0:
            return t
        speed = scratch.out[15] - tube_1
        if speed > 0.0 and t < end:
            t = min(end, t + 1.001 * (excess + tolerance) / speed)
        elif guessed:
            t = start
        else:
            return inf
        guessed = False
    return inf


@device
def body_impact(table, parts, bodies, i, j, begin, end, margin, tolerance, budget, scratch, event):
    """First impact of bodies i and j in [begin, end] into the IMPACT record `event`; returns distance queries made.

    event.status = CLEAR where there is none. Overlapping or within `margin` (m) already is an impact at begin.
    The reference motions and their tubes are read from `bodies`; ids decide which body counts as i.
    """
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    event.status = CLEAR
    tube_1 = A.tube_1 + B.tube_1
    tube_0 = A.tube_0 + B.tube_0 + A.tube_1 * (begin - A.tube_time) + B.tube_1 * (begin - B.tube_time)
    px, py, pz = relative_position(A, B, begin)
    vx, vy, vz = relative_velocity(A, B, begin)
    bent = half_acceleration(A, B) * (end - begin)  # m/s: a path that bends is within that of its tangent
    # the time in which the bounding spheres overlap holds every impact
    first, last = 0.0, end - begin
    reach = A.radius + B.radius + margin
    if reach < inf:
        first, last = sphere_interval(px, py, pz, vx, vy, vz, reach + tube_0, tube_1 + bent, last, 1.0)
        if first > last:
            return 0
    event.i, event.j = i, j
    event.key = (np.uint64(bodies.id[i]) << np.uint64(32)) | np.uint64(bodies.id[j])
    event.version_i, event.version_j = bodies.version[i], bodies.version[j]
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    if bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0 and reach < inf and bent == 0.0:
        _sphere_impact(A, B, a, b, px, py, pz, vx, vy, vz, reach, tube_0, tube_1, begin, first, end, event)
        return 1
    event.method = CONSERVATIVE_ADVANCEMENT
    queries = 0
    stop = begin + last
    lower, guess = inf, 0.0
    while a >= 0:
        b = bodies.first_shape[j]
        while b >= 0:
            status, t, n, soon = shape_impact(
                table, parts, A, B, a, b, begin + first, stop,
                margin, tube_0 + tube_1 * first, tube_1, tolerance, budget, scratch,
            )  # fmt: skip
            queries += n
            if status != CLEAR and t < lower:
                lower, guess = t, soon
                event.status = status
                event.shape_i, event.shape_j = a, b
                stop = t
            b = parts.next[b]
        a = parts.next[a]
    if event.status == CLEAR:
        return queries
    a, b = event.shape_i, event.shape_j
    sure = _touching_by(table, parts, A, B, a, b, lower, guess, end, tube_0, tube_1, begin, margin, tolerance, scratch)
    if sure == inf:
        contact_at(table, parts, A, B, a, b, lower, scratch)
    event.lower, event.upper = lower, sure
    event.status = HIT if sure < inf else UNRESOLVED
    _set_geometry(event, A, sure if sure < inf else lower, scratch.out)
    return queries


@inlined
def _set_geometry(event, A, t, out):
    """Where and how they meet, from a contact at time t relative to A's origin."""
    ta = t - A.time
    event.point_x = A.x + (A.vx + 0.5 * A.ax * ta) * ta + 0.5 * (out[4] + out[7])
    event.point_y = A.y + (A.vy + 0.5 * A.ay * ta) * ta + 0.5 * (out[5] + out[8])
    event.point_z = A.z + (A.vz + 0.5 * A.az * ta) * ta + 0.5 * (out[6] + out[9])
    event.normal_x, event.normal_y, event.normal_z = out[1], out[2], out[3]
    event.closing_speed = out[15]


@inlined
def _sphere_impact(A, B, a, b, px, py, pz, vx, vy, vz, reach, tube_0, tube_1, begin, first, end, event):
    """Two spheres: closed form for both ends of the interval."""
    event.method = CLOSED_FORM
    event.shape_i, event.shape_j = a, b
    event.lower = begin + first
    sure = inf
    certain = reach * (1.0 - 8.0 * EPSILON) - tube_0  # the radii are rounded up by nearly as much
    if certain > 0.0:
        sure, _ = sphere_interval(px, py, pz, vx, vy, vz, certain, -tube_1, end - begin, -1.0)
        if certain - tube_1 * sure <= 0.0:  # the tube has outgrown the spheres: nothing is sure any more
            sure = inf
    event.status = HIT if sure < inf else UNRESOLVED
    event.upper = begin + sure if sure < inf else inf
    meeting_of_spheres(A, B, px, py, pz, vx, vy, vz, begin, first if sure == inf else sure, event)

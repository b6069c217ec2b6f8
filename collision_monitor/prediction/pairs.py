"""First impacts of many pairs of bodies: sought exactly, or bounded by spheres."""

from __future__ import annotations

from math import inf, isfinite

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor.prediction.body_contact import UNRESOLVED
from collision_monitor.prediction.body_impact import body_impact
from collision_monitor.prediction.impact_record import BOUND_ONLY, CLEAR
from collision_monitor.prediction.motion import half_acceleration, relative_position, relative_velocity
from collision_monitor.prediction.sphere_interval import meeting_of_spheres, sphere_interval


@kernel
def predict_pairs(table, parts, bodies, pairs, now, margin, tolerance, budget, events, scratch):
    """First impacts of pairs (P, 2) until both bodies' cover times, into events (IMPACT).

    They are looked for from `now`, or from the time until which the pair was predicted before.
    Returns (how many impacts, distance queries made).
    """
    n = queries = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        begin = max(now, min(bodies.motion[i].covered, bodies.motion[j].covered))
        end = min(bodies.motion[i].cover, bodies.motion[j].cover)
        if begin > now and begin >= end:
            continue
        queries += body_impact(table, parts, bodies, i, j, begin, end, margin, tolerance, budget, scratch, events[n])
        if events[n].status != CLEAR:
            n += 1
    return n, queries


@inlined
def is_cheap(bodies, i, j):
    """Is the pair settled as fast as its bound? Two spheres, or one with a half-space, which has no bounding sphere."""
    spheres = bodies.spin_radius[i] == 0.0 and bodies.spin_radius[j] == 0.0
    return spheres or not (isfinite(bodies.motion[i].radius) and isfinite(bodies.motion[j].radius))


@inlined
def bound_impact(bodies, i, j, begin, end, margin, event):
    """Since when the pair's bounding spheres meet in [begin, end], into the IMPACT record `event`, UNRESOLVED.

    event.status = CLEAR where they do not, and the bodies cannot.
    """
    if bodies.id[i] > bodies.id[j]:
        i, j = j, i
    A, B = bodies.motion[i], bodies.motion[j]
    event.status = CLEAR
    tube_1 = A.tube_1 + B.tube_1
    tube_0 = A.tube_0 + B.tube_0 + A.tube_1 * (begin - A.tube_time) + B.tube_1 * (begin - B.tube_time)
    px, py, pz = relative_position(A, B, begin)
    vx, vy, vz = relative_velocity(A, B, begin)
    bent = half_acceleration(A, B) * (end - begin)
    reach = A.radius + B.radius + margin + tube_0
    first, last = sphere_interval(px, py, pz, vx, vy, vz, reach, tube_1 + bent, end - begin, 1.0)
    if first > last:
        return
    event.i, event.j = i, j
    event.key = (np.uint64(bodies.id[i]) << np.uint64(32)) | np.uint64(bodies.id[j])
    event.version_i, event.version_j = bodies.version[i], bodies.version[j]
    event.shape_i, event.shape_j = bodies.first_shape[i], bodies.first_shape[j]
    event.lower, event.upper = begin + first, inf
    event.status, event.method = UNRESOLVED, BOUND_ONLY
    meeting_of_spheres(A, B, px, py, pz, vx, vy, vz, begin, first, event)


@kernel
def bound_pairs(table, parts, bodies, pairs, now, margin, tolerance, budget, events, scratch):
    """As `candidates.predict_pairs`, but of all pairs that are not cheap only the bound."""
    n = queries = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        begin = max(now, min(bodies.motion[i].covered, bodies.motion[j].covered))
        end = min(bodies.motion[i].cover, bodies.motion[j].cover)
        if begin > now and begin >= end:
            continue
        if is_cheap(bodies, i, j):
            queries += body_impact(
                table, parts, bodies, i, j, begin, end, margin, tolerance, budget, scratch, events[n]
            )
        else:
            bound_impact(bodies, i, j, begin, end, margin, events[n])
        if events[n].status != CLEAR:
            n += 1
    return n, queries


@kernel
def refine(table, parts, bodies, bounds, now, margin, tolerance, budget, events, scratch):
    """First impacts from `now` on of the pairs of `bounds` (IMPACT), into events; as `candidates.predict_pairs`."""
    n = queries = 0
    for k in range(bounds.size):
        i, j = bounds[k].i, bounds[k].j
        end = min(bodies.motion[i].cover, bodies.motion[j].cover)
        queries += body_impact(table, parts, bodies, i, j, now, end, margin, tolerance, budget, scratch, events[n])
        if events[n].status != CLEAR:
            n += 1
    return n, queries

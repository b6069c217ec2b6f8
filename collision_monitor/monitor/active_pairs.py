"""The pairs that must be looked at in every step: those that touch, and those whose certified time has run out."""

from __future__ import annotations

from math import inf
from typing import Final

import numpy as np

from collision_monitor._jit import device, inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor.narrow_phase.dispatch import contact_within
from collision_monitor.prediction.motion import (
    place_shape,
    position_now,
    quaternion_to_matrix,
    relative_position_now,
    relative_velocity_now,
    turn_quaternion,
)
from collision_monitor.prediction.time_of_impact import CLEAR, body_impact, closing_speed
from collision_monitor.records import ContactStatus, Phase

PAIR = np.dtype(
    [
        ("key", np.uint64),  # (smaller id << 32) | larger id; the set is sorted by it
        ("i", np.int32),  # body slots; body i has the smaller id
        ("j", np.int32),
        ("since", np.float64),  # s after the monitor's origin: when it began to touch
        ("touching", np.uint8),
        ("touched", np.uint8),  # the same, one step before
        ("leaving", np.uint8),  # gone with the next step: certified apart for a while, or reported once more (END)
    ]
)

RESULT: Final = 20
"""Numbers for each pair: what narrow_phase.dispatch.contact gives relative to body i, then by name below."""
CLOSING: Final = 15
BOUND: Final = 10
SHAPE_I: Final = 16
SHAPE_J: Final = 17
STATUS: Final = 18

AHEAD: Final = 2
"""Pairs whose bodies are asked for while one is examined."""

TOUCHING: Final = int(ContactStatus.TOUCHING)
UNRESOLVED: Final = int(ContactStatus.UNRESOLVED)
PERSIST: Final = int(Phase.PERSIST)
BEGIN: Final = int(Phase.BEGIN)
END: Final = int(Phase.END)


@device
def has_changed(bodies, event):
    """Does the event rest on a motion that no longer holds?"""
    return bodies.version[event.i] != event.version_i or bodies.version[event.j] != event.version_j


@kernel
def unite(bodies, pairs, events, due, order, new_pairs, new_events):
    """The active pairs with those that came due, by key; both have an event of their own at the same index.

    Left out are pairs that do not touch and whose motion has changed (they were predicted anew), and pairs of bodies
    that are gone. order (D,): of `due` by key. Returns how many there are.
    """
    n = k = m = 0
    while k < pairs.size or m < order.size:
        if k < pairs.size:
            i, j = pairs[k].i, pairs[k].j
            key = (np.uint64(bodies.id[i]) << np.uint64(32)) | np.uint64(bodies.id[j])
            gone = not (bodies.used[i] and bodies.used[j]) or key != pairs[k].key
            changed = has_changed(bodies, events[k])
            if gone or pairs[k].leaving == 1 or (changed and pairs[k].touching == 0):
                k += 1
                continue
        if k < pairs.size and (m >= order.size or pairs[k].key <= due[order[m]].key):
            new_pairs[n] = pairs[k]
            new_pairs[n].touched = pairs[k].touching
            new_events[n] = events[k]
            if m < order.size and pairs[k].key == due[order[m]].key:
                new_events[n] = due[order[m]]
                m += 1
            k += 1
        else:
            event = due[order[m]]
            new_events[n] = event
            new_pairs[n].key, new_pairs[n].i, new_pairs[n].j = event.key, event.i, event.j
            new_pairs[n].touched = new_pairs[n].touching = new_pairs[n].leaving = 0
            new_pairs[n].since = np.nan
            m += 1
        n += 1
    return n


@device
def rotation_now(bodies, i, now, q, R):
    """Rotation of body i at `now`, from its last state, into R; returns the time since that state."""
    age = 0.0 if bodies.static[i] else now - bodies.time[i]
    turn_quaternion(bodies.quaternion, i, bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2], age, q[0])
    quaternion_to_matrix(q, 0, R)
    return age


@device
def body_contact(table, parts, bodies, i, j, now, margin, stale_acceleration, scratch, result):
    """Do bodies i and j touch at `now`, from their last states? The deepest contact of their shapes into result.

    Not heard of for a time, a body may be off by what it could have accelerated, and a coarse model by its excess: the
    bound says so, and a pair that may touch within it counts as touching, UNRESOLVED.
    Returns (touching, narrow-phase tests made).
    """
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    out = scratch.out
    age_i = rotation_now(bodies, i, now, scratch.quaternion, R_i)
    age_j = rotation_now(bodies, j, now, scratch.quaternion, R_j)
    px = relative_position_now(bodies, i, age_i, j, age_j, 0)
    py = relative_position_now(bodies, i, age_i, j, age_j, 1)
    pz = relative_position_now(bodies, i, age_i, j, age_j, 2)
    widen = 0.5 * stale_acceleration * (age_i * age_i + age_j * age_j)
    wanted = margin + widen
    best = inf
    tests = 0
    reach = bodies.motion[i].radius + bodies.motion[j].radius + wanted
    if px * px + py * py + pz * pz > reach * reach * (1.0 + 1e-14):
        return False, 0
    a = bodies.first_shape[i]
    while a >= 0:
        oa = place_shape(table, parts, a, R_i, R_a)
        b = bodies.first_shape[j]
        while b >= 0:
            ob = place_shape(table, parts, b, R_j, R_b)
            x, y, z = px + ob[0] - oa[0], py + ob[1] - oa[1], pz + ob[2] - oa[2]
            tests += 1
            limit = min(wanted, best)
            if contact_within(table, a, b, R_a, R_b, x, y, z, limit, out, scratch.work) and out[0] < best:
                best = out[0]
                for c in range(3):
                    out[4 + c] += oa[c]
                    out[7 + c] += oa[c]
                for c in range(15):
                    result[c] = out[c]
                result[SHAPE_I], result[SHAPE_J] = a, b
            b = parts.next[b]
        a = parts.next[a]
    if best == inf:
        return False, tests
    v = (
        relative_velocity_now(bodies, i, age_i, j, age_j, 0),
        relative_velocity_now(bodies, i, age_i, j, age_j, 1),
        relative_velocity_now(bodies, i, age_i, j, age_j, 2),
    )
    wa = (bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2])
    wb = (bodies.angular[j, 0], bodies.angular[j, 1], bodies.angular[j, 2])
    result[CLOSING] = closing_speed(v, wa, wb, px, py, pz, result)
    excess = bodies.excess[i] + bodies.excess[j]
    result[BOUND] += widen + excess
    certain = best + excess <= margin
    if excess > 0.0 and best <= 0.0 and (bodies.concave[i] or bodies.concave[j]):
        result[BOUND] -= best
        certain = excess <= margin
    result[STATUS] = TOUCHING if certain else UNRESOLVED
    for c in range(3):
        at = position_now(bodies, i, age_i, c)
        result[4 + c] += at
        result[7 + c] += at
    return True, tests


@inlined
def _ask_for(table, bodies, i):
    row = np.intp(i)
    prefetch(bodies.position, row)
    prefetch(bodies.quaternion, row)
    prefetch(bodies.linear, row)
    prefetch(bodies.angular, row)
    prefetch(bodies.motion, row)
    prefetch(table.size, np.intp(bodies.first_shape[i]))


@kernel
def examine(
    table, parts, bodies, pairs, events, which, now, margin, stale_acceleration, tolerance, budget, results, later,
    scratch,
):  # fmt: skip
    """Look at the active pairs `which` (M,) at `now`: contact into results (n, RESULT), and what does not touch is
    predicted on.

    All that is known of a pair stays at its index; it is `leaving` where it has just ended, or is certified apart for a
    while: then its event goes into `later` (IMPACT). Returns (later, narrow-phase tests, impact queries).
    """
    n_later = tests = queries = 0
    for at in range(which.size):
        if at + AHEAD < which.size:
            _ask_for(table, bodies, pairs[which[at + AHEAD]].i)
            _ask_for(table, bodies, pairs[which[at + AHEAD]].j)
        k = which[at]
        pair, event = pairs[k], events[k]
        i, j = pair.i, pair.j
        touching, made = body_contact(table, parts, bodies, i, j, now, margin, stale_acceleration, scratch, results[k])
        tests += made
        stays = touching
        if not touching:
            predicted = bodies.motion[i].time == now or bodies.motion[j].time == now
            if not (predicted and has_changed(bodies, event)):
                end = min(bodies.motion[i].cover, bodies.motion[j].cover)
                queries += body_impact(table, parts, bodies, i, j, now, end, margin, tolerance, budget, scratch, event)
                if event.status != CLEAR:
                    if event.lower > now:
                        later[n_later] = event
                        n_later += 1
                    else:
                        stays = True
        if touching and pair.touched == 0:
            pair.since = now
        pair.touching = 1 if touching else 0
        pair.leaving = 0 if stays else 1
    return n_later, tests, queries

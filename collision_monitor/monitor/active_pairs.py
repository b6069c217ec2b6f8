"""The pairs that must be looked at in every step: those that touch, and those whose certified time has run out."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor._jit import inlined, kernel
from collision_monitor._jit.prefetch import prefetch
from collision_monitor.prediction.body_contact import body_contact
from collision_monitor.prediction.body_impact import body_impact
from collision_monitor.prediction.impact_record import CLEAR, has_changed

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


AHEAD: Final = 2
"""Pairs whose bodies are asked for while one is examined."""


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

"""What bounding spheres and sphere trees say of pairs that nobody has time to look at: at once, and never too late.

(Slides "Time-critical collision detection": from coarse to fine, and the answer so far whenever time is up. Hubbard,
Approximating polyhedra with spheres for time-critical collision detection, 1996.)
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.monitor.event_list import sort_order
from collision_monitor.prediction.body_contact import BOUND, CLOSING, SHAPE_I, SHAPE_J, STATUS, UNRESOLVED
from collision_monitor.prediction.impact_record import CLEAR, has_changed
from collision_monitor.prediction.motion import (
    Bodies,
    position_now,
    relative_now,
    relative_velocity_now,
)
from collision_monitor.prediction.pairs import bound_impact, is_cheap


@kernel
def leave(bodies, pairs, events, which, now, margin, stale_acceleration, results, later):
    """As `active_pairs.examine`, for the pairs `which` (M,) that nobody looks at in this step.

    Who touched goes on touching, UNRESOLVED, with the distance of the centres and a bound that holds whatever it is.
    Who did not is UNRESOLVED from now on. Where the bounding spheres are apart, neither. Returns the number in `later`.
    """
    n_later = 0
    for at in range(which.size):
        k = which[at]
        pair, event = pairs[k], events[k]
        i, j = pair.i, pair.j
        px, py, pz, age_i, age_j = relative_now(bodies, i, j, now)
        widen = 0.5 * stale_acceleration * (age_i * age_i + age_j * age_j)
        reach = bodies.motion[i].radius + bodies.motion[j].radius + widen
        distance = sqrt(px * px + py * py + pz * pz)
        touching = pair.touched == 1 and distance <= (reach + margin) * (1.0 + 1e-14)
        stays = touching
        predicted = bodies.motion[i].time == now or bodies.motion[j].time == now
        if not touching and not (predicted and has_changed(bodies, event)):
            since = event.lower
            end = min(bodies.motion[i].cover, bodies.motion[j].cover)
            bound_impact(bodies, i, j, now, end, margin, event)
            if event.status != CLEAR:
                if event.lower > now:
                    later[n_later] = event
                    n_later += 1
                else:
                    event.lower = min(since, now)  # who waits longest is looked at first
                    stays = True
        if touching:
            _write_bound(bodies, i, j, px, py, pz, distance, reach, age_i, age_j, results[k])
        pair.touching = 1 if touching else 0
        pair.leaving = 0 if stays else 1
    return n_later


@device
def _write_bound(bodies, i, j, px, py, pz, distance, reach, age_i, age_j, result):
    """A contact of which only the bounding spheres are known: the true distance is within reach of the centres'."""
    result[:] = 0.0
    result[0] = distance
    result[1] = 1.0
    if distance > 0.0:
        result[1], result[2], result[3] = px / distance, py / distance, pz / distance
    for c in range(3):
        result[4 + c] = position_now(bodies, i, age_i, c)
    result[7], result[8], result[9] = result[4] + px, result[5] + py, result[6] + pz
    result[BOUND] = reach
    for c in range(3):
        result[CLOSING] -= relative_velocity_now(bodies, i, age_i, j, age_j, c) * result[1 + c]
    result[SHAPE_I], result[SHAPE_J] = bodies.first_shape[i], bodies.first_shape[j]
    result[STATUS] = UNRESOLVED


_WAIT = np.dtype([("lower", np.float64), ("key", np.uint64)])
"""Since when an active pair waits (s), and what decides among equals; sorted as events are."""


@kernel
def _by_turns(bodies, pairs, events, step, waits, order, turns):
    """`urgency` into turns (n,) int64; waits (n,) _WAIT and order (n,) int64: scratch. Returns how many are cheap."""
    for k in range(pairs.size):
        waits[k].lower = events[k].lower
        waits[k].key = ((pairs[k].key ^ step) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)
    sort_order(waits, order, turns)
    n = left = 0
    for k in order:
        if is_cheap(bodies, pairs[k].i, pairs[k].j):
            turns[n] = k
            n += 1
        else:
            order[left] = k
            left += 1
    cheap = n
    apart = touched = 0  # how far each of the two has come
    while n < pairs.size:
        while apart < left and pairs[order[apart]].touched == 1:
            apart += 1
        if apart < left:
            turns[n] = order[apart]
            n, apart = n + 1, apart + 1
        while touched < left and pairs[order[touched]].touched == 0:
            touched += 1
        if touched < left:
            turns[n] = order[touched]
            n, touched = n + 1, touched + 1
    return cheap


def urgency(
    bodies: Bodies, pairs: NDArray[np.void], events: NDArray[np.void], step: int
) -> tuple[NDArray[np.int64], int]:
    """The order in which to look at active pairs, and how many are cheap, which come first and cost nothing.

    The rest by turns: those that did not touch, since their certified time ran out, and those that did, since they were
    looked at last. Ties change from step to step, so that nobody waits forever.
    """
    order, turns = np.empty((2, len(pairs)), np.int64)
    cheap = _by_turns(bodies, pairs, events, np.uint64(step), np.empty(len(pairs), _WAIT), order, turns)
    return turns, int(cheap)

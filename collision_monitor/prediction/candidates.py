"""Which pairs a body that starts a new motion has to be predicted against."""

from __future__ import annotations

import numpy as np

from collision_monitor._jit import device, kernel
from collision_monitor.broad_phase.hashed_grid import query_box
from collision_monitor.prediction.time_of_impact import CLEAR, body_impact


@device
def _allowed(allowed, id_a, id_b):
    """Is the pair in the sorted keys (smaller id << 32 | larger id)?"""
    if allowed.size == 0:
        return False
    key = (np.uint64(min(id_a, id_b)) << np.uint64(32)) | np.uint64(max(id_a, id_b))
    k = np.searchsorted(allowed, key)
    return k < allowed.size and allowed[k] == key


@kernel
def find_partners(grid, which, is_new, pairs):
    """Pairs of each body in `which` (M,) with all whose swept box meets its own, each pair once, into pairs (P, 2).

    is_new (N,) bool marks the bodies in `which`. Returns how many there are; more than P: call again with more room.
    """
    found = np.empty(grid.box.size, np.int32)
    n = 0
    for k in range(which.size):
        i = which[k]
        for m in range(query_box(grid, i, found)):
            j = found[m]
            if is_new[j] and j < i:
                continue
            if n < pairs.shape[0]:
                pairs[n, 0] = i
                pairs[n, 1] = j
            n += 1
    return n


@kernel
def keep_checked(bodies, allowed, pairs):
    """Move the pairs (P, 2) that are checked to the front; returns how many.

    Static pairs, groups that ignore each other and allowed pairs are left out.
    """
    n = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if bodies.static[i] and bodies.static[j]:
            continue
        if (bodies.group[i] & bodies.mask[j]) == 0 or (bodies.group[j] & bodies.mask[i]) == 0:
            continue
        if _allowed(allowed, bodies.motion[i].id, bodies.motion[j].id):
            continue
        pairs[n, 0], pairs[n, 1] = i, j
        n += 1
    return n


@kernel
def predict_pairs(table, parts, bodies, pairs, now, margin, tolerance, budget, events, scratch):
    """First impacts of pairs (P, 2) from `now` until both bodies' cover times, into events (IMPACT).

    Returns (how many impacts, distance queries made).
    """
    n = queries = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        end = min(bodies.motion[i].cover, bodies.motion[j].cover)
        queries += body_impact(table, parts, bodies, i, j, now, end, margin, tolerance, budget, scratch, events[n])
        if events[n].status != CLEAR:
            n += 1
    return n, queries

"""Which pairs a body that starts a new motion, or is predicted further, has to be predicted against."""

from __future__ import annotations

import numpy as np

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.broad_phase.hashed_grid import query_box
from collision_monitor.broad_phase.region import regions_overlap
from collision_monitor.prediction.motion import swept_box


@device
def _allowed(allowed, id_a, id_b):
    """Is the pair in the sorted keys (smaller id << 32 | larger id)?"""
    if allowed.size == 0:
        return False
    key = (np.uint64(min(id_a, id_b)) << np.uint64(32)) | np.uint64(max(id_a, id_b))
    k = np.searchsorted(allowed, key)
    return k < allowed.size and allowed[k] == key


@inlined
def _finds(bodies, is_new, i, j):
    """Of a pair whose boxes meet: is it for i, which starts anew or is predicted further, to look at what is new?

    Where both are new, for the one that was predicted less far, or else has the smaller slot; and there is nothing to
    look at with one that is predicted no further than i was before.
    """
    covered = bodies.motion[i].covered
    if not is_new[i]:
        return False
    if not is_new[j]:
        return bodies.motion[j].cover > covered
    other = bodies.motion[j].covered
    return covered < other or (covered == other and i < j)


@kernel
def find_partners(bodies, grid, which, is_new, now, margin, found, pairs):
    """Pairs of each body in `which` (M,) with all whose swept box meets its own, each pair once, into pairs (P, 2).

    Only what a body sweeps after the time until which it was predicted before can meet what is not known yet.
    is_new (N,) bool marks the bodies in `which`, found (N,) int32 is scratch. Returns how many there are; more than P:
    call again with more room.
    """
    n = 0
    for k in range(which.size):
        i = which[k]
        swept = swept_box(bodies, i, max(now, bodies.motion[i].covered), margin)
        for m in range(query_box(grid, swept, i, found)):
            j = found[m]
            if not _finds(bodies, is_new, i, j):
                continue
            if n < pairs.shape[0]:
                pairs[n, 0] = i
                pairs[n, 1] = j
            n += 1
    return n


@kernel
def keep_new(bodies, grid, pairs, is_new, now, margin):
    """Move those of the pairs (P, 2) of overlapping boxes, one of them new, to the front that `find_partners` finds.

    Returns how many. Where most boxes are looked at anyway, all their pairs are found sooner by one sweep.
    """
    n = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        if not _finds(bodies, is_new, i, j):
            i, j = j, i
            if not _finds(bodies, is_new, i, j):
                continue
        covered = bodies.motion[i].covered
        if covered > now:  # else what is new of it is its whole box
            swept = swept_box(bodies, i, covered, margin)
            if not regions_overlap(swept, grid.box[j]):
                continue
        pairs[n, 0], pairs[n, 1] = i, j
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
        if _allowed(allowed, bodies.id[i], bodies.id[j]):
            continue
        pairs[n, 0], pairs[n, 1] = i, j
        n += 1
    return n

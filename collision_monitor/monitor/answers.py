"""From active pairs and pending events to the records that are published."""

from __future__ import annotations

from math import inf, nan
from typing import Final

import numpy as np

from collision_monitor._jit import kernel
from collision_monitor.prediction.body_contact import BOUND, CLOSING, SHAPE_I, SHAPE_J, STATUS
from collision_monitor.prediction.impact_record import BOUND_ONLY, TREE_BOUND
from collision_monitor.records import CONTACT, PREDICTION, Phase, PredictionStatus

UNRESOLVED: Final = int(PredictionStatus.UNRESOLVED)

CONTACT_NUMBERS: Final = 13
"""float64 numbers at the front of a records.CONTACT; the first uint32 behind them has index 26."""
PREDICTION_NUMBERS: Final = 13
assert CONTACT.itemsize == 8 * CONTACT_NUMBERS + 32
assert PREDICTION.itemsize == 8 * PREDICTION_NUMBERS + 24


@kernel
def write_contacts(pairs, results, bodies, shape_index, now, floats, words, octets):
    """Contacts of the pairs that touch or have just ended; returns how many.

    floats (n, 17), words (n, 34), octets (n, 136): one array of records.CONTACT seen as float64, uint32 and uint8.
    """
    n = 0
    for k in range(pairs.size):
        pair = pairs[k]
        if pair.touching == 0 and pair.touched == 0:
            continue
        ids = pair.key
        words[n, 26] = ids >> np.uint64(32)
        words[n, 27] = ids & np.uint64(0xFFFFFFFF)
        floats[n, 12] = now - pair.since
        words[n, 28:32] = 0
        octets[n, 128:136] = 0
        octets[n, 130], octets[n, 131] = bodies.model[pair.i], bodies.model[pair.j]
        octets[n, 135] = 1
        if pair.touching == 1:
            floats[n, 0] = results[k, 0]
            floats[n, 1] = results[k, BOUND]
            for c in range(6):
                floats[n, 2 + c] = results[k, 4 + c]
            for c in range(3):
                floats[n, 8 + c] = results[k, 1 + c]
            floats[n, 11] = results[k, CLOSING]
            words[n, 28] = shape_index[int(results[k, SHAPE_I])]
            words[n, 29] = shape_index[int(results[k, SHAPE_J])]
            words[n, 30] = int(results[k, 12])
            words[n, 31] = int(results[k, 14])
            octets[n, 128] = PERSIST if pair.touched == 1 else BEGIN
            octets[n, 129] = int(results[k, STATUS])
            octets[n, 132] = int(results[k, 11])
            octets[n, 133] = int(results[k, 13])
        else:
            floats[n, 0:12] = nan
            octets[n, 128] = END
        n += 1
    return n


@kernel
def write_predictions(
    pairs, active, pending, bodies, shape_index, now, horizon, stale_after, floats, words, octets, slots
):  # fmt: skip
    """Predictions of the active pairs that do not touch, then of the pending events within the horizon.

    floats (n, 16), words (n, 32), octets (n, 128): one array of records.PREDICTION; slots (n, 2): of the bodies.
    Returns how many.
    """
    n = 0
    for k in range(pairs.size + pending.size):
        if k < pairs.size:
            if pairs[k].touching == 1 or pairs[k].leaving == 1:
                continue
            event = active[k]
        else:
            event = pending[k - pairs.size]
            if event.lower > now + horizon:
                break
        i, j = event.i, event.j
        slots[n, 0], slots[n, 1] = i, j
        floats[n, 0] = max(event.lower - now, 0.0)
        floats[n, 1] = max(event.upper - now, 0.0) if event.upper < inf else inf
        floats[n, 2:6] = nan
        floats[n, 6], floats[n, 7], floats[n, 8] = event.point_x, event.point_y, event.point_z
        floats[n, 9], floats[n, 10], floats[n, 11] = event.normal_x, event.normal_y, event.normal_z
        floats[n, 12] = event.closing_speed
        words[n, 26] = event.key >> np.uint64(32)
        words[n, 27] = event.key & np.uint64(0xFFFFFFFF)
        words[n, 28] = shape_index[event.shape_i]
        words[n, 29] = shape_index[event.shape_j]
        status = event.status
        if bodies.excess[i] + bodies.excess[j] > 0.0:
            # the models meet; whether and when the objects do is not known
            status = UNRESOLVED
            floats[n, 1] = inf
        octets[n, 120] = status
        octets[n, 121] = BOUND_ONLY if event.method == TREE_BOUND else event.method
        octets[n, 122], octets[n, 123] = bodies.model[i], bodies.model[j]
        stale_i = not bodies.static[i] and now - bodies.time[i] > stale_after
        stale_j = not bodies.static[j] and now - bodies.time[j] > stale_after
        octets[n, 124] = 1 if stale_i or stale_j else 0
        octets[n, 125:128] = 0
        n += 1
    return n


@kernel
def chain_digest(digest, words):
    """64-bit digest of `digest` and then words (n,) uint64, in order; four independent lanes, mixed at the end.

    It tells equal answers from unequal ones; it is not meant to resist someone who forges them.
    """
    prime = np.uint64(0x9E3779B97F4A7C15)
    shift = np.uint64(31)
    a = digest ^ np.uint64(0x243F6A8885A308D3)
    b = digest ^ np.uint64(0x13198A2E03707344)
    c = digest ^ np.uint64(0xA4093822299F31D0)
    d = digest ^ np.uint64(0x082EFA98EC4E6C89)
    n = words.size - words.size % 4
    for k in range(0, n, 4):
        a = (a ^ words[k]) * prime
        b = (b ^ words[k + 1]) * prime
        c = (c ^ words[k + 2]) * prime
        d = (d ^ words[k + 3]) * prime
        a ^= a >> shift
        b ^= b >> shift
        c ^= c >> shift
        d ^= d >> shift
    for k in range(n, words.size):
        a = (a ^ words[k]) * prime
        a ^= a >> shift
    for lane in (b, c, d, np.uint64(words.size)):
        a = (a ^ lane) * prime
        a ^= a >> shift
    return a


PERSIST: Final = int(Phase.PERSIST)


BEGIN: Final = int(Phase.BEGIN)


END: Final = int(Phase.END)

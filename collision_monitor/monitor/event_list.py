"""Stage 5, event list: keep the predicted impacts sorted by the time until which each pair is certified apart.

The list is a sorted array instead of a heap. A pair leaves the event list in one of three ways: `take_due` takes the
events that are due off the front, `add` drops those whose motions changed (lazy invalidation by the bodies' versions)
while it merges new ones in, in one pass, and `replace` exchanges bounds for better ones. `clear` empties the list. The
published predictions are the front part of the list.
Source: lecture slides "List of collisions": ordered on time, only the first has to be examined.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel
from collision_monitor._jit.settled import settled
from collision_monitor.impact.impact_record import BOUND_ONLY, HIT, IMPACT, UNRESOLVED, holds
from collision_monitor.monitor.state.snapshot import Facts, Snapshot, Stage
from collision_monitor.motion.bodies import BodyTable
from collision_monitor.records import joined

Events = NDArray[np.void]
Versions = NDArray[np.uint32]

NO_EVENTS: Final = np.zeros(0, IMPACT)


@device
def _before(a: Any, b: Any) -> bool:
    return a.lower < b.lower or (a.lower == b.lower and a.key < b.key)


@kernel
def sort_order(events: Any, order: Any, spare: Any) -> None:
    """Write the order of events by (lower, key) into order (n,) int64: merge sort of runs sorted by insertion.

    spare (n,) int64: scratch.
    """
    n = events.size
    for start in range(0, n, 16):
        for k in range(start, min(start + 16, n)):
            m = k
            while m > start and _before(events[k], events[order[m - 1]]):
                order[m] = order[m - 1]
                m -= 1
            order[m] = k
    source, target = order, spare
    width = 16
    while width < n:
        for start in range(0, n, 2 * width):
            a, a_end = start, min(start + width, n)
            b, b_end = a_end, min(start + 2 * width, n)
            for m in range(start, b_end):
                if a < a_end and (b >= b_end or not _before(events[source[b]], events[source[a]])):
                    target[m] = source[a]
                    a += 1
                else:
                    target[m] = source[b]
                    b += 1
        source, target = target, source
        width *= 2
    for m in range(n):
        order[m] = source[m]


@settled
@kernel
def count_until(events: Any, time: float) -> int:
    """Count the events with `lower` <= time (s) in a sorted array: they are at its front."""
    low, high = 0, events.size
    while low < high:
        middle = (low + high) // 2
        if events[middle].lower <= time:
            low = middle + 1
        else:
            high = middle
    return low


@kernel
def take_due(events: Any, version: Any, now: float, due: Any) -> tuple[int, int]:
    """Write the events that are due by `now` and still hold into `due`. Returns (number due, number written)."""
    passed = n = 0
    while passed < events.size and events[passed].lower <= now:
        if holds(version, events[passed]):
            due[n] = events[passed]
            n += 1
        passed += 1
    return passed, n


@kernel
def merge(old: Any, new: Any, order: Any, version: Any, merged: Any) -> int:
    """Merge `old`, sorted, and `new`, sorted by `order`. Drop events of `old` that do not hold. Return the length."""
    i = k = n = 0
    while i < old.size or k < new.size:
        if i < old.size and not holds(version, old[i]):
            i += 1
        elif k >= new.size or (i < old.size and not _before(new[order[k]], old[i])):
            merged[n] = old[i]
            i += 1
            n += 1
        else:
            merged[n] = new[order[k]]
            k += 1
            n += 1
    return n


@inlined
def _hash(key: Any, mask: Any) -> Any:
    return np.int64(((key * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(32)) & np.uint64(mask))


@device
def _place(key: int, new: Any, place: Any) -> int:
    """Position of the key, or of the free slot for it, in the hash table `place` of indices into `new`.

    Its size is a power of two; -1: free.
    """
    mask = place.size - 1
    at = _hash(key, mask)
    while place[at] >= 0 and new[place[at]].key != key:
        at = (at + 1) & mask
    return at


@settled
@kernel
def keep_first(new: Any, bodies: BodyTable, pending: Any, pairs: Any, room: Any, keep: Any) -> int:
    """`EventList.first_of_pairs`; returns their number. room (R,) int32: a hash table. keep (n,) bool: all True."""
    later = 0
    for k in range(new.size):
        later += _was_predicted(new[k], bodies)
    if later == 0:
        return new.size
    size = 4
    while size < 4 * later:
        size *= 2
    place = room[:size]
    place[:] = -1
    for k in range(new.size):
        if _was_predicted(new[k], bodies):
            place[_place(new[k].key, new, place)] = k
    for k in range(pending.size):
        at = place[_place(pending[k].key, new, place)]
        if at >= 0 and holds(bodies.version, pending[k]):
            keep[at] = False
            if pending[k].status == UNRESOLVED and new[at].status == HIT:
                lower = pending[k].lower
                pending[k] = new[at]
                pending[k].lower = lower
            elif pending[k].status == UNRESOLVED and new[at].method == BOUND_ONLY:
                pending[k].method = BOUND_ONLY  # so that it is refined: the new one is only a bound, and may settle it
    for k in range(pairs.size):
        if pairs[k].leaving == 0:
            at = place[_place(pairs[k].key, new, place)]
            if at >= 0:
                keep[at] = False
    n = 0
    for k in range(new.size):
        if keep[k]:
            new[n] = new[k]
            n += 1
    return n


@inlined
def _was_predicted(event: Any, bodies: BodyTable) -> bool:
    """Whether its pair was predicted before this step, by motions that still hold."""
    return min(bodies.motion[event.i].covered, bodies.motion[event.j].covered) > -inf


def both(a: Events, b: Events) -> Events:
    """Concatenate events; without a copy if one of the arrays has none."""
    if not len(a):
        return b
    return joined([a, b]) if len(b) else a


class EventList(Stage):
    """The predicted impacts (IMPACT), sorted by (lower, key)."""

    SAVED = ("events",)
    CACHES = ("_room", "_spare")

    def __init__(self) -> None:
        self._room: Events = np.empty(256, IMPACT)
        self._spare: Events = np.empty(256, IMPACT)
        self.events: Events = self._room[:0]
        """The pending events, sorted; a view, which the next `add` replaces."""

    def __len__(self) -> int:
        return len(self.events)

    def clear(self) -> None:
        """Forget all events."""
        self.events = self._room[:0]

    def take_due(self, version: Versions, now: float) -> Events:
        """Remove the events due by `now`: their pairs leave the event list here. Return those that still hold."""
        count = count_until(self.events, now)
        if not count:
            return NO_EVENTS
        due = np.empty(count, IMPACT)
        passed, n = take_due(self.events, version, now, due)
        self.events = self.events[passed:]
        return due[:n]

    def take_due_with(self, new: Events, version: Versions, now: float) -> tuple[Events, Events]:
        """Remove the events due by `now`. Return them with those of `new` that are due, and the others of `new`."""
        due = self.take_due(version, now)
        if not len(new):
            return due, new
        is_due = new["lower"] <= now
        return both(due, new.compress(is_due)), new.compress(~is_due)

    def until(self, time: float) -> Events:
        """The events with `lower` <= time (s): a view."""
        return self.events[: count_until(self.events, time)]

    def first_of_pairs(self, new: Events, bodies: BodyTable, active: NDArray[np.void]) -> Events:
        """Move the events of `new` (IMPACT) that are the first impact of their pair to its front, and return them.

        A pair that is predicted further may have an earlier impact among the pending events, or among the active pairs
        (PAIR), which every step examines; then the new event is dropped. If the earlier pending one is UNRESOLVED and
        the new one is a HIT, the pending one keeps its lower end and takes everything else from the new one.
        """
        if not len(new):
            return new
        room = np.empty(4 << (2 * len(new)).bit_length(), np.int32)
        return new[: keep_first(new, bodies, self.events, active, room, np.ones(len(new), np.bool_))]

    def replace(self, which: NDArray[np.intp], new: Events, version: Versions) -> None:
        """Remove the events at the indices `which` from the list, and `add` the new ones."""
        kept = np.ones(len(self.events), np.bool_)
        kept[which] = False
        self.events = self.events.compress(kept)
        self.add(new, version)

    def add(self, new: Events, version: Versions) -> None:
        """Merge `new`, in any order, into the list. Pairs whose motions no longer hold leave the event list here."""
        need = len(self.events) + len(new)
        if not need:
            return
        if need > len(self._spare):
            self._spare = np.empty(2 * need, IMPACT)
        order, spare = np.empty((2, len(new)), np.int64)
        sort_order(new, order, spare)
        n = merge(self.events, new, order, version, self._spare)
        self._room, self._spare = self._spare, self._room
        self.events = self._room[:n]

    def save(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        snapshot.arrays["events"] = self.events.copy()

    def restore(self, snapshot: Snapshot, facts: Facts) -> None:
        """See Stage."""
        events = snapshot.array("events", np.empty(0, IMPACT))
        snapshot.check_slots("events", events)
        self.events = events

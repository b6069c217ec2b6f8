"""The list of predicted impacts, ordered by the time until which each pair is certified apart.

A sorted array instead of a heap: a step takes the due ones off the front, drops those whose motion has changed
(lazy invalidation by version) and merges the new ones in, in one pass; what will be published is its front part.
Source: lecture slides "List of collisions": ordered on time, only the first has to be looked at.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel
from collision_monitor.prediction.time_of_impact import IMPACT

Events = NDArray[np.void]


@device
def _before(a, b):
    return a.lower < b.lower or (a.lower == b.lower and a.key < b.key)


@kernel
def sort_order(events, order):
    """The order of events by (lower, key) into order (n,) int64: merge sort from runs sorted by insertion."""
    n = events.size
    for start in range(0, n, 16):
        for k in range(start, min(start + 16, n)):
            m = k
            while m > start and _before(events[k], events[order[m - 1]]):
                order[m] = order[m - 1]
                m -= 1
            order[m] = k
    source, target = order, np.empty_like(order)
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
    if width > 16:
        order[:] = source.copy()


@kernel
def merge(old, count, new, order, n_new, motion, now, merged, due):
    """old[:count] and new[order[:n_new]] into merged, both sorted; those due by `now` into due instead.

    Events whose bodies' motion (N,) has changed are dropped. Returns (length of merged, length of due).
    """
    i = k = n = n_due = 0
    while i < count or k < n_new:
        if i < count and (motion[old[i].i].version != old[i].version_i or motion[old[i].j].version != old[i].version_j):
            i += 1
            continue
        if k >= n_new or (i < count and not _before(new[order[k]], old[i])):
            event = old[i]
            i += 1
        else:
            event = new[order[k]]
            k += 1
        if event.lower <= now:
            due[n_due] = event
            n_due += 1
        else:
            merged[n] = event
            n += 1
    return n, n_due


class EventList:
    """Predicted impacts (time_of_impact.IMPACT), sorted by (lower, key). Grows as needed."""

    def __init__(self) -> None:
        self._events: Events = np.zeros(256, IMPACT)
        self._spare: Events = np.zeros(256, IMPACT)
        self._due: Events = np.zeros(256, IMPACT)
        self._count = 0

    def __len__(self) -> int:
        return self._count

    @property
    def events(self) -> Events:
        """The pending events in order; a view that the next update replaces."""
        return self._events[: self._count]

    def clear(self) -> None:
        """Forget all events."""
        self._count = 0

    def update(self, new: Events, motion: NDArray[np.void], now: float) -> Events:
        """Merge `new` in, drop what is outdated, and return what is due by `now`, in order (a view)."""
        need = self._count + len(new)
        if need > len(self._spare):
            size = 2 * need
            self._spare = np.zeros(size, IMPACT)
            grown = np.zeros(size, IMPACT)
            grown[: self._count] = self._events[: self._count]
            self._events = grown
            self._due = np.zeros(size, IMPACT)
        order = np.empty(len(new), np.int64)
        sort_order(new, order)
        count, n_due = merge(self._events, self._count, new, order, len(new), motion, now, self._spare, self._due)
        self._events, self._spare, self._count = self._spare, self._events, count
        return self._due[:n_due]

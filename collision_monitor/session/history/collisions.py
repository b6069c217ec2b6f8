"""Finds the collisions of a session, which are unbroken runs of contacts of one pair."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from collision_monitor.impact.impact_record import pair_keys
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.records import ContactStatus, Phase
from collision_monitor.session.history.history import CollisionEvent, Floats, History


def find_collisions(h: History) -> list[CollisionEvent]:
    """Return the unbroken runs of contacts, sorted by begin and pair."""
    touching = h.contacts["phase"] != Phase.END
    rows, steps = h.contacts[touching], h.contact_step[touching]
    keys = pair_keys(rows["id_a"], rows["id_b"])
    order = np.lexsort((steps, keys))
    predicted = _steps_by_pair(pair_keys(h.predictions["id_a"], h.predictions["id_b"]), h.prediction_step)
    found = []
    time, longest = h.times[steps[order]], h.longest_step
    begins = rows["phase"][order] == Phase.BEGIN  # one may end where the next begins
    begins[1:] |= time[1:] - rows["duration"][order][1:] > time[:-1] + NANOSECOND  # unseen, in missing steps
    breaks = np.flatnonzero((np.diff(keys[order]) != 0) | (np.diff(steps[order]) != 1) | begins[1:]) + 1
    for run in np.split(order, breaks) if len(order) else ():
        first, last = int(steps[run[0]]), int(steps[run[-1]])
        pair = (int(rows["id_a"][run[0]]), int(rows["id_b"][run[0]]))
        ended = last + 1 < len(h.times) and h.times[last + 1] - h.times[last] <= longest
        found.append(
            CollisionEvent(
                pair=pair,
                begin=float(h.times[first]),
                end=float(h.times[last + 1]) if ended else None,
                last=float(h.times[last]),
                step=first,
                deepest=float(rows["signed_distance"][run].min()),
                certain=bool((rows["status"][run] == ContactStatus.TOUCHING).any()),
                warned=_warned(h.times, first, predicted.get(int(keys[run[0]]), np.zeros(0, np.int64)), longest),
            )
        )
    return sorted(found, key=lambda c: (c.begin, c.pair))


def _steps_by_pair(keys: NDArray[np.uint64], steps: NDArray[np.int64]) -> dict[int, NDArray[np.int64]]:
    """Return the steps of each pair, ascending."""
    order = np.lexsort((steps, keys))
    breaks = np.flatnonzero(np.diff(keys[order]) != 0) + 1
    return {int(keys[run[0]]): steps[run] for run in np.split(order, breaks) if len(run)}


def _warned(times: Floats, begin: int, steps: NDArray[np.int64], longest: float) -> float:
    """Return how long (s) before step `begin` its unbroken run of predictions began. longest: longest step (s)."""
    if begin == 0:
        return float("nan")
    first = begin
    for step in steps[steps < begin][::-1]:
        if step != first - 1 or times[first] - times[step] > longest:
            break
        first = int(step)
    return float(times[begin] - times[first])

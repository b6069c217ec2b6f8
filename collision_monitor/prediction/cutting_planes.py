"""Cutting planes: find the planes of an obstacle where samples of a motion enter it (Kelley, 1960).

A sample is followed to where it enters the planes found so far. If the shapes are still apart there, the direction of
their gap gives a new plane.
"""

from __future__ import annotations

from math import inf
from typing import Any, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.prediction.obstacle_planes import AT_REST, MOST_PLANES, separation_at, set_plane
from collision_monitor.prediction.straight_samples import enter_plane


class CutSettings(NamedTuple):
    """What counts as entered."""

    margin: float  # m
    tolerance: float  # m: gap up to which a sample has entered
    samples: int  # number of samples to try
    verified: int  # samples that must need no new plane; half of them after the last plane
    turn: Any  # (bool, bool): whether the bodies turn


@inlined
def _next_sample(entry, leave, checked, samples, briefest, cursor):
    """Sample that enters and is not checked: the one that leaves soonest, or the first from `cursor` on; -1: none."""
    chosen, shortest = -1, inf
    if briefest:
        for n in range(samples):
            length = leave[n] - entry[n]
            if length >= 0.0 and length < shortest and checked[n] == 0.0:
                chosen, shortest = n, length
    else:
        for n in range(cursor, samples):
            if leave[n] >= entry[n] and checked[n] == 0.0:
                chosen = n
                break
    return chosen


@device
def _cut(table, pair, n, t, direction, error, k, settings, memory):
    """Add the plane along the direction that separates sample n at t. Its normal may turn with a body.

    The best is the one that the fewest samples enter. Returns whether the time at which sample n enters has changed.
    """
    obstacle, off, samples, entry, leave = memory.obstacle, memory.off, settings.samples, memory.entry, memory.leave
    trial_entry, trial_leave = memory.trial[0], memory.trial[1]
    a, b, plane = pair.a, pair.b, obstacle.planes[k, obstacle.count[k]]
    closer = settings.margin - 0.5 * settings.tolerance  # between planes the obstacle is farther by up to a tolerance
    best, fewest = AT_REST, samples + 1
    if settings.turn[0] or settings.turn[1]:
        for mode in range(3):
            if mode == AT_REST or settings.turn[mode]:
                set_plane(table, a, b, direction, mode, k, t, closer, error, obstacle, plane)
                for m in range(samples):
                    trial_entry[m] = entry[m]
                    trial_leave[m] = leave[m]
                enter_plane(plane, off, 0, samples, trial_entry, trial_leave)
                hits = 0
                for m in range(samples):
                    hits += 1 if trial_entry[m] <= trial_leave[m] else 0
                if hits < fewest:
                    best, fewest = mode, hits
    set_plane(table, a, b, direction, best, k, t, closer, error, obstacle, plane)
    before = entry[n]
    enter_plane(plane, off, 0, samples, entry, leave)
    obstacle.count[k] += 1
    return entry[n] > before or entry[n] > leave[n]


@device
def cut_planes(table, parts, pair, k, settings, memory, scratch):
    """Add planes to segment k of memory.obstacle for a pair of shapes (ShapePair), where the first samples need them.

    Every second sample is the one that passes the planes most briefly, because it may miss the shapes.
    memory.alone: times of the samples that met in an earlier segment, else infinite; it gets those of this segment.
    """
    obstacle, off, samples = memory.obstacle, memory.off, settings.samples
    entry, leave, checked, times = memory.entry, memory.leave, memory.checked, memory.alone
    begin, end = obstacle.time[k], obstacle.time[k + 1]
    for n in range(samples):
        entry[n] = begin if times[n] == inf else inf
        leave[n] = end
        checked[n] = 0.0
    for m in range(obstacle.count[k]):
        enter_plane(obstacle.planes[k, m], off, 0, samples, entry, leave)
    verified = cursor = 0
    briefest = True
    while verified < settings.verified and obstacle.count[k] < MOST_PLANES:
        n = _next_sample(entry, leave, checked, samples, briefest, cursor)
        if n < 0 and briefest:
            break
        briefest = not briefest
        if n < 0:
            continue
        if briefest:
            cursor = n
        t, out = entry[n], scratch.out
        checked[n] = 1.0
        error = (off[0, n] + t * off[3, n], off[1, n] + t * off[4, n], off[2, n] + t * off[5, n])
        gap = separation_at(table, parts, pair, t, error, obstacle, scratch) - settings.margin
        direction = (out[0], out[1], out[2])
        if gap > settings.tolerance and _cut(table, pair, n, t, direction, error, k, settings, memory):
            checked[n] = 0.0
            verified //= 2
        else:
            verified += 1
    for n in range(samples):
        if entry[n] <= leave[n]:
            times[n] = entry[n]

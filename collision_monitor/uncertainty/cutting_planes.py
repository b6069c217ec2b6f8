"""Cutting planes: find the planes of an obstacle where samples of a motion enter it (Kelley, 1960).

A sample is followed to where it enters the planes found so far. If the shapes are still apart there, the direction of
their gap gives a new plane.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

from numpy import float32

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.narrow_phase.gjk import Accuracy
from collision_monitor.uncertainty.flat_sides import has_side
from collision_monitor.uncertainty.obstacle_planes import (
    AT_REST,
    MOST_PLANES,
    NOT_OFF,
    PLANE_SIZE,
    separation_at,
    set_plane,
)
from collision_monitor.uncertainty.samples.live_samples import drop_missed, place_of
from collision_monitor.uncertainty.samples.sample_gaps import (
    HALF,
    NEVER,
    NOT_TURNED,
    ONE,
    ZERO,
    enter_planes,
    gaps_at_begin,
    set_bends,
)

TRIED: Final = 32
"""Number of samples that decide how the normal of a plane turns: a block of the samples, which are spread out. The
first one if the search is careful, so that all planes of a segment are compared alike."""

BLOCK: Final = 256
"""Number of samples among which the one that passes most briefly is sought; all if the search is careful."""


NO_MODE: Final = -1
"""In place of a mode, see obstacle_planes.py: all are to be tried."""

LEAST_BEND: Final = 0.1
"""Part of the tolerance by which the stated gap along a plane may bend if all gaps count as straight lines."""

SLACK: Final = 0.1
"""Part of the tolerance by which a plane may be farther from the obstacle than one that touches it."""

COARSER: Final = 4.0
"""Factor by which the tolerance of a segment may grow, to the largest gap that no plane closes: the gaps there
deviate too far from parabolas for less."""


MOST_APART: Final = 8
"""One in this many of the verified samples, or one, may be apart by more than COARSER tolerances behind all planes.
Cylinders that lean need more than MOST_PLANES for all samples, but few samples need the others."""


class CutSettings(NamedTuple):
    """What counts as entered."""

    margin: float  # m
    tolerance: float  # m: gap up to which a sample has entered
    fineness: Any  # (float, 1/s): factor of the tolerance now, up to 1, and its growth
    pilot: int  # number of samples of the pilot
    follows: Any  # (bool, bool): whether normals may turn with the bodies
    turning: Any  # (int, int): how errors of orientation turn the bodies, see sample_gaps
    careful: bool  # errors of orientation are large: compare more samples


@inlined
def plane_margin(settings: CutSettings) -> float:
    """Gap (m) at which a sample is behind a plane. Between planes the obstacle is farther by up to a tolerance."""
    return settings.margin - 0.5 * settings.tolerance


@inlined
def _part(settings: CutSettings, t: float) -> float:
    """Factor of the tolerances at time t."""
    return min(settings.fineness[0] + settings.fineness[1] * t, 1.0)


@inlined
def _briefest(entry: Any, leave: Any, checked: Any, first: int, last: int, inside: Any) -> int:
    """Sample of first:last that enters, is not checked, and leaves soonest; -1: none. inside (S,): scratch."""
    entry, leave, checked, inside = entry[first:last], leave[first:last], checked[first:last], inside[first:last]
    for n in range(inside.size):  # without branches, see sample_gaps.py
        length = leave[n] - entry[n]
        inside[n] = (length if length >= ZERO else NEVER) + checked[n]
    chosen, shortest = -1 - first, NEVER
    for n in range(inside.size):
        if inside[n] < shortest:
            chosen, shortest = n, inside[n]
    return first + chosen


@inlined
def _entering(entry: Any, leave: Any, checked: Any, first: int, last: int) -> int:
    """First sample of first:last that enters and is not checked; -1: none."""
    entry, leave, checked = entry[first:last], leave[first:last], checked[first:last]
    for n in range(entry.size):
        if leave[n] >= entry[n] and checked[n] == 0.0:
            return first + n
    return -1


@inlined
def _sole_mode(table: Any, pair: Any, n: Vector, settings: CutSettings, obstacle: Any) -> int:
    """Mode of a plane along n (3,) where obstacle.placed has the shapes; NO_MODE: any, both have a side along it.

    A plane along a side of a body that does not turn is at rest. If it turned with the other body, and that with the
    error of one sample, it would cut deep into a wall for all others.
    """
    has_a = has_side(table, pair.a, obstacle.placed[0], n)
    has_b = has_side(table, pair.b, obstacle.placed[1], n)
    if (has_a and has_b) or settings.careful:
        return NO_MODE
    if has_a and settings.follows[0]:
        return 0
    return 1 if has_b and settings.follows[1] else AT_REST


@inlined
def _copy(entry: Any, leave: Any, to_entry: Any, to_leave: Any, first: int, last: int) -> None:
    """Copy the intervals of samples first:last."""
    entry, leave, to_entry, to_leave = entry[first:last], leave[first:last], to_entry[first:last], to_leave[first:last]
    for n in range(entry.size):
        to_entry[n] = entry[n]
        to_leave[n] = leave[n]


@device
def _cut(
    table: Any, pair: Any, n: int, samples: int, direction: Vector, k: int, settings: CutSettings, memory: Any
) -> bool:
    """Add the plane along the direction that separates sample n. Its normal may turn with a body.

    The gap counts as a parabola in the segment. Where another corner of a long body comes nearest on the way, it is
    larger, and the plane separates nothing. So the normal has to shorten the time of sample n inside. If only one shape
    has a side along the plane, the normal turns with it, and is at rest if none has. Otherwise, or if that separates
    nothing, the best one is that behind which TRIED samples spend the least time. Returns whether there is one.
    """
    obstacle, rows, entry, leave = memory.obstacle, memory.rows, memory.entry, memory.leave
    count, nodes = obstacle.count[k], obstacle.node[k : k + 2]
    planes, margin, before = obstacle.planes[k, count : count + 1], plane_margin(settings), leave[n] - entry[n]
    middle, least = obstacle.middle[k], LEAST_BEND * settings.tolerance
    turning, tried = settings.turning, _sole_mode(table, pair, direction, settings, obstacle)
    trial_entry, trial_leave = memory.trial[0], memory.trial[1]
    if tried != NO_MODE:
        set_plane(direction, tried, obstacle, planes[0])
        set_bends(table, pair, planes[0], nodes, middle, least)
        _copy(entry, leave, trial_entry, trial_leave, 0, samples)
        enter_planes(table, pair, planes, margin, turning, nodes, middle, 0, samples, rows, trial_entry, trial_leave)
        if trial_leave[n] - trial_entry[n] < before:
            _copy(trial_entry, trial_leave, entry, leave, 0, samples)
            obstacle.count[k] += 1
            return True
    first = 0 if settings.careful else n // TRIED * TRIED
    last = min(first + TRIED, samples)
    best, latest = -1, -inf
    for mode in (AT_REST, 0, 1):
        if mode == tried or (mode != AT_REST and not settings.follows[mode]):
            continue
        set_plane(direction, mode, obstacle, planes[0])
        set_bends(table, pair, planes[0], nodes, middle, least)
        _copy(entry, leave, trial_entry, trial_leave, first, last)
        enter_planes(table, pair, planes, margin, turning, nodes, middle, first, last, rows, trial_entry, trial_leave)
        if n >= last:
            trial_entry[n], trial_leave[n] = entry[n], leave[n]
            enter_planes(table, pair, planes, margin, turning, nodes, middle, n, n + 1, rows, trial_entry, trial_leave)
        if not trial_leave[n] - trial_entry[n] < before:
            continue
        total = 0.0
        for m in range(first, last):
            total += min(max(trial_entry[m] - trial_leave[m], -ONE), ONE)
        if total > latest:
            best, latest = mode, total
    if best < 0:
        return False
    obstacle.count[k] += 1
    set_plane(direction, best, obstacle, planes[0])
    set_bends(table, pair, planes[0], nodes, middle, least)
    enter_planes(table, pair, planes, margin, turning, nodes, middle, 0, samples, rows, entry, leave)
    return True


@inlined
def _time_at(obstacle: Any, k: int, share: float) -> float:
    """Time (s) at this share of segment k."""
    begin = obstacle.node[k].time
    return begin + share * (obstacle.node[k + 1].time - begin)


@inlined
def _separation_of(
    table: Any, parts: Any, pair: Any, n: int, share: float, k: int, turning: Any, accuracy: Accuracy, memory: Any,
    scratch: Any,
) -> float:  # fmt: skip
    """Separation (m) of live sample n at a share of segment k; accuracy: see `separation`."""
    obstacle, off, first, last = memory.obstacle, memory.off, memory.rows.node[0], memory.rows.node[1]
    t, m = _time_at(obstacle, k, share), memory.live[n]
    error = (off[0, m] + t * off[3, m], off[1, m] + t * off[4, m], off[2, m] + t * off[5, m])
    turned_a = _between(first, last, 3, n, share) if turning[0] != NOT_TURNED else NOT_OFF
    turned_b = _between(first, last, 6, n, share) if turning[1] != NOT_TURNED else NOT_OFF
    return separation_at(table, parts, pair, t, error, (turned_a, turned_b), accuracy, obstacle, scratch)


@inlined
def _between(first: Any, last: Any, row: int, n: int, share: float) -> Vector:
    """Vector of sample n in three rows from `row` on, at a share of the way from the array `first` to `last`."""
    return (
        first[row, n] + share * (last[row, n] - first[row, n]),
        first[row + 1, n] + share * (last[row + 1, n] - first[row + 1, n]),
        first[row + 2, n] + share * (last[row + 2, n] - first[row + 2, n]),
    )


@inlined
def _check(
    table: Any, parts: Any, pair: Any, n: int, at: float, samples: int, k: int, tolerance: float,
    settings: CutSettings, memory: Any, scratch: Any,
) -> tuple[bool, float]:  # fmt: skip
    """Add a plane to segment k if sample n is apart at this share of it by more than the tolerance (m).

    Returns whether that shortens its time inside, and the gap (m).
    """
    accuracy = Accuracy(settings.margin + tolerance, SLACK * tolerance)
    separated = _separation_of(table, parts, pair, n, at, k, settings.turning, accuracy, memory, scratch)
    gap = separated - settings.margin
    direction = (scratch.out[0], scratch.out[1], scratch.out[2])
    return gap > tolerance and _cut(table, pair, n, samples, direction, k, settings, memory), gap


@inlined
def cut_extremes(
    table: Any, parts: Any, pair: Any, k: int, extremes: Any, samples: int, settings: CutSettings, memory: Any,
    scratch: Any,
) -> None:  # fmt: skip
    """Add planes to segment k of memory.obstacle where some samples of the pilot, the farthest ones, need them.

    The errors with which convex bodies meet are about a convex set, so that the samples between them meet if they do.
    samples: number of live ones.
    """
    obstacle, entry, leave = memory.obstacle, memory.entry, memory.leave
    for extreme in extremes:
        n = place_of(extreme, memory.live, samples)
        while n >= 0 and entry[n] <= leave[n] and obstacle.count[k] < MOST_PLANES:
            at = entry[n]
            tolerance = settings.tolerance * _part(settings, _time_at(obstacle, k, at))
            if not _check(table, parts, pair, n, at, samples, k, tolerance, settings, memory, scratch)[0]:
                break


@inlined
def cut_planes(
    table: Any, parts: Any, pair: Any, k: int, samples: int, wanted: int, settings: CutSettings, memory: Any,
    scratch: Any,
) -> tuple[bool, int]:  # fmt: skip
    """Add planes to segment k of memory.obstacle for a pair of shapes (ShapePair), where the live samples need them.

    Every second sample is the one that passes the planes most briefly in a BLOCK of samples, in turn, because it may
    miss the shapes. The search ends when `wanted` samples needed no plane, half of them after the last plane.
    `begin_segment` comes before it. Returns whether there are planes enough, and the number of samples that are live
    then. Once the segment is full of planes, further ones are used but not kept. Too many samples may need one then, or
    no plane may separate them, because gaps deviate far from parabolas: see MOST_APART.
    """
    obstacle, entry, leave, checked = memory.obstacle, memory.entry, memory.leave, memory.checked
    for n in range(samples):
        checked[n] = 0.0
    block, cursor, verified, idle = k, 0, 0, 0
    tolerance, coarsest = settings.tolerance, COARSER * settings.tolerance
    is_brief, apart = False, 0
    while verified < wanted:
        samples, cursor = drop_missed(samples, cursor, settings.turning, memory)
        size = max(samples if settings.careful else min(BLOCK, samples), 1)
        blocks = -(-samples // size)
        if idle >= 2 * blocks:
            break
        is_brief, is_full = not is_brief, obstacle.count[k] >= MOST_PLANES
        tolerance = coarsest if is_full else tolerance
        if is_brief:
            first = block % blocks * size
            n = _briefest(entry, leave, checked, first, min(first + size, samples), memory.trial[0])
            block += 1
        else:
            n = _entering(entry, leave, checked, cursor, samples)
            cursor = n if n >= 0 else samples
        if n < 0:
            idle += 1
            continue
        idle, checked[n] = 0, inf
        at = HALF * (entry[n] + leave[n]) if is_brief else entry[n]
        part = _part(settings, _time_at(obstacle, k, at))
        is_cut, gap = _check(table, parts, pair, n, at, samples, k, part * tolerance, settings, memory, scratch)
        if is_cut and is_full:
            obstacle.count[k] -= 1
            apart += 0 if is_brief else 1
        if is_cut and not is_full:
            checked[n] = 0.0
            verified //= 2
        else:
            verified += 1
            apart += 1 if not is_cut and gap > part * coarsest else 0
            tolerance = min(max(tolerance, gap / part), coarsest)
        if apart > max(1, wanted // MOST_APART):
            return False, samples
    return True, samples


@inlined
def carry_planes(table: Any, pair: Any, k: int, settings: CutSettings, memory: Any) -> None:
    """Start segment k with those planes of the one before that keep most apart a sample of the pilot between the two.

    rows.node[0] has all samples of the pilot at the begin of segment k.
    """
    obstacle, rows, pilot, turning = memory.obstacle, memory.rows, settings.pilot, settings.turning
    margin, begin = plane_margin(settings), obstacle.node[k]
    widest, winner = memory.trial[0, 0:pilot], memory.checked[0:pilot]
    for n in range(pilot):
        widest[n], winner[n] = -inf, -1.0
    for m in range(obstacle.count[k - 1]):
        gaps_at_begin(table, pair, obstacle.planes[k - 1, m], margin, turning, begin, pilot, rows)
        gap, this = rows.gap[0, 0:pilot], float32(m)
        for n in range(gap.size):
            before, widest_before = winner[n] + ZERO, widest[n] + ZERO  # see enter_planes
            winner[n] = this if gap[n] > widest_before else before
            widest[n] = gap[n] if gap[n] > widest_before else widest_before
    for n in range(pilot):
        winner[n] = winner[n] if memory.alone[n] == inf else -1.0
    for m in range(obstacle.count[k - 1]):
        kept = False
        for n in range(pilot):
            kept |= winner[n] == m
        if kept:
            for c in range(PLANE_SIZE):
                obstacle.planes[k, obstacle.count[k], c] = obstacle.planes[k - 1, m, c]
            obstacle.count[k] += 1


@inlined
def begin_segment(table: Any, pair: Any, k: int, samples: int, settings: CutSettings, memory: Any) -> int:
    """Set the intervals of the samples in memory.rows to those behind the planes of segment k. Returns the live ones.

    The intervals are shares of the segment.

    memory.alone (S,): times of the samples that met in an earlier segment, whose intervals are empty, else infinite.
    """
    obstacle, rows, entry, leave, times = memory.obstacle, memory.rows, memory.entry, memory.leave, memory.alone
    for n in range(samples):
        entry[n] = ZERO if times[n] == inf else NEVER
        leave[n] = ONE
        memory.live[n] = n
    live, _ = drop_missed(samples, 0, settings.turning, memory)
    planes, nodes, margin = obstacle.planes[k, 0 : obstacle.count[k]], obstacle.node[k : k + 2], plane_margin(settings)
    middle = obstacle.middle[k]
    for m in range(obstacle.count[k]):
        set_bends(table, pair, planes[m], nodes, middle, LEAST_BEND * settings.tolerance)
    enter_planes(table, pair, planes, margin, settings.turning, nodes, middle, 0, live, rows, entry, leave)
    return live


@inlined
def end_segment(live: int, samples: int, k: int, memory: Any) -> int:
    """Set memory.alone of the live samples that met in segment k; return the number of all that never met."""
    entry, leave, times = memory.entry, memory.leave, memory.alone
    for n in range(live):
        if entry[n] <= leave[n]:
            times[memory.live[n]] = _time_at(memory.obstacle, k, entry[n])
    left = 0
    for n in range(samples):
        left += 1 if times[n] == inf else 0
    return left

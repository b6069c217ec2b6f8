"""Impacts of the samples of two bodies, from the planes that bound the obstacle of each pair of their shapes."""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

import numpy as np

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.impact.body_impact import ImpactQuery, ShapePair, Tube, Window, shape_impact
from collision_monitor.impact.impact_record import CLEAR
from collision_monitor.motion.bodies import next_pair
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.uncertainty.cutting_planes import (
    CutSettings,
    begin_segment,
    carry_planes,
    cut_extremes,
    cut_planes,
    end_segment,
)
from collision_monitor.uncertainty.linear_gaps import is_linear
from collision_monitor.uncertainty.obstacle_planes import (
    APART,
    LOUD,
    MOST_SEGMENTS,
    QUIET,
    set_middles,
    set_nodes,
    split_segment,
)
from collision_monitor.uncertainty.pair_errors import (
    BENDING,
    TURNED,
    are_fine,
    coordinates_in_use,
    fineness,
    spin_rate,
    straight_length,
    turned_at,
    turning_order,
    turning_rate,
)
from collision_monitor.uncertainty.quiet_segments import stay_apart
from collision_monitor.uncertainty.sampled_impacts import SAMPLE_TOLERANCE
from collision_monitor.uncertainty.samples.chosen_samples import choose_samples
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST
from collision_monitor.uncertainty.samples.sample_count import latest
from collision_monitor.uncertainty.samples.sample_gaps import set_samples
from collision_monitor.uncertainty.samples.straight_samples import draw_evenly, set_errors
from collision_monitor.uncertainty.screening import meeting

FACETS: Final = 0.02
"""Distance between the planes and the obstacle, in standard deviations of the gap, up to which no plane is added."""

FACETS_IN_PILOT: Final = 0.06
"""The same for the pilot, which decides how many samples a pair needs, and if only the times matter."""

TURNED_FACETS: Final = 0.04
"""Distance by which errors of orientation of TURNED standard deviations may move a surface beyond the first order."""

MOST_PARTS: Final = 2
SMALL: Final = 0.1
"""If bodies that turn divide the time into more than MOST_PARTS, and errors exceed SMALL rad, or twice SMALL radii of a
shape, the pair is left to the exact method unless it surely meets: it needs so many planes that it is no faster."""

CAREFUL: Final = 0.05
"""Standard deviation of an orientation (rad) above which more samples are compared, no part of the time is left out,
and a pair with more than MOST_PARTS is left to the exact method."""

SPINS: Final = 4.0
"""Standard deviations of the angular velocity above which a body counts as one that turns."""

VERIFIED_IN_PILOT: Final = 4
VERIFIED: Final = 48
"""Samples of the pilot, and of all, that must need no new plane of a segment. Of all, fewer if fewer enter in it. Twice
as many if it is careful."""

SURE_EXTREMES: Final = 4
"""Number of the extreme samples at which the planes of bodies that surely meet are checked: one for each axis of the
position, and one for the velocity along the miss."""

LONGEST: Final = 1.4
"""Factor by which segments may exceed `straight_length` if MOST_SEGMENTS do not suffice: gaps bend twice as much."""

SURE_BENDING: Final = 0.2
"""In place of BENDING for bodies that surely meet, because only their times are sought."""

CORNER_BENDING: Final = 0.05
"""The same for hulls, cones and ellipsoids: where a corner or a rim passes a normal, the gap is no parabola."""

MOST_SPLITS: Final = 6
"""Number of times that a segment of a pair of shapes is divided because its planes do not separate the samples."""

TOO_FAST: Final = -1
"""Number of samples of bodies that turn too fast for planes, or need too many, or finer numbers."""


class PlaneSearch(NamedTuple):
    """Samples for which planes are sought."""

    points: Any  # (DIMENSIONS, S): see normal_samples.SampleColumns
    samples: int  # the first ones of these
    extremes: Any  # indices of those that come first
    verified: int  # number of others that must need no new plane of a segment
    fineness: float  # standard deviations of the gap by which errors of orientation may move a surface unnoticed
    bending: float  # standard deviations by which a gap may deviate from a straight line in a segment


class Laid(NamedTuple):
    """The planes of a pair of shapes."""

    segments: int
    settings: CutSettings
    complete: bool  # whether the segments reach the end, with planes enough


@outlined
def _lay_planes(
    table: Any, parts: Any, pair: ShapePair, errors: Any, search: PlaneSearch, until: float, sampling: Any,
    memory: Any, work: Any,
) -> Laid:  # fmt: skip
    """Bound the obstacle of a pair of shapes (ShapePair) by planes where the samples of the search need them.

    Writes the times of these samples into memory.alone, infinite for those that do not meet. until: s; later impacts do
    not count.
    """
    A, B, a, b = pair
    scratch, alone, sigma, samples = work.scratch, memory.alone, errors.sigma, search.samples
    margin = sampling.query.margin
    tolerance = max(FACETS_IN_PILOT * sigma, sampling.query.tolerance)
    fine = max(search.fineness * sigma, sampling.query.tolerance)
    turning = (turning_order(errors, 0, fine), turning_order(errors, 1, fine))
    flat = table.kind[a] == HALF_SPACE or table.kind[b] == HALF_SPACE
    follows = (
        not flat and errors.radius[0] > 0.0 and turning[0] + spin_rate(A) > 0.0,
        not flat and errors.radius[1] > 0.0 and turning[1] + spin_rate(B) > 0.0,
    )
    careful = max(turned_at(errors, 0), turned_at(errors, 1)) > CAREFUL
    fine_now = fineness(work.joint, errors, tolerance, sampling.query.tolerance)
    settings = CutSettings(margin, tolerance, fine_now, samples, follows, turning, careful)
    if not are_fine(errors, max(FACETS * sigma, sampling.query.tolerance)):
        return Laid(0, settings, False)
    for n in range(samples):
        alone[n] = inf
    wide = Tube(FURTHEST * errors.tube.start, FURTHEST * errors.tube.growth)
    begin, end = meeting(table, parts, pair, sampling.horizon, margin, wide, work)
    end = min(end, until)
    if not begin < end:
        return Laid(0, settings, True)
    length = straight_length(A, B, errors, search.bending)
    if length < end - begin:
        coarse = max(sampling.query.tolerance, SAMPLE_TOLERANCE * sigma)
        roughly = ImpactQuery(margin, coarse, sampling.query.iterations)
        there = Tube(wide.start + wide.growth * begin, wide.growth)
        status, begin, _, _ = shape_impact(table, parts, pair, Window(begin, end), there, roughly, scratch)
        if status == CLEAR or not begin < end:
            return Laid(0, settings, True)
    length = max(length, min((end - begin) / MOST_SEGMENTS, LONGEST * length))
    length = (end - begin) / (1.0 + np.floor((end - begin) / length))
    window = Window(begin, end)
    segments = set_nodes(table, parts, pair, window, length, errors.turning, errors.yaw_only, scratch, memory.obstacle)
    turned = max(turned_at(errors, 0), turned_at(errors, 1))
    large = TURNED * turned > SMALL or sigma > 2.0 * SMALL * min(table.radius[a], table.radius[b])
    spins = spin_rate(A) + spin_rate(B) > SPINS * turning_rate(errors)
    is_rough = segments > MOST_PARTS and large and spins
    if segments > MOST_PARTS and (careful or (is_rough and not sampling.stated)):
        return Laid(segments, settings, False)
    set_middles(table, parts, pair, segments, errors.turning, errors.yaw_only, scratch, memory.obstacle)
    left, skips, obstacle = samples, not flat and search.verified > 0, memory.obstacle
    k, most = 0, min(segments + MOST_SPLITS, MOST_SEGMENTS)
    while k < segments and left > 0:
        if skips and stay_apart(table, parts, pair, k, errors, margin, obstacle, work):
            obstacle.quiet[k] = APART
            k += 1
            continue
        set_samples(obstacle, k, memory.off, search.points, turning, 0, samples, memory.rows)
        if k > 0 and obstacle.quiet[k - 1] != APART and obstacle.count[k] == 0:
            carry_planes(table, pair, k, settings, memory)
        live = begin_segment(table, pair, k, samples, settings, memory)
        cut_extremes(table, parts, pair, k, search.extremes, live, settings, memory, scratch)
        wanted = (1 + careful) * search.verified
        has_enough, live = cut_planes(table, parts, pair, k, live, wanted, settings, memory, scratch)
        if not has_enough:
            if segments == most:
                return Laid(segments, settings, False)
            split_segment(table, parts, pair, k, segments, errors.turning, errors.yaw_only, scratch, obstacle)
            segments += 1
            continue
        before, left = left, end_segment(live, samples, k, memory)
        obstacle.quiet[k] = QUIET if left == before and not settings.careful else LOUD
        k += 1
    return Laid(segments, settings, left == 0 or (obstacle.node[segments].time >= end and not is_rough))


@inlined
def _is_left_out(quiet: Any, k: int, segments: int) -> bool:
    """Whether segment k is left out for all samples: none can meet there, or it is quiet between quiet ones.

    Of all samples, a few may meet in a segment in which none of the pilot does, if it is next to one in which some do.
    """
    if quiet[k] != QUIET:
        return quiet[k] == APART
    return (k == 0 or quiet[k - 1] != LOUD) and (k + 1 >= segments or quiet[k + 1] != LOUD)


@outlined
def _enter_pair(
    table: Any, parts: Any, pair: ShapePair, laid: Laid, errors: Any, points: Any, samples: int, verified: int,
    tolerance: float, memory: Any, work: Any,
) -> bool:  # fmt: skip
    """Lower memory.times to the impacts of the first `samples` with the planes that are laid, and some more.

    verified: number of samples that must need no new plane if all enter in the same segment, or if there is but one;
    tolerance (m): see CutSettings. Returns whether there are planes enough.
    """
    segments, pilots, _ = laid
    settings = CutSettings(
        pilots.margin, tolerance, pilots.fineness, pilots.pilot, pilots.follows, pilots.turning, pilots.careful
    )
    alone, times, obstacle = memory.alone, memory.times, memory.obstacle
    for n in range(samples):
        alone[n] = inf
    fewest = max(VERIFIED_IN_PILOT, verified // (2 * segments - 1)) if verified > 0 or settings.careful else 0
    k, left, most = 0, samples, min(segments + MOST_SPLITS, MOST_SEGMENTS)
    while k < segments and left > 0:
        if _is_left_out(obstacle.quiet, k, segments):
            k += 1
            continue
        set_samples(obstacle, k, memory.off, points, settings.turning, 0, samples, memory.rows)
        live = begin_segment(table, pair, k, samples, settings, memory)
        entering = 0
        for n in range(live):
            entering += 1 if memory.entry[n] <= memory.leave[n] else 0
        wanted = (1 + settings.careful) * max(fewest, verified * entering // samples)
        has_enough, live = cut_planes(table, parts, pair, k, live, wanted, settings, memory, work.scratch)
        if not has_enough:
            if segments == most:
                return False
            split_segment(table, parts, pair, k, segments, errors.turning, errors.yaw_only, work.scratch, obstacle)
            segments += 1
            continue
        left = end_segment(live, samples, k, memory)
        k += 1
    _lower(times, alone, samples)
    return True


@device
def enter_bodies(
    multibody: Any, i: int, j: int, errors: Any, sampling: Any, columns: Any, memory: Any, work: Any
) -> int:
    """Write the times of the samples' impacts of bodies i and j into memory.times.

    work.joint: root of the covariance of the pair. Returns the number of samples, see `choose_samples`, or TOO_FAST.
    """
    table, parts, bodies = multibody
    A, B = work.motion[0], work.motion[1]
    times, pilot, end, points = memory.times, columns.pilot, sampling.horizon, columns.points
    first_a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    set_errors(work.joint, work.frame, errors.time, points, 0, pilot, memory.off)
    for n in range(times.size):
        times[n] = inf
    search = PlaneSearch(points, pilot, columns.extremes, VERIFIED_IN_PILOT, TURNED_FACETS, BENDING)
    a, b = first_a, first_b
    pair = ShapePair(A, B, a, b)
    laid = _lay_planes(table, parts, pair, errors, search, end, sampling, memory, work)
    while True:
        _lower(times, memory.alone, pilot)
        if not laid.complete:
            return TOO_FAST
        a, b = next_pair(parts, first_b, a, b)
        if a < 0:
            break
        pair = ShapePair(A, B, a, b)
        until = min(end, latest(times, pilot))
        laid = _lay_planes(table, parts, pair, errors, search, until, sampling, memory, work)
    until = latest(times, pilot)
    samples = choose_samples(times, columns, coordinates_in_use(errors), sampling, laid.settings.careful, memory.chosen)
    if samples == 0:
        return 0
    meets, points = until < inf, memory.chosen.points
    set_errors(work.joint, work.frame, errors.time, points, pilot, samples, memory.off)
    for n in range(times.size):
        times[n] = inf
    verified = 0 if meets else VERIFIED
    tolerance = max((FACETS_IN_PILOT if meets else FACETS) * errors.sigma, sampling.query.tolerance)
    if not _enter_pair(table, parts, pair, laid, errors, points, samples, verified, tolerance, memory, work):
        return TOO_FAST
    last_a, last_b = pair.a, pair.b  # its planes are still there; those of the others are laid again
    a, b = first_a, first_b
    while a != last_a or b != last_b:
        pair = ShapePair(A, B, a, b)
        laid = _lay_planes(table, parts, pair, errors, search, min(end, until), sampling, memory, work)
        if not laid.complete:
            return TOO_FAST
        if not _enter_pair(table, parts, pair, laid, errors, points, samples, verified, tolerance, memory, work):
            return TOO_FAST
        a, b = next_pair(parts, first_b, a, b)
    return samples


@device
def enter_surely(
    multibody: Any, i: int, j: int, errors: Any, sampling: Any, columns: Any, memory: Any, work: Any
) -> int:
    """`enter_bodies` for bodies that surely meet until errors.time: only the times of their impacts are sought.

    The samples are those of the pilot, with equal weights, because no error matters more than the others.
    """
    table, parts, bodies = multibody
    times, points, samples = memory.times, columns.points, columns.pilot
    draw_evenly(work.joint)
    set_errors(work.joint, work.frame, errors.time, points, 0, samples, memory.off)
    for n in range(samples):
        times[n] = inf
    extremes = columns.extremes[0:SURE_EXTREMES]
    a, first_b = bodies.first_shape[i], bodies.first_shape[j]
    b = first_b
    while a >= 0:
        pair = ShapePair(work.motion[0], work.motion[1], a, b)
        until = min(errors.time, latest(times, samples))
        bending = SURE_BENDING if is_linear(table, a) and is_linear(table, b) else CORNER_BENDING
        search = PlaneSearch(points, samples, extremes, VERIFIED_IN_PILOT, FACETS_IN_PILOT, bending)
        if not _lay_planes(table, parts, pair, errors, search, until, sampling, memory, work).complete:
            return TOO_FAST
        _lower(times, memory.alone, samples)
        a, b = next_pair(parts, first_b, a, b)
    return samples


@inlined
def _lower(times: Any, others: Any, count: int) -> None:
    """Lower the first `count` times to the others."""
    for n in range(count):
        times[n] = min(times[n], others[n])

"""Time and probability of impact of two bodies with uncertain states, from planes that bound the obstacle.

`sampled_impacts.py` follows each sample exactly. Here the samples meet planes (plane_impacts.py),
which costs a few products for each plane and sample, or have a closed form (round_impacts.py). Pairs with a mesh, or
that turn very fast, are left to `sampled_impacts.py`. docs/uncertainty.md describes the method.
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final

from collision_monitor._jit import device, inlined, kernel
from collision_monitor.impact.body_impact import ImpactQuery, ShapePair, Tube, Window
from collision_monitor.impact.sphere_interval import sphere_interval
from collision_monitor.motion.last_state import carry_on
from collision_monitor.motion.motion import half_acceleration
from collision_monitor.uncertainty.impact_distribution import (
    EARLIEST,
    EVENLY_OUTWARD,
    MOST_LIKELY,
    OUTWARD,
    PROBABILITY,
)
from collision_monitor.uncertainty.impact_histogram import NOT_FOUND, summarise_by_bins
from collision_monitor.uncertainty.pair_errors import (
    PairErrors,
    acceleration_terms,
    closest_time,
    deviation_at,
    set_gap_covariance,
    surface_bend,
    swing_bound,
    way_at,
)
from collision_monitor.uncertainty.plane_impacts import enter_bodies, enter_surely
from collision_monitor.uncertainty.round_impacts import NOT_ROUND, enter_round_bodies, round_form
from collision_monitor.uncertainty.sampled_impacts import (
    SAMPLE_TOLERANCE,
    first_contact,
    likely_contact,
    pair_has_mesh,
    right_time,
)
from collision_monitor.uncertainty.samples.error_samples import orientation_spread, set_frame, take_root
from collision_monitor.uncertainty.samples.sample_gaps import TURNED_FARTHEST
from collision_monitor.uncertainty.screening import GapGrowth, design_point
from collision_monitor.uncertainty.spread import is_uncertain, surface_spread, swing_radius, turns_by_yaw
from collision_monitor.uncertainty.sure_contact import surely_meet

LEFT: Final = -1.0
"""Probability of a pair that this method does not answer: very fast rotation, large errors of orientation, a mesh."""


@kernel
def plane_probabilities(
    multibody: Any, spread: Any, pairs: Any, now: float, sampling: Any, columns: Any, memory: Any, work: Any,
    answers: Any,
) -> int:  # fmt: skip
    """Write times (s after `now`) and probabilities of impact of pairs (P, 2) of body slots into answers (P, 4).

    An answer is NaN if neither body has declared an uncertainty, or if the pair is stated to pass and its probability
    is below min_probability for certain. The probability is LEFT for pairs that `impact_probabilities` or
    `planned_probabilities` has to answer.
    sampling: its own samples are not used; columns: sample_columns. `find_near` comes before it.
    sampling.only_screens: for pairs that are stated to pass, write a time before which bodies grown by safe_sigmas do
    not meet, the likeliest time of contact, and a bound on its probability, LEFT if unknown.
    Returns the number of samples of all pairs.
    """
    table, parts, bodies = multibody
    query, horizon, stale_acceleration = sampling.query, sampling.horizon, sampling.stale_acceleration
    A, B = work.motion[0], work.motion[1]
    followed = 0
    for k in range(pairs.shape[0]):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        if bodies.planned[i] or bodies.planned[j]:
            answers[k, EARLIEST], answers[k, MOST_LIKELY], answers[k, PROBABILITY] = 0.0, 0.0, LEFT
            continue
        has_mesh = pair_has_mesh(table, parts, bodies, i, j)
        ages = (carry_on(bodies, i, now, work.quaternion, A), carry_on(bodies, j, now, work.quaternion, B))
        r_i, r_j = swing_radius(bodies, spread, i), swing_radius(bodies, spread, j)
        now_i, growth_i = surface_spread(bodies, spread, i, r_i, ages[0], horizon, stale_acceleration)
        now_j, growth_j = surface_spread(bodies, spread, j, r_j, ages[1], horizon, stale_acceleration)
        tube = Tube(now_i + now_j, growth_i + growth_j)
        bend = surface_bend(A, r_i, horizon) + surface_bend(B, r_j, horizon)
        bend += 2.0 * half_acceleration(A, B, 0.0, horizon)
        t = closest = closest_time(A, B, horizon) if A.radius + B.radius < inf else 0.0
        swing_i, swing_j = swing_bound(spread, i, r_i, ages[0], horizon), swing_bound(spread, j, r_j, ages[1], horizon)
        turning = (swing_i[0] + swing_j[0], swing_i[1] + swing_j[1])
        flat = not (r_i < inf and r_j < inf)
        if not sampling.stated:
            _set_axes(work.frame)
            answer = answers[k]  # NaN so far
            if sampling.only_screens:
                first = _first_meeting(A, B, tube, sampling)
                if first == inf:
                    continue
                answer[EARLIEST], answer[MOST_LIKELY], answer[PROBABILITY] = first, first, LEFT
            if has_mesh:
                answer[PROBABILITY] = LEFT
                continue
            set_gap_covariance(multibody, spread, i, j, ages, t, 0.0, sampling, work)
            growth = GapGrowth(turning, acceleration_terms(multibody, spread, i, j, ages), bend)
            bound, t = design_point(multibody, i, j, tube, growth, sampling, t, memory.obstacle, work)
            if bound < sampling.min_probability:
                answer[:] = nan
                continue
            if sampling.only_screens:
                answer[MOST_LIKELY], answer[PROBABILITY] = t, min(bound, 1.0)
                continue
        elif not has_mesh:
            t = likely_contact(multibody, i, j, t, horizon, query, work)
        late = max(t, closest)
        late = late if late > 0.0 else horizon
        right = right_time(multibody, spread, i, j, t, sampling, work)
        turn_i = orientation_spread(spread, i, r_i, ages[0], late, right)
        turn_j = orientation_spread(spread, j, r_j, ages[1], late, right)
        most = max(deviation_at(turn_i, late), deviation_at(turn_j, late))
        if has_mesh or most > TURNED_FARTHEST or (flat and most > 0.0):
            answers[k, PROBABILITY] = LEFT
            continue
        there, v = way_at(A, B, t)
        if sampling.stated:
            work.frame[0, 0], work.frame[0, 1], work.frame[0, 2] = there
        set_frame(work.frame, *v)
        set_gap_covariance(multibody, spread, i, j, ages, t, right, sampling, work)
        pair = ShapePair(A, B, bodies.first_shape[i], bodies.first_shape[j])
        far_i, far_j = r_i if r_i < inf else 0.0, r_j if r_j < inf else 0.0  # a half-space does not turn
        swing = (far_i * deviation_at(turn_i, t), far_j * deviation_at(turn_j, t))
        sure = sampling.stated and surely_meet(table, parts, pair, work.joint, swing, t, query.margin, work.scratch)
        take_root(work.joint)
        yaw_only = (turns_by_yaw(spread, i, sampling.planar), turns_by_yaw(spread, j, sampling.planar))
        errors = PairErrors(tube, (turn_i, turn_j), bend, work.joint[0, 0], t, late, (far_i, far_j), yaw_only)
        form = round_form(table, parts, pair, errors, query.margin, work)
        if form != NOT_ROUND:
            samples = enter_round_bodies(table, parts, pair, form, errors, sure, sampling, columns, memory, work)
        elif sure:
            samples = enter_surely(multibody, i, j, errors, sampling, columns, memory, work)
        else:
            samples = enter_bodies(multibody, i, j, errors, sampling, columns, memory, work)
        if samples < 0:
            answers[k, PROBABILITY] = LEFT
            continue
        if samples == 0:
            followed += columns.pilot
            continue
        followed += samples
        answer = answers[k]
        weights, sums = (memory.chosen.weights, memory.chosen.sums)
        if sure:
            weights, sums = columns.even, columns.even_sums
        elif form != NOT_ROUND:
            weights, sums = columns.weights, columns.sums
        outward = EVENLY_OUTWARD if sure else OUTWARD
        first = summarise_by_bins(memory.times[0:samples], weights, sums, outward, sampling.confidence, memory, answer)
        if answer[EARLIEST] == NOT_FOUND:
            wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
            roughly = ImpactQuery(query.margin, max(query.tolerance, SAMPLE_TOLERANCE * tube.start), query.iterations)
            safe = first_contact(multibody, i, j, Window(0.0, horizon), wide, roughly, work)
            answer[EARLIEST] = min(safe, first)
    return followed


@device
def _first_meeting(A: Any, B: Any, tube: Tube, sampling: Any) -> float:
    """Time (s) before which the bounding spheres, grown by safe_sigmas, do not meet."""
    reach = A.radius + B.radius + sampling.query.margin + sampling.safe_sigmas * tube.start
    if not reach < inf:
        return 0.0
    growth = sampling.safe_sigmas * tube.growth + half_acceleration(A, B, 0.0, sampling.horizon) * sampling.horizon
    p, v = (B.x - A.x, B.y - A.y, B.z - A.z), (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    return sphere_interval(p, v, reach, growth, sampling.horizon, 1.0)[0]


@inlined
def _set_axes(frame: Any) -> None:
    """Set the frame (3, 3) to the world axes."""
    for r in range(3):
        for c in range(3):
            frame[r, c] = 1.0 if r == c else 0.0

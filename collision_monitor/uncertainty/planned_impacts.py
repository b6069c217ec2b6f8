"""Time and probability of impact of two bodies of which one, at least, follows a plan, with uncertain states.

Evenly spread samples of the errors, each followed exactly along the plans. A body that follows its plan is off it by
the errors of its position and orientation, which stay as they are: what drives it corrects those of its velocity, so
that they count only while it is silent. The other body has all its errors (sampled_impacts.py).
"""

from __future__ import annotations

from math import inf, nan
from typing import Any, Final

import numpy as np

from collision_monitor._jit import allocating_kernel, device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.impact.body_impact import ImpactQuery, ShapePair, Tube, Window, shape_impact
from collision_monitor.impact.impact_record import CLEAR
from collision_monitor.motion.bodies import next_pair
from collision_monitor.motion.course import ARC, place_on
from collision_monitor.motion.last_state import carry_on
from collision_monitor.motion.motion import relative_velocity, set_piece
from collision_monitor.uncertainty.impact_distribution import summarise
from collision_monitor.uncertainty.sampled_impacts import (
    COSTLY_PARTS,
    MESH_TOLERANCE,
    PILOT_PART,
    SAMPLE_TOLERANCE,
    gap_at,
    pair_has_mesh,
)
from collision_monitor.uncertainty.samples.error_samples import (
    LEFT_OVER,
    ORIENTATION,
    add_covariance,
    orientation_spread,
    set_frame,
    take_root,
    turn,
)
from collision_monitor.uncertainty.samples.normal_samples import PILOT
from collision_monitor.uncertainty.spread import (
    accelerates,
    is_uncertain,
    surface_spread,
    swing_radius,
    turns_by_yaw,
)

PLAN_NODES: Final = 17
"""Number of times from now to the horizon at which the gap is compared with its uncertainty."""

FEWEST_WITH_MESH: Final = 16
"""Fewest samples of a pair with a mesh."""

_OFF, _FASTER, _TURNED, _LEFT = 0, 3, 6, 9
"""Columns of the errors of a body in one sample: of its position now (m) and its velocity (m/s), and unit errors of its
orientation, see `orientation_spread`."""

NO_ERRORS: Final = np.zeros((2, 12))


@inlined
def _vector(row: Any, first: int) -> Vector:
    """Three numbers of a row."""
    return row[first], row[first + 1], row[first + 2]


@device
def _set_off(m: Any, errors: Any, turning: Any, t: float, R: Any) -> None:
    """Let a motion m (MOTION, time 0 is now) be off by errors (12,), with the rotation off R (3, 3).

    turning: `orientation_spread`. t: time (s) at which the position is off by that error; the velocity is always.
    """
    w, v, faster = (m.wx, m.wy, m.wz), (m.vx, m.vy, m.vz), _vector(errors, _FASTER)
    off, moved = _vector(errors, _OFF), (t * faster[0], t * faster[1], t * faster[2])
    if m.course == ARC and (faster[0] != 0.0 or faster[1] != 0.0 or faster[2] != 0.0):  # it turns with the body
        moved = place_on(ARC, faster, w, (0.0, 0.0, 0.0), t, inf).moved
    m.x, m.y, m.z = m.x + off[0] - moved[0], m.y + off[1] - moved[1], m.z + off[2] - moved[2]
    m.vx, m.vy, m.vz = v[0] + faster[0], v[1] + faster[1], v[2] + faster[2]
    turn(m, R, w, (m.vx, m.vy, m.vz), turning, _vector(errors, _TURNED), _vector(errors, _LEFT))


@device
def _enter(bodies: Any, i: int, begin: float, now: float, errors: Any, turning: Any, side: int, work: Any) -> None:
    """Write the piece of body i's plan at `begin` (s from now), off by errors, into work.motion[side]."""
    m, k = work.motion[side], bodies.motion[i].piece
    while bodies.pieces[k].until <= now + begin:
        k += 1
    set_piece(bodies.pieces[k], m)
    m.radius = bodies.motion[i].radius
    m.time, m.rest, m.until = m.time - now, m.rest - now, m.until - now
    v = (m.vx, m.vy, m.vz)
    for r in range(3):
        for c in range(3):
            work.rotation[side, r, c] = m.rotation[r, c]
    _set_off(m, errors, turning, 0.0, work.rotation[side])
    m.vx, m.vy, m.vz = v  # its path does not turn with it


@device
def _begin(
    bodies: Any, pair: Any, begin: float, now: float, errors: Any, turning: Any, t: float, work: Any
) -> None:  # fmt: skip
    """Write the motions of both bodies from `begin` (s from now) on, off by errors (2, 12), into work.motion.

    pair: the slots; turning: of both; t (s): see `_set_off`.
    """
    for side in range(2):
        i = pair[side]
        if bodies.planned[i]:
            _enter(bodies, i, begin, now, errors[side], turning[side], side, work)
            continue
        m = work.motion[side]
        carry_on(bodies, i, now, work.quaternion, m)
        m.until = inf
        for r in range(3):
            for c in range(3):
                work.rotation[side, r, c] = m.rotation[r, c]
        _set_off(m, errors[side], turning[side], t, work.rotation[side])


@device
def _first_contact(
    multibody: Any, pair: Any, now: float, window: Window, tube: Tube, query: ImpactQuery, errors: Any, turning: Any,
    t: float, work: Any,
) -> float:  # fmt: skip
    """First time (s from now) in the window at which two bodies are within query.margin and the tube; inf: never.

    The arguments are those of `_begin`; the time of the tube begins now.
    """
    table, parts, bodies = multibody
    A, B = work.motion[0], work.motion[1]
    begin, end = window
    _begin(bodies, pair, begin, now, errors, turning, t, work)
    while True:
        last = min(end, A.until, B.until)
        stop, best, there = last, inf, Tube(tube.start + tube.growth * begin, tube.growth)
        a, first_b = bodies.first_shape[pair[0]], bodies.first_shape[pair[1]]
        b = first_b
        while a >= 0:
            shapes = ShapePair(A, B, a, b)
            status, when, _, _ = shape_impact(table, parts, shapes, Window(begin, last), there, query, work.scratch)
            if status != CLEAR:
                best = last = when
            a, b = next_pair(parts, first_b, a, b)
        if best < inf or stop >= end:
            return best
        begin = stop
        for side in range(2):
            if work.motion[side].until <= begin:
                _enter(bodies, pair[side], begin, now, errors[side], turning[side], side, work)


@device
def _likeliest(multibody: Any, pair: Any, now: float, tube: Tube, sampling: Any, turning: Any, work: Any) -> float:
    """Return the time (s from now) that matters most, and write the direction of the gap then into work.frame[0].

    It is that of the stated impact, or that of the gap that is smallest in standard deviations.
    """
    horizon, margin, frame, normal = sampling.horizon, sampling.query.margin, work.frame, work.block[0]
    t, least = inf, inf
    if sampling.stated:
        window, none = Window(0.0, horizon), Tube(0.0, 0.0)
        t = _first_contact(multibody, pair, now, window, none, sampling.query, NO_ERRORS, turning, 0.0, work)
    if t < inf:
        _begin(multibody.bodies, pair, t, now, NO_ERRORS, turning, 0.0, work)
        gap_at(multibody, pair[0], pair[1], t, work)
        frame[0, 0], frame[0, 1], frame[0, 2] = normal[0], normal[1], normal[2]
        return t
    for node in range(PLAN_NODES):
        at = horizon * node / (PLAN_NODES - 1)
        _begin(multibody.bodies, pair, at, now, NO_ERRORS, turning, 0.0, work)
        beta = (gap_at(multibody, pair[0], pair[1], at, work) - margin) / max(tube.start + at * tube.growth, 1e-300)
        if beta < least:
            t, least = at, beta
            frame[0, 0], frame[0, 1], frame[0, 2] = normal[0], normal[1], normal[2]
    _begin(multibody.bodies, pair, t, now, NO_ERRORS, turning, 0.0, work)
    return t


@device
def _set_covariance(bodies: Any, spread: Any, pair: Any, ages: Any, t: float, sampling: Any, work: Any) -> None:
    """Write the root of the covariance of relative position at t and of relative velocity into work.joint.

    The part of a body that follows a plan is that of its position now, at all times.
    """
    work.joint[:] = 0.0
    for side in range(2):
        if bodies.planned[pair[side]]:
            add_covariance(
                spread, pair[side], ages[side], 0.0, 0.0, sampling.stale_acceleration, sampling.planar, work
            )  # fmt: skip
    for r in range(6):
        for c in range(3, 6):
            work.joint[r, c] = 0.0
    for side in range(2):
        k = pair[side]
        if not bodies.planned[k] and not bodies.static[k]:
            right = t if t > 0.0 or not accelerates(spread, k) else sampling.horizon
            add_covariance(spread, k, ages[side], t, right, sampling.stale_acceleration, sampling.planar, work)
    take_root(work.joint)


@device
def _draw(z: Any, moved: int, level: Any, work: Any, errors: Any) -> None:
    """Write the errors (2, 12) of a sample z (DIMENSIONS,). moved: the body that the errors of position move, 0 or 1.

    level: 0.0 for a body whose errors turn it about the z axis alone, else 1.0.
    """
    L, F = work.joint, work.frame
    sign = 1.0 if moved == 1 else -1.0
    for c in range(6):
        errors[0, c] = errors[1, c] = 0.0
    for r in range(6):
        value = 0.0
        for c in range(r + 1):
            value += L[r, c] * z[c]
        for c in range(3):
            errors[moved, 3 * (r // 3) + c] += sign * value * F[r % 3, c]
    for side in range(2):
        for c in range(3):
            part = level[side] if c < 2 else 1.0
            errors[side, _TURNED + c] = part * z[ORIENTATION + 3 * side + c]
            errors[side, _LEFT + c] = part * z[LEFT_OVER + 3 * side + c]


@inlined
def _turning(
    bodies: Any, spread: Any, i: int, radius: float, age: float, t: float
) -> tuple[float, float, float, float]:  # fmt: skip
    """`orientation_spread` of body i at t (s from now). On a plan, the error now is that at all times."""
    if bodies.planned[i]:
        return orientation_spread(spread, i, radius, age, 0.0, t)[0], 0.0, 0.0, 0.0
    return orientation_spread(spread, i, radius, age, t, t)


@inlined
def _size(table: Any, parts: Any, bodies: Any, pair: Any, most: int) -> int:
    """Number of samples of a pair."""
    size = min(PILOT, most)
    if pair_has_mesh(table, parts, bodies, pair[0], pair[1]):
        return min(size, max(size // COSTLY_PARTS, FEWEST_WITH_MESH))
    return size


@device
def _follow(
    multibody: Any, spread: Any, pair: Any, now: float, window: Window, sampling: Any, turning: Any, t: float,
    times: Any, work: Any,
) -> bool:  # fmt: skip
    """Write the times of impact of the first samples to times (n,); False: half of them show that it is too improbable.

    turning: of both bodies, right at t (s from now), which is also the time of work.joint.
    """
    table, parts, bodies = multibody
    query, weights, errors = sampling.query, sampling.weights, work.errors
    level = (
        0.0 if turns_by_yaw(spread, pair[0], sampling.planar) else 1.0,
        0.0 if turns_by_yaw(spread, pair[1], sampling.planar) else 1.0,
    )
    moved = 0 if bodies.planned[pair[1]] and not bodies.planned[pair[0]] else 1
    has_mesh = pair_has_mesh(table, parts, bodies, pair[0], pair[1])
    coarse = max(query.tolerance, (MESH_TOLERANCE if has_mesh else SAMPLE_TOLERANCE) * work.joint[0, 0])
    roughly = ImpactQuery(query.margin, coarse, query.iterations)
    # half a tolerance inside, on average; the surface of a mesh has no gap below 0
    inside = Tube(0.0 if has_mesh else -0.75 * coarse, 0.0)
    seen = whole = 0.0
    for n in range(times.size):
        if 2 * n == times.size and not sampling.stated and seen < PILOT_PART * sampling.min_probability * whole:
            return False  # the first half is evenly spread too
        _draw(sampling.points[n], moved, level, work, errors)
        times[n] = _first_contact(multibody, pair, now, window, inside, roughly, errors, turning, t, work)
        whole += weights[n]
        seen += weights[n] if times[n] < inf else 0.0
    return True


@allocating_kernel
def planned_probabilities(
    multibody: Any, spread: Any, pairs: Any, now: float, sampling: Any, work: Any, answers: Any
) -> int:
    """`impact_probabilities` of pairs (P, 2) of which one body, at least, follows a plan."""
    table, parts, bodies = multibody
    query, horizon, stale = sampling.query, sampling.horizon, sampling.stale_acceleration
    followed = 0
    for k in range(len(pairs)):
        i, j = pairs[k, 0], pairs[k, 1]
        answers[k, :] = nan
        if not (is_uncertain(spread, i) or is_uncertain(spread, j)):
            continue
        age_i = 0.0 if bodies.static[i] else now - bodies.time[i]
        age_j = 0.0 if bodies.static[j] else now - bodies.time[j]
        r_i, r_j = swing_radius(bodies, spread, i), swing_radius(bodies, spread, j)
        now_i, growth_i = surface_spread(bodies, spread, i, r_i, age_i, horizon, stale)
        now_j, growth_j = surface_spread(bodies, spread, j, r_j, age_j, horizon, stale)
        growth = (0.0 if bodies.planned[i] else growth_i) + (0.0 if bodies.planned[j] else growth_j)
        tube = Tube(now_i + now_j, growth)
        coarse = max(query.tolerance, SAMPLE_TOLERANCE * tube.start)
        roughly, whole = ImpactQuery(query.margin, coarse, query.iterations), Window(0.0, horizon)
        none = (0.0, 0.0, 0.0, 0.0)
        stated = (none, none)
        if not sampling.stated:
            wide = Tube(sampling.sigmas * tube.start, sampling.sigmas * tube.growth)
            if _first_contact(multibody, (i, j), now, whole, wide, roughly, NO_ERRORS, stated, 0.0, work) == inf:
                continue
        wide = Tube(sampling.safe_sigmas * tube.start, sampling.safe_sigmas * tube.growth)
        safe = _first_contact(multibody, (i, j), now, whole, wide, roughly, NO_ERRORS, stated, 0.0, work)
        t = _likeliest(multibody, (i, j), now, tube, sampling, stated, work)
        set_frame(work.frame, *relative_velocity(work.motion[0], work.motion[1], t))
        _set_covariance(bodies, spread, (i, j), (age_i, age_j), t, sampling, work)
        turning = (
            _turning(bodies, spread, i, r_i, age_i, t),
            _turning(bodies, spread, j, r_j, age_j, t),
        )  # fmt: skip
        size = _size(table, parts, bodies, (i, j), sampling.weights.size)
        window, times = Window(safe if safe < inf else 0.0, horizon), np.empty(size)
        likely = _follow(multibody, spread, (i, j), now, window, sampling, turning, t, times, work)
        followed += size if likely else size // 2
        if likely:
            weights = sampling.weights[0:size]
            summarise(times, weights, np.argsort(times), sampling.confidence, safe, answers[k], weights.sum())
    return followed

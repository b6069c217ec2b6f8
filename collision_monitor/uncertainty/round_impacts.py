"""Impacts of the samples of two balls, or of two upright cylinders, that move straight: closed forms.

Cylinders with axes that are tilted a little, or uncertain, meet at some height like two discs that move straight. Three
heights suffice for people, so that they need no planes.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, cross, dot
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.motion import half_acceleration
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.shapes.kinds.cylinder import CYLINDER
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.uncertainty.pair_errors import spin_rate, turned_at
from collision_monitor.uncertainty.samples.error_samples import LEFT_OVER, ORIENTATION, errors_turn
from collision_monitor.uncertainty.samples.normal_samples import FURTHEST
from collision_monitor.uncertainty.samples.sample_count import samples_needed
from collision_monitor.uncertainty.samples.straight_samples import (
    draw_evenly,
    enter_cylinder,
    enter_sphere,
    set_errors,
    tilt,
)

NOT_ROUND, ROUND, TILTED = 0, 1, 2
"""Forms of a pair: neither; balls, or parallel cylinders; cylinders with axes that differ a little or are uncertain."""

SAGGING: Final = 0.1
"""Distance by which discs at LEVELS heights may miss tilted cylinders, in standard deviations of the gap."""

UPRIGHT: Final = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
"""Leaning of a body whose stated axis is vertical, see `tilt`."""

LEVELS: Final = 3
"""Number of heights at which the discs of tilted cylinders are followed."""


@inlined
def _axis(R: Any, side: int) -> Vector:
    """Axis (3,) of a cylinder that is placed with R[side]."""
    return R[side, 0, 2], R[side, 1, 2], R[side, 2, 2]


@inlined
def _ends(table: Any, pair: Any, t: float, axis: Vector, offsets: Any) -> Any:
    """Lowest and highest points of both cylinders at time t, and the height of B's origin, over the origin of A (m)."""
    A, B, a, b = pair
    x, y, z = B.x - A.x + t * (B.vx - A.vx), B.y - A.y + t * (B.vy - A.vy), B.z - A.z + t * (B.vz - A.vz)
    up = dot((x, y, z), axis)
    middle_a, middle_b = dot(offsets[0], axis), up + dot(offsets[1], axis)
    half_a, half_b = table.size[a, 1], table.size[b, 1]
    return (middle_a - half_a, middle_a + half_a), (middle_b - half_b, middle_b + half_b), up


@inlined
def _shared(ends: Any) -> float:
    """Height (m) that two cylinders with these ends share; negative: one is above the other."""
    return min(ends[0][1], ends[1][1]) - max(ends[0][0], ends[1][0])


@device
def round_form(table: Any, parts: Any, pair: Any, errors: Any, margin: float, work: Any) -> int:
    """Form of two bodies with these first shapes, see NOT_ROUND. A cylinder may turn about its own axis."""
    A, B, a, b = pair
    if parts.next[a] >= 0 or parts.next[b] >= 0 or half_acceleration(A, B, 0.0, errors.late) > 0.0:
        return NOT_ROUND
    is_off = errors.bend > 0.0 or errors_turn(errors.turning[0]) or errors_turn(errors.turning[1])
    if table.kind[a] == SPHERE and table.kind[b] == SPHERE:
        return NOT_ROUND if is_off else ROUND
    if not (table.kind[a] == table.kind[b] == CYLINDER) or table.margin[a] + table.margin[b] + margin > 0.0:
        return NOT_ROUND
    R = work.scratch.rotation
    oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    by_yaw = (errors.yaw_only[0] and errors_turn(errors.turning[0])) or (
        errors.yaw_only[1] and errors_turn(errors.turning[1])
    )
    if by_yaw:
        return NOT_ROUND
    if not is_off and is_parallel(table, a, PairPose(R[0], R[1], (0.0, 0.0, 0.0))):
        return ROUND
    one, other = _axis(R, 0), _axis(R, 1)
    aslant = sqrt((one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2)
    for side in range(2):
        m, axis, o = (A, one, oa) if side == 0 else (B, other, ob)
        rate = cross((m.wx, m.wy, m.wz), axis)
        aslant += sqrt(dot(rate, rate)) * errors.late
        across = cross(o, axis)
        if sqrt(dot(across, across)) * (turned_at(errors, side) + spin_rate(m)) > 0.0:
            return NOT_ROUND
    then, now = _ends(table, pair, errors.time, other, (oa, ob)), _ends(table, pair, 0.0, other, (oa, ob))
    aslant += sqrt(turned_at(errors, 0) ** 2 + turned_at(errors, 1) ** 2)
    reach, most = table.size[a, 0] + table.size[b, 0], SAGGING * errors.sigma
    if min(_shared(then), _shared(now)) < FURTHEST * errors.sigma:
        rim = max(table.size[a, 0], table.size[b, 0])
        if max(abs(then[2] - now[2]), rim) * aslant > most:
            return NOT_ROUND  # one may pass over the other, and touch its rim
    between = _shared(then) / (LEVELS - 1) * aslant
    return TILTED if max(0.125 * between * between / reach, 0.5 * reach * aslant * aslant) < most else NOT_ROUND


@inlined
def _set_lowest(then: Any, t: float, axis: Vector, first: int, last: int, off: Any, lifts: Any, step: Any) -> None:
    """Write the ways (m) from the origins of A, down, and of B, up, to the lowest height that the samples first:last
    share, into lifts (2, S), and the way to the next level into step (S,).

    then: see `_ends`, at time t (s). The heights are those of the stated motion, moved by each sample's error.
    """
    (low_a, high_a), (low_b, high_b), stated = then
    ax, ay, az = axis
    x, y, z = off[0, first:last], off[1, first:last], off[2, first:last]
    u, v, w = off[3, first:last], off[4, first:last], off[5, first:last]
    down, up, step = lifts[0, first:last], lifts[1, first:last], step[first:last]
    for n in range(step.size):
        above = (x[n] + t * u[n]) * ax + (y[n] + t * v[n]) * ay + (z[n] + t * w[n]) * az
        low, high = max(low_a, low_b + above), min(high_a, high_b + above)
        down[n], up[n], step[n] = -low, low - stated - above, (high - low) / (LEVELS - 1)


@device
def _enter_tilted(
    table: Any, parts: Any, pair: Any, errors: Any, end: float, first: int, last: int, points: Any, memory: Any,
    work: Any,
) -> None:  # fmt: skip
    """`_enter_round` for the form TILTED."""
    A, B, a, b = pair
    R, off, times = work.scratch.rotation, memory.off, memory.times
    offsets = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    one, other, reach = _axis(R, 0), _axis(R, 1), table.size[a, 0] + table.size[b, 0]
    lean_a = (one[0] - other[0], one[1] - other[1], one[2] - other[2]), cross((A.wx, A.wy, A.wz), one)
    lean_b = (0.0, 0.0, 0.0), cross((B.wx, B.wy, B.wz), other)
    then, half = _ends(table, pair, errors.time, other, offsets), table.size[a, 1] + table.size[b, 1]
    middle = dot(offsets[1], other) - dot(offsets[0], other)
    p = (B.x - A.x + middle * other[0], B.y - A.y + middle * other[1], B.z - A.z + middle * other[2])
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    lifts, step = memory.spare[0:2], memory.spare[2]
    _set_lowest(then, errors.time, other, first, last, off, lifts, step)
    for n in range(first, last):
        times[n] = inf
    for _level in range(LEVELS):
        for side in range(2):
            axis, lean, off_by = (one, lean_a, errors.turning[0]) if side == 0 else (other, lean_b, errors.turning[1])
            turning, left = (off_by[0], off_by[1]), (off_by[2], off_by[3])
            tilt(points, ORIENTATION + 3 * side, axis, lifts[side], turning, lean, first, last, off)
            if left[1] > 0.0:
                tilt(points, LEFT_OVER + 3 * side, axis, lifts[side], left, UPRIGHT, first, last, off)
        enter_cylinder(p, v, other, reach, half, end, off, first, last, memory.alone)
        for n in range(first, last):
            times[n] = min(times[n], memory.alone[n])
            lifts[0, n], lifts[1, n] = -step[n], step[n]


@device
def _enter_round(
    table: Any, parts: Any, pair: Any, form: int, errors: Any, end: float, margin: float, first: int, last: int,
    points: Any, memory: Any, work: Any,
) -> None:  # fmt: skip
    """Write the impacts of the samples first:last of bodies of this form, see `round_form`, into memory.times."""
    A, B, a, b = pair
    if form == TILTED:
        _enter_tilted(table, parts, pair, errors, end, first, last, points, memory, work)
        return
    R = work.scratch.rotation
    oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    p = (B.x - A.x + ob[0] - oa[0], B.y - A.y + ob[1] - oa[1], B.z - A.z + ob[2] - oa[2])
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    if table.kind[a] == SPHERE:
        enter_sphere(p, v, table.radius[a] + table.radius[b] + margin, end, memory.off, first, last, memory.times)
        return
    size, half = table.size, table.size[a, 1] + table.size[b, 1]
    enter_cylinder(p, v, _axis(R, 1), size[a, 0] + size[b, 0], half, end, memory.off, first, last, memory.times)


@device
def enter_round_bodies(
    table: Any, parts: Any, pair: Any, form: int, errors: Any, sure: bool, sampling: Any, columns: Any, memory: Any,
    work: Any,
) -> int:  # fmt: skip
    """Write the times of the samples' impacts of bodies of a form, see `round_form`, into memory.times.

    work.joint: root of the covariance of the pair; sure: they surely meet. Returns the number of samples, see
    `samples_needed`; those of the pilot, with equal weights, if the bodies surely meet.
    """
    margin, end, pilot, points = sampling.query.margin, sampling.horizon, columns.pilot, columns.points
    if sure:
        draw_evenly(work.joint)
    set_errors(work.joint, work.frame, errors.time, points, 0, pilot, memory.off)
    _enter_round(table, parts, pair, form, errors, end, margin, 0, pilot, points, memory, work)
    samples = pilot if sure else samples_needed(memory.times, columns, sampling, False)
    if samples > pilot:
        set_errors(work.joint, work.frame, errors.time, points, pilot, samples, memory.off)
        _enter_round(table, parts, pair, form, errors, end, margin, pilot, samples, points, memory, work)
    return samples

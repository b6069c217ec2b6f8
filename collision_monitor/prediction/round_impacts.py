"""Impacts of the samples of two balls, or of two upright cylinders, that move straight: closed forms.

Cylinders with axes that are tilted a little, or uncertain, meet at some height like two discs that move straight. Three
heights suffice for people, so that they need no planes.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.shape_table import CYLINDER, SPHERE
from collision_monitor.narrow_phase.cylinder_cylinder import is_parallel
from collision_monitor.narrow_phase.pair_pose import PairPose
from collision_monitor.narrow_phase.vector import cross, dot
from collision_monitor.prediction.bodies import place_shape
from collision_monitor.prediction.motion import half_acceleration
from collision_monitor.prediction.normal_samples import FURTHEST
from collision_monitor.prediction.pair_errors import spin_rate, turned_at
from collision_monitor.prediction.sample_count import samples_needed
from collision_monitor.prediction.straight_samples import (
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

LEVELS: Final = 3
"""Number of heights at which the discs of tilted cylinders are followed."""


@inlined
def _axis(R, side):
    """Axis (3,) of a cylinder that is placed with R[side]."""
    return R[side, 0, 2], R[side, 1, 2], R[side, 2, 2]


@inlined
def _levels(table, pair, t, axis, offsets):
    """Lowest and highest point that two cylinders share at time t, and the origin of B, over that of A (m)."""
    A, B, a, b = pair
    x, y, z = B.x - A.x + t * (B.vx - A.vx), B.y - A.y + t * (B.vy - A.vy), B.z - A.z + t * (B.vz - A.vz)
    up = dot((x, y, z), axis)
    middle_a, middle_b = dot(offsets[0], axis), up + dot(offsets[1], axis)
    half_a, half_b = table.size[a, 1], table.size[b, 1]
    return max(middle_a - half_a, middle_b - half_b), min(middle_a + half_a, middle_b + half_b), up


@device
def round_form(table, parts, pair, errors, margin, work):
    """Form of two bodies with these first shapes, see NOT_ROUND. A cylinder may turn about its own axis."""
    A, B, a, b = pair
    if parts.next[a] >= 0 or parts.next[b] >= 0 or half_acceleration(A, B) > 0.0:
        return NOT_ROUND
    turning = errors.turning
    turns = errors.bend > 0.0 or turning[0][0] + turning[0][1] + turning[1][0] + turning[1][1] > 0.0
    if table.kind[a] == SPHERE and table.kind[b] == SPHERE:
        return NOT_ROUND if turns else ROUND
    if not (table.kind[a] == table.kind[b] == CYLINDER) or table.margin[a] + table.margin[b] + margin > 0.0:
        return NOT_ROUND
    R = work.scratch.rotation
    oa, ob = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    if not turns and is_parallel(table, a, PairPose(R[0], R[1], (0.0, 0.0, 0.0))):
        return ROUND
    one, other = _axis(R, 0), _axis(R, 1)
    aslant = sqrt((one[0] - other[0]) ** 2 + (one[1] - other[1]) ** 2 + (one[2] - other[2]) ** 2)
    for side in range(2):
        m, axis, o = (A, one, oa) if side == 0 else (B, other, ob)
        rate = cross((m.wx, m.wy, m.wz), axis)
        aslant += sqrt(dot(rate, rate)) * errors.time
        across = cross(o, axis)
        if sqrt(dot(across, across)) * (turned_at(errors, side) + spin_rate(m)) > 0.0:
            return NOT_ROUND
    low, high, _ = _levels(table, pair, errors.time, other, (oa, ob))
    now_low, now_high, _ = _levels(table, pair, 0.0, other, (oa, ob))
    aslant += sqrt(turned_at(errors, 0) ** 2 + turned_at(errors, 1) ** 2)
    if min(high - low, now_high - now_low) < 2.0 * FURTHEST * errors.sigma and aslant > 0.5 * SAGGING:
        return NOT_ROUND  # one may pass over the other, and the heights that they share matter
    between = (high - low) / (LEVELS - 1) * aslant
    flat = 0.125 * between * between / (table.size[a, 0] + table.size[b, 0])
    return TILTED if flat < SAGGING * errors.sigma else NOT_ROUND


@device
def _enter_tilted(table, parts, pair, errors, end, first, last, points, memory, work):
    """`_enter_round` for the form TILTED."""
    A, B, a, b = pair
    R, off, times = work.scratch.rotation, memory.off, memory.times
    offsets = place_shape(table, parts, a, A.rotation, R[0]), place_shape(table, parts, b, B.rotation, R[1])
    one, other, reach = _axis(R, 0), _axis(R, 1), table.size[a, 0] + table.size[b, 0]
    slow_a, slow_b = cross((A.wx, A.wy, A.wz), one), cross((B.wx, B.wy, B.wz), other)
    low, high, up = _levels(table, pair, errors.time, other, offsets)
    middle = dot(offsets[1], other) - dot(offsets[0], other)
    half = table.size[a, 1] + table.size[b, 1]
    for n in range(first, last):
        times[n] = inf
    known_a = known_b = 0.0
    for level in range(LEVELS):
        height_a = low + level * (high - low) / (LEVELS - 1)
        height_b = height_a - up
        tilt(points, 6, one, known_a - height_a, errors.turning[0], first, last, off)
        tilt(points, 9, other, height_b - known_b, errors.turning[1], first, last, off)
        known_a, known_b = height_a, height_b
        down = middle + height_a - height_b  # the height of B's middle over that of A counts, not that of the level
        p = (
            B.x - A.x + (height_b + down) * other[0] - height_a * one[0],
            B.y - A.y + (height_b + down) * other[1] - height_a * one[1],
            B.z - A.z + (height_b + down) * other[2] - height_a * one[2],
        )
        v = (
            B.vx - A.vx + height_b * slow_b[0] - height_a * slow_a[0],
            B.vy - A.vy + height_b * slow_b[1] - height_a * slow_a[1],
            B.vz - A.vz + height_b * slow_b[2] - height_a * slow_a[2],
        )
        enter_cylinder(p, v, other, reach, half, end, off, first, last, memory.alone)
        for n in range(first, last):
            times[n] = min(times[n], memory.alone[n])


@device
def _enter_round(table, parts, pair, form, errors, end, margin, first, last, points, memory, work):
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
def enter_round_bodies(table, parts, pair, form, errors, sure, sampling, lattice, memory, work):
    """Write the times of the samples' impacts of bodies of a form, see `round_form`, into memory.times.

    work.joint: root of the covariance of the pair; sure: they surely meet. Returns the number of samples, see
    `samples_needed`; those of the pilot, with equal weights, if the bodies surely meet.
    """
    margin, end, pilot, points = sampling.query.margin, sampling.horizon, lattice.pilot, lattice.points
    if sure:
        draw_evenly(work.joint)
    set_errors(work.joint, work.frame, errors.time, points, 0, pilot, memory.off)
    _enter_round(table, parts, pair, form, errors, end, margin, 0, pilot, points, memory, work)
    samples = pilot if sure else samples_needed(memory.times, lattice, sampling, False)
    if samples > pilot:
        set_errors(work.joint, work.frame, errors.time, points, pilot, samples, memory.off)
        _enter_round(table, parts, pair, form, errors, end, margin, pilot, samples, points, memory, work)
    return samples

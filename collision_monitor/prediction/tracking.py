"""Following the bodies: taking states in, noticing which left their predicted motion, and starting those anew."""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from collision_monitor._jit import device, kernel
from collision_monitor.broad_phase.hashed_grid import put_box
from collision_monitor.prediction.motion import angle_between, quaternion_to_matrix, turn_quaternion
from collision_monitor.records import StateFlag
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

ACCEPTED: Final = 0
UNKNOWN_ID: Final = 1
NON_FINITE: Final = 2
QUATERNION: Final = 3
OLD: Final = 4

STATE_NUMBERS: Final = 20
"""float64 numbers at the front of a records.STATE; id and flags follow."""

GOLDEN_RATIO: Final = 0.6180339887498949
PLASTIC_RATIO: Final = 0.7548776662466927
"""Multiples of these, modulo 1, fill the unit interval evenly."""

_TWIST_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)
_DISCONTINUITY: Final = int(StateFlag.DISCONTINUITY)


@kernel
def take_states(bodies, slots, numbers, flags, time, verdicts):  # type: ignore[no-untyped-def]
    """Store states as the bodies' last ones.

    slots (M,) int32, -1: unknown id; numbers (M, 21) float64: the rows of records.STATE; flags (M,) uint32;
    time: of all states, in seconds. verdicts (M,) uint8: ACCEPTED or why not. Returns how many were accepted.
    """
    accepted = 0
    for k in range(slots.size):
        i = slots[k]
        if i < 0:
            verdicts[k] = UNKNOWN_ID
            continue
        known_twist = (flags[k] & _TWIST_UNKNOWN) == 0
        usable = True
        for c in range(STATE_NUMBERS):
            if c < 7 or (c < 13 and known_twist):
                usable &= abs(numbers[k, c]) <= LARGEST_INPUT
        if not usable:
            verdicts[k] = NON_FINITE
            continue
        x, y, z, w = numbers[k, 3], numbers[k, 4], numbers[k, 5], numbers[k, 6]
        norm = sqrt(x * x + y * y + z * z + w * w)
        if not abs(norm - 1.0) <= UNIT_QUATERNION:
            verdicts[k] = QUATERNION
            continue
        if bodies.static[i] or (bodies.seen[i] and time <= bodies.time[i]):
            verdicts[k] = OLD
            continue
        x, y, z, w = x / norm, y / norm, z / norm, w / norm
        if known_twist:
            for c in range(3):
                bodies.linear[i, c] = numbers[k, 7 + c]
                bodies.angular[i, c] = numbers[k, 10 + c]
        elif bodies.seen[i] and (flags[k] & _DISCONTINUITY) == 0:
            _estimate_twist(bodies, i, numbers, k, x, y, z, w, time - bodies.time[i])
        else:
            bodies.linear[i] = 0.0
            bodies.angular[i] = 0.0
        for c in range(3):
            bodies.position[i, c] = numbers[k, c]
        bodies.quaternion[i, 0], bodies.quaternion[i, 1] = x, y
        bodies.quaternion[i, 2], bodies.quaternion[i, 3] = z, w
        bodies.time[i] = time
        bodies.seen[i] = True
        verdicts[k] = ACCEPTED
        accepted += 1
    return accepted


@device
def _estimate_twist(bodies, i, numbers, k, x, y, z, w, elapsed):  # type: ignore[no-untyped-def]
    """Twist from the last pose to this one: difference of positions, logarithm of the relative rotation."""
    for c in range(3):
        bodies.linear[i, c] = (numbers[k, c] - bodies.position[i, c]) / elapsed
    px, py, pz, pw = -bodies.quaternion[i, 0], -bodies.quaternion[i, 1], -bodies.quaternion[i, 2], bodies.quaternion[i, 3]
    rx = w * px + x * pw + y * pz - z * py
    ry = w * py - x * pz + y * pw + z * px
    rz = w * pz + x * py - y * px + z * pw
    rw = w * pw - x * px - y * py - z * pz
    s = sqrt(rx * rx + ry * ry + rz * rz)
    rate = 0.0
    if s > 0.0:
        sign = 1.0 if rw >= 0.0 else -1.0
        rate = 2.0 * sign * np.arctan2(s, abs(rw)) / (s * elapsed)
    bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2] = rate * rx, rate * ry, rate * rz


@kernel
def find_moved(bodies, spin_radius, count, now, horizon, stale_acceleration, moved):  # type: ignore[no-untyped-def]
    """Slots among the first `count` whose predictions no longer hold at `now`, into moved; returns how many.

    A body's surface may be off its reference by tube_0 now and drift by tube_1 a second; both are checked, with the
    drift that an unheard-of body may have made. spin_radius (N,): the farthest point that turning moves (m).
    """
    n = 0
    turned = np.empty(4)
    for i in range(count):
        if not bodies.used[i] or not bodies.seen[i] or bodies.static[i]:
            continue
        if bodies.cover[i] < now + horizon:
            moved[n] = i
            n += 1
            continue
        age = now - bodies.time[i]
        since = now - bodies.ref_time[i]
        apart = 0.0
        drift = 0.0
        for c in range(3):
            d = bodies.position[i, c] - bodies.ref_position[i, c]
            d += bodies.linear[i, c] * age - bodies.ref_linear[i, c] * since
            apart += d * d
            d = bodies.linear[i, c] - bodies.ref_linear[i, c]
            drift += d * d
        apart, drift = sqrt(apart), sqrt(drift)
        if age > 0.0:
            apart += 0.5 * stale_acceleration * age * age
            drift += stale_acceleration * age
        r = spin_radius[i]
        if r > 0.0 and apart <= bodies.tube_0[i] and drift <= bodies.tube_1[i]:
            wx, wy, wz = bodies.ref_angular[i, 0], bodies.ref_angular[i, 1], bodies.ref_angular[i, 2]
            dx, dy, dz = bodies.angular[i, 0] - wx, bodies.angular[i, 1] - wy, bodies.angular[i, 2] - wz
            off = sqrt(dx * dx + dy * dy + dz * dz)
            drift += r * off
            # turned back to the last state's time: the difference from there to now is bounded by the rate's
            turn_quaternion(bodies.ref_quaternion, i, wx, wy, wz, since - age, turned)
            apart += r * (angle_between(bodies.quaternion, i, turned[0], turned[1], turned[2], turned[3]) + off * age)
        if not (apart <= bodies.tube_0[i] and drift <= bodies.tube_1[i]):
            moved[n] = i
            n += 1
    return n


@kernel
def restart_motion(
    bodies, spin_radius, grid, which, now, horizon, slack, margin, stale_acceleration,
    position_tolerance, velocity_tolerance, orientation_tolerance, angular_velocity_tolerance,
):  # fmt: skip  # type: ignore[no-untyped-def]
    """Make the last state of each body in `which` (M,) its reference from `now` on and put what it sweeps in the grid.

    Cover times are spread over (1/8, 1] of `slack` by the body's slot and version, so that they do not expire together.
    """
    q = np.empty(4)
    for k in range(which.size):
        i = which[k]
        bodies.version[i] += np.uint32(1)
        age = 0.0 if bodies.static[i] else now - bodies.time[i]
        for c in range(3):
            bodies.ref_position[i, c] = bodies.position[i, c] + bodies.linear[i, c] * age
            bodies.ref_linear[i, c] = bodies.linear[i, c]
            bodies.ref_angular[i, c] = bodies.angular[i, c]
        turn_quaternion(
            bodies.quaternion, i, bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2], age, q
        )
        for c in range(4):
            bodies.ref_quaternion[i, c] = q[c]
        quaternion_to_matrix(bodies.ref_quaternion, i, bodies.ref_rotation[i])
        bodies.ref_time[i] = now
        if bodies.static[i]:
            bodies.cover[i] = np.inf
            sweep = 0.0
        else:
            spread = (i * GOLDEN_RATIO + bodies.version[i] * PLASTIC_RATIO) % 1.0
            sweep = horizon + slack * (0.125 + 0.875 * spread)
            bodies.cover[i] = now + sweep
            r = spin_radius[i]
            bodies.tube_0[i] = position_tolerance + r * orientation_tolerance
            bodies.tube_1[i] = velocity_tolerance + r * angular_velocity_tolerance
            if age > 0.0:
                bodies.tube_0[i] += 2.0 * stale_acceleration * age * age
                bodies.tube_1[i] += 2.0 * stale_acceleration * age
        half = bodies.radius[i] + margin + bodies.tube_0[i] + bodies.tube_1[i] * sweep
        put_box(
            grid,
            i,
            bodies.ref_position[i, 0] + 0.5 * sweep * bodies.linear[i, 0],
            bodies.ref_position[i, 1] + 0.5 * sweep * bodies.linear[i, 1],
            bodies.ref_position[i, 2] + 0.5 * sweep * bodies.linear[i, 2],
            half + 0.5 * sweep * abs(bodies.linear[i, 0]),
            half + 0.5 * sweep * abs(bodies.linear[i, 1]),
            half + 0.5 * sweep * abs(bodies.linear[i, 2]),
        )

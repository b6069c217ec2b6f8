"""States in: which are accepted, and why the others are not."""

from __future__ import annotations

from math import sqrt
from typing import Final

import numpy as np

from collision_monitor._jit import device, kernel
from collision_monitor.records import StateFlag
from collision_monitor.tolerances import LARGEST_INPUT, UNIT_QUATERNION

ACCEPTED: Final = 0


UNKNOWN_ID: Final = 1


NON_FINITE: Final = 2


QUATERNION: Final = 3


OLD: Final = 4


STATE_NUMBERS: Final = 20
"""float64 numbers at the front of a records.STATE; id and flags follow."""


_POSITION_STDDEV: Final = 16


_ORIENTATION_STDDEV: Final = 17
"""Where these are among the numbers of a records.STATE; those of their rates of change stand two behind."""


_TWIST_UNKNOWN: Final = int(StateFlag.TWIST_UNKNOWN)


_DISCONTINUITY: Final = int(StateFlag.DISCONTINUITY)


_ACCELERATION_VALID: Final = int(StateFlag.ACCELERATION_VALID)


@kernel
def take_states(bodies, slots, numbers, flags, time, verdicts):
    """Store states as the bodies' last ones.

    slots (M,) int32, -1: unknown id; numbers (M, 21) float64: the rows of records.STATE; flags (M,) uint32;
    time: of all states, in seconds. Where the twist is estimated, its standard deviations are written into numbers.
    verdicts (M,) uint8: ACCEPTED or why not.
    Returns (how many were accepted, whether any of them is uncertain).
    """
    accepted = 0
    uncertain = False
    for k in range(slots.size):
        i = slots[k]
        if i < 0:
            verdicts[k] = UNKNOWN_ID
            continue
        known_twist = (flags[k] & _TWIST_UNKNOWN) == 0
        usable = True
        for c in range(13 if known_twist else 7):
            usable &= abs(numbers[k, c]) <= LARGEST_INPUT
        accelerates = (flags[k] & _ACCELERATION_VALID) != 0
        for c in range(13, 16 if accelerates else 13):
            usable &= abs(numbers[k, c]) <= LARGEST_INPUT
        for c in range(16, STATE_NUMBERS):  # standard deviations; NaN: unknown
            usable &= not (numbers[k, c] < 0.0 or numbers[k, c] > LARGEST_INPUT)
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
            for c in range(3 if accelerates else 0):
                # what is estimated is the mean since the last state, and it was that fast half-way
                bodies.linear[i, c] += 0.5 * numbers[k, 13 + c] * (time - bodies.time[i])
            for c in (_POSITION_STDDEV, _ORIENTATION_STDDEV):
                if numbers[k, c] > 0.0 and not numbers[k, c + 2] > 0.0:
                    # of a difference of two poses, if the last one was as uncertain as this one
                    numbers[k, c + 2] = sqrt(2.0) * numbers[k, c] / (time - bodies.time[i])
        else:
            bodies.linear[i] = 0.0
            bodies.angular[i] = 0.0
        for c in range(3):
            bodies.acceleration[i, c] = numbers[k, 13 + c] if accelerates else 0.0
            bodies.position[i, c] = numbers[k, c]
        bodies.quaternion[i, 0], bodies.quaternion[i, 1] = x, y
        bodies.quaternion[i, 2], bodies.quaternion[i, 3] = z, w
        bodies.time[i] = time
        bodies.seen[i] = True
        verdicts[k] = ACCEPTED
        accepted += 1
        for c in range(16, STATE_NUMBERS):
            uncertain |= numbers[k, c] > 0.0
    return accepted, uncertain


@device
def _estimate_twist(bodies, i, numbers, k, x, y, z, w, elapsed):
    """Twist from the last pose to this one: difference of positions, logarithm of the relative rotation."""
    for c in range(3):
        bodies.linear[i, c] = (numbers[k, c] - bodies.position[i, c]) / elapsed
    px, py, pz = -bodies.quaternion[i, 0], -bodies.quaternion[i, 1], -bodies.quaternion[i, 2]
    pw = bodies.quaternion[i, 3]
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

"""How uncertain the bodies' states are, and how that grows with time.

A body is off where it said to be by e_p + e_v t + e_a t^2 / 2, t seconds after its last state: errors of position and
velocity with the covariances that were declared, and an acceleration that nobody told, anywhere in a ball: it has a
variance of a^2 / 5 along each axis. a is the declared bound, or while the body is not heard of the profile's.
"""

from __future__ import annotations

from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, kernel

FIFTH_ROOT: Final = 0.4472135954999579
"""Standard deviation along one axis of what is anywhere in a ball of radius 1."""

_STDDEV: Final = 16
"""Where the standard deviations begin among the numbers of a records.STATE."""

_DIAGONAL: Final = np.array([0, 3, 5])


SEMI_DEFINITE: Final = 1e-9
"""How negative an eigenvalue may be, in parts of the largest one: round-off of who computed the covariance."""


class Spread(NamedTuple):
    """N slots, like the bodies'."""

    stddev: Any  # (N, 4): position (m), orientation (rad), velocity (m/s), angular velocity (rad/s), along one axis
    covariance: Any  # (N, 12): of position and of velocity, upper triangles
    acceleration: Any  # (N, 2): declared bounds (m/s^2, rad/s^2); 0: none


def make_spread(capacity: int) -> Spread:
    """Slots without uncertainty."""
    n = capacity
    return Spread(np.zeros((n, 4)), np.zeros((n, 12)), np.zeros((n, 2)))


def worst_stddevs(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Covariances (n, 12) with 0 for what is unknown (NaN), and standard deviations (n, 2) along their worst axes.

    What is no covariance has one that is infinite or negative: minus the root of the most negative eigenvalue.
    """
    triangles = covariance.reshape(-1, 2, 6)
    infinite = np.isinf(triangles).any(axis=2)
    known = np.where(np.isfinite(triangles).all(axis=2, keepdims=True), triangles, 0.0)
    eigenvalues = np.linalg.eigvalsh(known[..., [0, 1, 2, 1, 3, 4, 2, 4, 5]].reshape(-1, 2, 3, 3))
    least, largest = eigenvalues[..., 0], eigenvalues[..., -1]
    stddevs = np.sqrt(np.maximum(largest, 0.0))
    negative = least < -SEMI_DEFINITE * np.abs(largest)
    stddevs[negative] = -np.sqrt(-least[negative])
    stddevs[infinite] = np.inf
    return known.reshape(-1, 12), stddevs


@kernel
def take_spread(spread, slots, numbers, covariance, planar):
    """Store the uncertainties of states. slots (M,) int32, -1: of none; numbers (M, 21): the rows of records.STATE.

    covariance (M, 12), or (0, 12); where it is all 0 the standard deviations tell. planar: there is none along z.
    """
    for k in range(slots.size):
        i = slots[k]
        if i < 0:
            continue
        for c in range(4):
            value = numbers[k, _STDDEV + c]
            spread.stddev[i, c] = value if value > 0.0 else 0.0
        for c in range(12):
            spread.covariance[i, c] = covariance[k, c] if covariance.shape[0] > 0 else 0.0
        for part in range(2):
            told = False
            for c in range(6 * part, 6 * part + 6):
                told |= spread.covariance[i, c] != 0.0
            if not told:
                for c in _DIAGONAL:
                    spread.covariance[i, 6 * part + c] = spread.stddev[i, 2 * part] ** 2
            if planar:
                for c in (2, 4, 5):
                    spread.covariance[i, 6 * part + c] = 0.0


@device
def is_uncertain(spread, i):
    """Has body i declared any uncertainty, or how hard it may accelerate?"""
    s, a = spread.stddev, spread.acceleration
    declared = s[i, 0] > 0.0 or s[i, 1] > 0.0 or s[i, 2] > 0.0 or s[i, 3] > 0.0
    return declared or a[i, 0] > 0.0 or a[i, 1] > 0.0


@device
def unknown_acceleration(spread, i, silent, which, stale_acceleration):
    """Standard deviation along one axis of body i's untold acceleration: m/s^2 (which 0) or rad/s^2 (1)."""
    declared = spread.acceleration[i, which]
    if declared > 0.0:
        return FIFTH_ROOT * declared
    return FIFTH_ROOT * stale_acceleration if silent and which == 0 else 0.0


@device
def surface_spread(spread, i, spin_radius, age, ahead, stale_acceleration):
    """Bounds on the standard deviation along one axis of every point of body i: now (m), growth until `ahead` (m/s).

    age: s since its last state. The parts are added, not their squares: a line in time that is nowhere too low.
    """
    s_p, s_o = spread.stddev[i, 0], spread.stddev[i, 1]
    s_v, s_w = spread.stddev[i, 2], spread.stddev[i, 3]
    silent = unknown_acceleration(spread, i, age > 0.0, 0, stale_acceleration)
    ahead_a = unknown_acceleration(spread, i, False, 0, stale_acceleration)
    turning = unknown_acceleration(spread, i, False, 1, stale_acceleration)
    now = s_p + s_v * age + 0.5 * silent * age * age
    growth = s_v + silent * age + 0.5 * ahead_a * ahead
    if s_o + s_w + turning > 0.0:  # what has no end does not turn
        now += spin_radius * (s_o + s_w * age + 0.5 * turning * age * age)
        growth += spin_radius * (s_w + turning * (age + 0.5 * ahead))
    return now, growth

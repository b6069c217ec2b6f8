"""Spread: the uncertainty of the bodies' states, and its growth with time.

The position of a body is off by e_p + e_v t + e_a t^2 / 2, t seconds after its last state. e_p and e_v are errors of
position and velocity with the declared covariances. e_a is an unknown acceleration anywhere in a ball of radius a, so
its variance is a^2 / 5 along each axis. a is the declared bound, or, for a body without updates, the profile's
stale_acceleration: a stale object widens its spread here, in `unknown_acceleration`.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor._jit import device, inlined, kernel, outlined
from collision_monitor.geometry.vector import magnitude
from collision_monitor.motion.course import ARC
from collision_monitor.records import StateFlag

FIFTH_ROOT: Final = 0.4472135954999579
"""Standard deviation along one axis of a uniform distribution in a ball of radius 1."""

_STDDEV: Final = 16
"""Index of the first standard deviation among the numbers of a records.STATE."""

_DIAGONAL: Final = np.array([0, 3, 5])

_YAW_ONLY: Final = int(StateFlag.YAW_ONLY)

UPRIGHT: Final = 1e-6
"""Largest tilt (rad) of an axis, or rate of it (rad/s), with which it counts as vertical."""


LEAST_SWING: Final = 1e-6
"""m: in place of 0 for a body on an arc."""

SEMI_DEFINITE: Final = 1e-9
"""Largest magnitude of a negative eigenvalue, relative to the largest one, that counts as the sender's round-off."""


class Spread(NamedTuple):
    """Uncertainties of the bodies' states; N slots, like the bodies."""

    stddev: Any  # (N, 4): position (m), orientation (rad), velocity (m/s), angular velocity (rad/s), along one axis
    covariance: Any  # (N, 12): of position (m^2) and velocity (m^2/s^2), upper triangles
    acceleration: Any  # (N, 2): declared bounds (m/s^2, rad/s^2); 0: none
    yaw_only: Any  # (N,) bool: errors of orientation and angular velocity are about the z axis of the world alone


def make_spread(capacity: int) -> Spread:
    """Make `capacity` slots without uncertainty."""
    n = capacity
    return Spread(np.zeros((n, 4)), np.zeros((n, 12)), np.zeros((n, 2)), np.zeros(n, np.bool_))


def worst_stddevs(covariance: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return covariances (n, 12) with 0 for unknown ones (NaN), and standard deviations (n, 2) along their worst axes.

    The standard deviation of an invalid covariance is infinite, or negative: minus the root of the magnitude of the
    most negative eigenvalue.
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
def take_spread(spread: Spread, slots: Any, numbers: Any, flags: Any, covariance: Any, planar: bool) -> None:
    """Store the uncertainties of states.

    slots (M,) int32, -1: skip the state; numbers (M, 21): the rows of records.STATE; flags (M,); covariance (M, 12), or
    (0, 12): where one is all 0, the standard deviations replace it. planar: set the uncertainty along z to 0.
    """
    for k in range(slots.size):
        i = slots[k]
        if i < 0:
            continue
        for c in range(4):
            value = numbers[k, _STDDEV + c]
            spread.stddev[i, c] = value if value > 0.0 else 0.0
        spread.yaw_only[i] = planar or (flags[k] & _YAW_ONLY) != 0
        for c in range(12):
            spread.covariance[i, c] = covariance[k, c] if covariance.shape[0] > 0 else 0.0
        for part in range(2):
            has_covariance = False
            for c in range(6 * part, 6 * part + 6):
                has_covariance |= spread.covariance[i, c] != 0.0
            if not has_covariance:
                for c in _DIAGONAL:
                    spread.covariance[i, 6 * part + c] = spread.stddev[i, 2 * part] ** 2
            if planar:
                for c in (2, 4, 5):
                    spread.covariance[i, 6 * part + c] = 0.0


@device
def is_uncertain(spread: Spread, i: int) -> bool:
    """Whether body i has declared any uncertainty, or a bound on its acceleration."""
    s = spread.stddev
    declared = s[i, 0] > 0.0 or s[i, 1] > 0.0 or s[i, 2] > 0.0 or s[i, 3] > 0.0
    return declared or accelerates(spread, i)


@inlined
def accelerates(spread: Spread, i: int) -> bool:
    """Whether body i has declared a bound on its acceleration."""
    return spread.acceleration[i, 0] > 0.0 or spread.acceleration[i, 1] > 0.0


@inlined
def turns_by_yaw(spread: Spread, i: int, planar: bool) -> bool:
    """Whether errors of orientation turn body i about the z axis alone.

    planar: the whole scene is. In space, an unknown angular acceleration has any axis.
    """
    return planar or (spread.yaw_only[i] and spread.acceleration[i, 1] == 0.0)


@device
def swing_radius(bodies: Any, spread: Spread, i: int) -> float:
    """Distance (m) of the farthest point that errors of orientation move; 0: none, as of an upright cylinder by yaw.

    They turn the arc of a body too, even if they do not move its surface.
    """
    if bodies.course[i] == ARC:
        return max(bodies.spin_radius[i], LEAST_SWING)
    if not (bodies.revolved[i] and turns_by_yaw(spread, i, False)):
        return bodies.spin_radius[i]
    x, y, wx, wy = bodies.quaternion[i, 0], bodies.quaternion[i, 1], bodies.angular[i, 0], bodies.angular[i, 1]
    is_upright = 2.0 * (abs(x) + abs(y)) <= UPRIGHT and abs(wx) + abs(wy) <= UPRIGHT
    return 0.0 if is_upright else bodies.spin_radius[i]


@inlined
def unknown_acceleration(spread: Spread, i: int, silent: bool, which: int, stale_acceleration: float) -> float:
    """Standard deviation along one axis of body i's unknown acceleration: m/s^2 (which 0) or rad/s^2 (which 1).

    A stale object widens its spread here: a silent body without a declared bound may accelerate by stale_acceleration.
    """
    return _unknown(spread.acceleration[i, which], stale_acceleration if silent and which == 0 else 0.0)


@inlined
def _unknown(declared: float, otherwise: float) -> float:
    """Standard deviation along one axis of an acceleration anywhere in a ball, of a declared radius or another one."""
    return FIFTH_ROOT * (declared if declared > 0.0 else otherwise)


@inlined
def surface_spread(
    bodies: Any, spread: Spread, i: int, radius: float, age: float, ahead: float, stale_acceleration: float
) -> tuple[float, float]:
    """Bound the standard deviation along one axis of every point of body i: now (m), and growth until `ahead` (m/s).

    radius: swing_radius; age, ahead: s since the last state, s from now. The parts are added instead of their squares,
    so that the bound is linear in time and never too low. An error of the orientation turns the path of a body on an
    arc too.
    """
    s, a = spread.stddev, (spread.acceleration[i, 0], spread.acceleration[i, 1])
    fastest = 0.0
    if bodies.course[i] == ARC:
        v, a_i = bodies.linear, bodies.acceleration
        fastest = magnitude((v[i, 0], v[i, 1], v[i, 2]))
        if bodies.rest[i] == inf:
            fastest += magnitude((a_i[i, 0], a_i[i, 1], a_i[i, 2])) * (age + ahead)
    return _surface_spread(
        (s[i, 0], s[i, 1], s[i, 2], s[i, 3]), a, radius, age, ahead, stale_acceleration, fastest
    )  # fmt: skip


@outlined
def _surface_spread(
    stddevs: tuple[float, float, float, float], bounds: tuple[float, float], radius: float, age: float, ahead: float,
    stale_acceleration: float, fastest: float,
) -> tuple[float, float]:  # fmt: skip
    """`surface_spread` of the numbers of a body. fastest: its largest speed on an arc (m/s), else 0."""
    s_p, s_o, s_v, s_w = stddevs
    silent = _unknown(bounds[0], stale_acceleration if age > 0.0 else 0.0)
    ahead_a, turning = _unknown(bounds[0], 0.0), _unknown(bounds[1], 0.0)
    now = s_p + s_v * age + 0.5 * silent * age * age
    growth = s_v + silent * age + 0.5 * ahead_a * ahead
    if s_o + s_w + turning > 0.0:  # else 0 * inf for a half-space, which does not turn
        now += radius * (s_o + s_w * age + 0.5 * turning * age * age)
        growth += radius * (s_w + turning * (age + 0.5 * ahead))
        if fastest > 0.0:
            whole = age + ahead
            off = s_o + s_w * whole + 0.5 * turning * whole * whole
            now, growth = now + fastest * age * off, growth + fastest * off
    return now, growth

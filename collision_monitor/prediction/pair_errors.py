"""Errors of a pair of bodies in motion: how far its gap is off, how errors turn it, and how straight it closes."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import inlined
from collision_monitor.prediction.error_samples import add_covariance
from collision_monitor.prediction.sample_gaps import FIRST_ORDER, NOT_TURNED, SERIES
from collision_monitor.prediction.spread import unknown_acceleration

BENDING: Final = 0.1
"""Largest deviation of a gap from a straight line in a segment, in standard deviations of the gap."""

TURNED: Final = 2.0
"""Standard deviations of the errors of angular velocity for which gaps are that straight."""


class PairErrors(NamedTuple):
    """Uncertainty of a pair of bodies."""

    tube: Any  # Tube: bound on the standard deviation of their surfaces
    turning: Any  # ((rad, rad/s), (rad, rad/s)): errors of their orientations
    bend: float  # m/s^2: bound on the acceleration of their surfaces
    sigma: float  # m: standard deviation of the gap
    time: float  # s: of the likeliest contact
    radius: Any  # (m, m): of the bodies; 0: rotation moves nothing
    yaw_only: Any  # (bool, bool): whether errors of their orientations are about the z axis alone


@inlined
def spin_rate(m):
    """Magnitude of the angular velocity of a motion (rad/s)."""
    return sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)


@inlined
def surface_bend(m, radius):
    """Bound on the acceleration of a body's surface from its rotation (m/s^2)."""
    rate = spin_rate(m)
    return radius * rate * rate if rate > 0.0 else 0.0


@inlined
def swing_bound(spread, i, radius, age, horizon):
    """Bound (m now, m/s) on the standard deviation of body i's surface from errors of its orientation.

    The parts are added instead of their squares, as in `surface_spread`. radius (m): the body's, infinite or 0 if
    rotation moves nothing. age: s since the last state.
    """
    if not 0.0 < radius < inf:
        return 0.0, 0.0
    orientation, rate = spread.stddev[i, 1], spread.stddev[i, 3]
    turning = unknown_acceleration(spread, i, False, 1, 0.0)
    now = orientation + rate * age + 0.5 * turning * age * age
    return radius * now, radius * (rate + turning * (age + 0.5 * horizon))


@inlined
def turned_at(errors, body):
    """Standard deviation of the orientation of a body at the time of the likeliest contact (rad)."""
    return errors.turning[body][0] + errors.turning[body][1] * errors.time


@inlined
def turning_order(errors, body, tolerance):
    """How errors of orientation turn a body: the second order counts if it moves the surface by the tolerance (m)."""
    off = turned_at(errors, body)
    if off == 0.0:
        return NOT_TURNED
    return FIRST_ORDER if 0.5 * errors.radius[body] * (TURNED * off) ** 2 < tolerance else SERIES


@inlined
def straight_length(A, B, errors, bending):
    """Length (s) of a part of the time in which gaps deviate by less than `bending` stddevs from a straight line.

    A normal that turns while the bodies pass each other bends the gap like an acceleration of the surfaces.
    """
    speed = sqrt((B.vx - A.vx) ** 2 + (B.vy - A.vy) ** 2 + (B.vz - A.vz) ** 2)
    rate = spin_rate(A) if errors.radius[0] > 0.0 else 0.0  # the rotation of a ball moves nothing
    rate += spin_rate(B) if errors.radius[1] > 0.0 else 0.0
    rate += TURNED * (errors.turning[0][1] + errors.turning[1][1])
    bend = errors.bend + speed * rate
    return sqrt(8.0 * bending * max(errors.sigma, 1e-300) / bend) if bend > 0.0 else inf


@inlined
def set_gap_covariance(multibody, spread, i, j, ages, t, sampling, work):
    """Write the covariance of relative position at t and of relative velocity, along work.frame, into work.joint."""
    bodies = multibody.bodies
    work.joint[:] = 0.0
    if not bodies.static[i]:
        add_covariance(spread, i, ages[0], t, sampling.stale_acceleration, sampling.planar, work)
    if not bodies.static[j]:
        add_covariance(spread, j, ages[1], t, sampling.stale_acceleration, sampling.planar, work)

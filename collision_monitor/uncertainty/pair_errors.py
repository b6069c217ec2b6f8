"""Errors of a pair of bodies in motion: how far its gap is off, how errors turn it, and how straight it closes."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, dot, magnitude
from collision_monitor.motion.course import STRAIGHT
from collision_monitor.motion.motion import are_straight, most_turning, relative_position, relative_velocity, twist_at
from collision_monitor.uncertainty.samples.error_samples import (
    LEFT_OVER,
    ORIENTATION,
    add_arc_errors,
    add_covariance,
    errors_turn,
)
from collision_monitor.uncertainty.samples.normal_samples import DIMENSIONS
from collision_monitor.uncertainty.samples.sample_gaps import FIRST_ORDER, NOT_TURNED, SERIES
from collision_monitor.uncertainty.spread import turns_by_yaw, unknown_acceleration

BENDING: Final = 0.15
"""Largest deviation of a gap from a straight line in a segment, in standard deviations of the gap."""

CLOSEST_NODES: Final = 32
"""Parts of the horizon among whose ends the closest approach of bodies that bend is sought."""

TURNED: Final = 2.0
"""Standard deviations of the errors of angular velocity for which gaps are that straight."""

ROUNDING: Final = 2e-6
"""Ten times the error of a gap in single precision, in radii of the bodies, if errors turn them: see sample_gaps.py."""

SINGLE: Final = (1e-12, 1e12)
"""Standard deviations of a gap (m) whose squares are in single precision too."""


class PairErrors(NamedTuple):
    """Uncertainty of a pair of bodies."""

    tube: Any  # Tube: bound on the standard deviation of their surfaces
    turning: Any  # errors of their orientations, see `orientation_spread`
    bend: float  # m/s^2: bound on the acceleration of their surfaces
    sigma: float  # m: standard deviation of the gap
    time: float  # s: of the likeliest contact
    late: float  # s: when errors of orientation, which grow, count most
    radius: Any  # (m, m): of the bodies; 0: rotation moves nothing
    yaw_only: Any  # (bool, bool): whether errors of their orientations are about the z axis alone


@inlined
def closest_time(A: Any, B: Any, horizon: float) -> float:
    """Time (s), from now to the horizon, at which the origins are closest; of bodies that bend, to 1 / 64 of it."""
    if not are_straight(A, B):
        least, best = inf, 0.0
        for k in range(CLOSEST_NODES + 1):
            t = horizon * k / CLOSEST_NODES
            p = relative_position(A, B, t)
            if dot(p, p) < least:
                least, best = dot(p, p), t
        return best
    px, py, pz = B.x - A.x, B.y - A.y, B.z - A.z
    vx, vy, vz = B.vx - A.vx, B.vy - A.vy, B.vz - A.vz
    vv = vx * vx + vy * vy + vz * vz
    return min(max(-(px * vx + py * vy + pz * vz) / vv, 0.0), horizon) if vv > 0.0 else 0.0


@inlined
def way_at(A: Any, B: Any, t: float) -> tuple[Vector, Vector]:
    """Position (m) and velocity (m/s) of B's origin relative to A's at time t, without constant accelerations."""
    if not are_straight(A, B):
        return relative_position(A, B, t), relative_velocity(A, B, t)
    v = (B.vx - A.vx, B.vy - A.vy, B.vz - A.vz)
    return (B.x - A.x + t * v[0], B.y - A.y + t * v[1], B.z - A.z + t * v[2]), v


@inlined
def spin_rate(m: Any) -> float:
    """Magnitude of the angular velocity of a motion (rad/s)."""
    return sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)


@inlined
def surface_bend(m: Any, radius: float, horizon: float) -> float:
    """Bound on the acceleration of a body's surface from its rotation until the horizon (m/s^2)."""
    rate = spin_rate(m)
    if m.course != STRAIGHT and rate > 0.0:
        most = most_turning(m, 0.0, horizon)
        return radius * (most * most + rate * abs(twist_at(m, 0.0).change))
    return radius * rate * rate if rate > 0.0 else 0.0


@inlined
def swing_bound(spread: Any, i: int, radius: float, age: float, horizon: float) -> tuple[float, float]:
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
def turned_at(errors: PairErrors, body: int) -> float:
    """Standard deviation of the orientation of a body at the time when it counts most (rad)."""
    return deviation_at(errors.turning[body], errors.late)


@inlined
def deviation_at(off: Any, t: float) -> float:
    """Standard deviation (rad) of an orientation at time t (s); off: orientation_spread."""
    own, left = off[0] + off[1] * t, off[2] + off[3] * t
    return sqrt(own * own + left * left) if left != 0.0 else own


@device
def gap_deviation(n: Vector, root: Any, errors: PairErrors, t: float) -> float:
    """Standard deviation (m) of the gap along n (3,), in the axes of the root, at time t.

    root (6, 6): lower Cholesky factor of the covariance of position at errors.time and of velocity.
    """
    variance, since = 0.0, t - errors.time
    for c in range(6):
        factor = 0.0
        for r in range(3):
            factor += n[r] * (root[r, c] + since * root[3 + r, c])
        variance += factor * factor
    for body in range(2):
        swing = errors.radius[body] * deviation_at(errors.turning[body], t)
        variance += swing * swing
    return sqrt(variance)


@device
def fineness(root: Any, errors: PairErrors, tolerance: float, least: float) -> tuple[float, float]:
    """Factor of a tolerance (m) now, and its growth (1/s), which make it finer while the errors are smaller.

    The gap of bodies that are near each other now, with errors that grow from 0, is small for the later errors only.
    The factor is that of the deviations along the first axis of the root, see `gap_deviation`, relative to half of that
    at errors.time; least (m): the tolerance is not smaller.
    """
    along = (1.0, 0.0, 0.0)
    now, then = gap_deviation(along, root, errors, 0.0), gap_deviation(along, root, errors, errors.time)
    if not (then > 0.0 and errors.time > 0.0):
        return 1.0, 0.0
    start = max(2.0 * now / then, least / tolerance)
    return start, max(2.0 - start, 0.0) / errors.time


@inlined
def are_fine(errors: PairErrors, tolerance: float) -> bool:
    """Whether samples in single precision are exact enough for a tolerance (m) of the planes, see sample_gaps.py."""
    turned, sigma = turned_at(errors, 0) + turned_at(errors, 1) > 0.0, errors.sigma
    if turned and ROUNDING * (errors.radius[0] + errors.radius[1]) > tolerance:
        return False
    return sigma == 0.0 or SINGLE[0] < sigma < SINGLE[1]


@inlined
def turning_order(errors: PairErrors, body: int, tolerance: float) -> int:
    """How errors of orientation turn a body: the second order counts if it moves the surface by the tolerance (m)."""
    off = turned_at(errors, body)
    if off == 0.0:
        return NOT_TURNED
    return FIRST_ORDER if 0.5 * errors.radius[body] * (TURNED * off) ** 2 < tolerance else SERIES


@inlined
def coordinates_in_use(errors: PairErrors) -> int:
    """Number of the coordinates of a sample that matter: those of position and velocity come first."""
    one, other = errors.turning
    if one[3] > 0.0 or other[3] > 0.0:
        return DIMENSIONS
    return LEFT_OVER if errors_turn(one) or errors_turn(other) else ORIENTATION


@inlined
def turning_rate(errors: PairErrors) -> float:
    """Sum of the errors of the angular velocities of both bodies, one standard deviation (rad/s)."""
    one, other = errors.turning
    return one[1] + one[3] + other[1] + other[3]


@inlined
def straight_length(A: Any, B: Any, errors: PairErrors, bending: float) -> float:
    """Length (s) of a part of the time in which gaps deviate by less than `bending` stddevs from a straight line.

    A normal that turns while the bodies pass each other bends the gap like an acceleration of the surfaces.
    """
    speed = sqrt((B.vx - A.vx) ** 2 + (B.vy - A.vy) ** 2 + (B.vz - A.vz) ** 2)
    if not are_straight(A, B):
        speed = magnitude((A.vx, A.vy, A.vz)) + magnitude((B.vx, B.vy, B.vz))
    rate = spin_rate(A) if errors.radius[0] > 0.0 else 0.0  # the rotation of a ball moves nothing
    rate += spin_rate(B) if errors.radius[1] > 0.0 else 0.0
    rate += TURNED * turning_rate(errors)
    bend = errors.bend + speed * rate
    for body in range(2):  # a surface that an error turns accelerates like one that spins
        off, spin = TURNED * (errors.turning[body][1] + errors.turning[body][3]), spin_rate(A if body == 0 else B)
        bend += errors.radius[body] * off * (2.0 * spin + off)
    return sqrt(8.0 * bending * max(errors.sigma, 1e-300) / bend) if bend > 0.0 else inf


@inlined
def set_gap_covariance(
    multibody: Any, spread: Any, i: int, j: int, ages: Any, t: float, right: float, sampling: Any, work: Any
) -> None:
    """Write the covariance of relative position at t and of relative velocity, along work.frame, into work.joint.

    right: see `add_covariance`.
    """
    bodies = multibody.bodies
    work.joint[:] = 0.0
    times = t, sampling.horizon
    if not bodies.static[i]:
        add_covariance(spread, i, ages[0], t, right, sampling.stale_acceleration, sampling.planar, work)
        add_arc_errors(work.motion[0], spread, i, ages[0], times, turns_by_yaw(spread, i, sampling.planar), work)
    if not bodies.static[j]:
        add_covariance(spread, j, ages[1], t, right, sampling.stale_acceleration, sampling.planar, work)
        add_arc_errors(work.motion[1], spread, j, ages[1], times, turns_by_yaw(spread, j, sampling.planar), work)


@inlined
def acceleration_terms(multibody: Any, spread: Any, i: int, j: int, ages: Any) -> Vector:
    """Factors (3,) of t^2, t^3 and t^4 in the variance of the gap from unknown accelerations from now on.

    A body is off by e (age + t)^2 / 2 then, with the same e before now, which `add_covariance` includes.
    """
    bodies = multibody.bodies
    a = b = c = 0.0
    for side in range(2):
        k, age = (i, ages[0]) if side == 0 else (j, ages[1])
        if not bodies.static[k]:
            square = unknown_acceleration(spread, k, False, 0, 0.0) ** 2
            a, b, c = a + 0.5 * square * age * age, b + square * age, c + 0.25 * square
    return a, b, c

"""Courses: the paths on which bodies go on from their states, until they stand.

A body goes straight with a constant acceleration, or along an arc: its velocity turns with it, so that its twist is
constant in its own frame, which is a rotation about a fixed axis and a shift along that axis (a screw). A body that
brakes until it stands, or has an acceleration along an arc, runs through the same path and the same rotation in another
time, s(t) = t + c t^2 / 2: so it stays on its circle, and ceases to turn when it stands.
(Murray, Li and Sastry, A mathematical introduction to robotic manipulation, 1994, 2.3: exponential of a twist)
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, cross, dot
from collision_monitor.motion.trigonometry import sin_cos
from collision_monitor.tolerances import EPSILON

STRAIGHT: Final = 0
STOPPING: Final = 1
ARC: Final = 2
"""Courses: straight without an end, as most are; straight until the body stands; an arc, with or without an end."""

ASIDE: Final = 1.0
"""Largest part of an acceleration across the velocity, relative to that against it, of a body that brakes. Larger: one
that turns away counts as one that brakes."""

FASTER: Final = 1.0
"""1/s: largest increase of the speed on an arc, in parts of the speed. Larger: a robot that turns in place and starts
to drive would be predicted to turn as much faster as it drives faster. It keeps its rate of turn instead."""

ALIGNED: Final = 1e-9
"""Sine of the angle between velocity and axis of rotation up to which a body does not bend: round-off turns so far."""

SLOWEST: Final = 1e-9
"""rad/s. Slower, a body bends by nothing that counts: 1e-9 of its way in a second."""

SMALL_ANGLE: Final = 1e-4
"""rad, below which the series of the logarithm of a screw is exact to round-off."""

SERIES: Final = 0.5
"""rad. Up to it, the shift of an arc is computed from a series, because its closed form cancels."""

STILL: Final = (0.0, 0.0, 0.0)


class Place(NamedTuple):
    """Where a body is on its course, relative to its state. World axes."""

    moved: Any  # (3,): displacement of the origin (m)
    velocity: Any  # (3,): m/s
    rate: Any  # factor of the angular velocity of the state


class Change(NamedTuple):
    """How a motion changes at a time, and in a span after it. World axes."""

    acceleration: Any  # (3,): of the origin at that time (m/s^2)
    jerk: Any  # bound on the change of that acceleration in the span (m/s^3)
    turning: Any  # (3,): angular acceleration, constant in the span (rad/s^2)


class Course(NamedTuple):
    """The course of a state, as it is stored beside its velocities."""

    kind: Any  # STRAIGHT, STOPPING or ARC
    acceleration: Any  # (3,): what acts on that course (m/s^2, world axes); on an arc along the velocity
    rest: Any  # s after the state, from which on the body stands; infinite: it never does


@device
def course_of(v: Vector, w: Vector, a: Vector, turns: bool, stops: bool) -> Course:
    """The course of a state: velocity v, angular velocity w, acceleration a, in world axes.

    turns: the velocity turns with the body. stops: an acceleration against the velocity ends at rest.
    """
    vv, along = dot(v, v), dot(a, v)
    part = along / vv if vv > 0.0 else 0.0  # of the speed, per second
    aligned = (part * v[0], part * v[1], part * v[2])
    across, aside = cross(w, v), cross(a, v)
    bends = dot(across, across)
    is_arc = turns and bends > ALIGNED * ALIGNED * vv * dot(w, w) and dot(w, w) > SLOWEST * SLOWEST
    # an acceleration across the velocity, other than the arc's own, is that of another path
    is_arc = is_arc and dot(aside, aside) <= 4.0 * bends * vv
    if is_arc and not part <= FASTER:  # along the parabola that fits the arc best
        is_arc, a = False, (a[0] + across[0], a[1] + across[1], a[2] + across[2])
    brakes = stops and part < 0.0 and (is_arc or sqrt(dot(aside, aside)) <= -ASIDE * along)
    rest = -1.0 / part if brakes else inf
    if is_arc:
        return Course(ARC, aligned, rest)
    return Course(STOPPING, aligned, rest) if rest < inf else Course(STRAIGHT, a, inf)


@inlined
def screw_velocity(moved: Vector, turn: Vector) -> Vector:
    """Velocity at first of the constant twist with which a body moves by `moved` in 1 s and turns by the vector `turn`.

    World axes. (Murray, Li and Sastry, 1994, 2.3: logarithm of a rigid motion)
    """
    angle = sqrt(dot(turn, turn))
    tail = 1.0 / 12.0
    if angle >= SMALL_ANGLE:
        half = 0.5 * angle
        sine, cosine = sin_cos(half)
        tail = (1.0 - half * cosine / sine) / (angle * angle)
    across = cross(turn, moved)
    inward = cross(turn, across)
    return (
        moved[0] - 0.5 * across[0] + tail * inward[0],
        moved[1] - 0.5 * across[1] + tail * inward[1],
        moved[2] - 0.5 * across[2] + tail * inward[2],
    )


@inlined
def bends(v: Vector, w: Vector) -> bool:
    """Whether a body with a constant twist in its own frame leaves a line by more than round-off."""
    across = cross(w, v)
    least = 4.0 * EPSILON
    return dot(across, across) > least * least * dot(w, w) * dot(v, v)


@inlined
def speed_change(v: Vector, a: Vector) -> float:
    """Change per second (1/s) of the speed, in parts of the first speed |v|; for a along v."""
    along = dot(a, v)
    return along / dot(v, v) if along != 0.0 else 0.0


@outlined
def turned_for(kind: int, v: Vector, a: Vector, t: float, rest: float) -> float:
    """Time (s) in which a body turns at its first rate as far as on its course in t (s) after its state."""
    if kind == STRAIGHT:
        return t
    t = min(t, rest)
    return t + 0.5 * speed_change(v, a) * t * t


@inlined
def _screw(v: Vector, w: Vector, s: float) -> tuple[Vector, Vector]:
    """Displacement (m) in s (s) of a body with a constant twist in its own frame, and its velocity then (m/s)."""
    ww = dot(w, w)
    size = sqrt(ww)
    angle = size * s
    across = cross(w, v)
    inward = cross(w, across)
    half_sine, half_cosine = sin_cos(0.5 * angle)
    one = 2.0 * half_sine * half_cosine / size  # sin / w
    two = 2.0 * half_sine * half_sine / ww  # (1 - cos) / w^2
    if abs(angle) < SERIES:  # (angle - sin) / w^3
        z = angle * angle
        tail = 1.0 - z / 72.0 * (1.0 - z / 110.0 * (1.0 - z / 156.0))
        three = s * s * s / 6.0 * (1.0 - z / 20.0 * (1.0 - z / 42.0 * tail))
    else:
        three = (s - one) / ww
    moved = (
        v[0] * s + across[0] * two + inward[0] * three,
        v[1] * s + across[1] * two + inward[1] * three,
        v[2] * s + across[2] * two + inward[2] * three,
    )
    velocity = (
        v[0] + across[0] * one + inward[0] * two,
        v[1] + across[1] * one + inward[1] * two,
        v[2] + across[2] * one + inward[2] * two,
    )
    return moved, velocity


@outlined
def place_on(kind: int, v: Vector, w: Vector, a: Vector, t: float, rest: float) -> Place:
    """Where a body is t (s) after its state: velocity v, angular velocity w, acceleration a and rest of its Course."""
    if t == 0.0 < rest:
        return Place(STILL, v, 1.0)
    stands, t = t >= rest, min(t, rest)
    if kind == STRAIGHT:
        half = 0.5 * t * t
        moved = (v[0] * t + a[0] * half, v[1] * t + a[1] * half, v[2] * t + a[2] * half)
        return Place(moved, (v[0] + a[0] * t, v[1] + a[1] * t, v[2] + a[2] * t), 1.0)
    c = speed_change(v, a)
    s = t + 0.5 * c * t * t
    moved, heading = _screw(v, w, s) if kind == ARC else ((v[0] * s, v[1] * s, v[2] * s), v)
    if stands:
        return Place(moved, STILL, 0.0)
    rate = 1.0 + c * t
    return Place(moved, (rate * heading[0], rate * heading[1], rate * heading[2]), rate)


@inlined
def change_on(
    kind: int, v: Vector, w: Vector, a: Vector, t: float, rest: float, span: float, now: Vector
) -> Change:  # fmt: skip
    """How the motion of a body changes t (s) after its state, and in the span (s) after that, within its course.

    now: its velocity then (m/s).
    """
    if t >= rest:
        return Change(STILL, 0.0, STILL)
    if kind == STRAIGHT:
        return Change(a, 0.0, STILL)
    c = speed_change(v, a)
    turning = (c * w[0], c * w[1], c * w[2])
    if kind == STOPPING:
        return Change(a, 0.0, turning)
    rate, across, before = 1.0 + c * t, cross(w, now), cross(w, v)
    along = c / rate if rate != 0.0 else 0.0
    most = max(abs(rate), abs(1.0 + c * (t + span)))
    jerk = most * sqrt(dot(before, before)) * (3.0 * abs(c) + most * most * sqrt(dot(w, w)))
    acceleration = (
        along * now[0] + rate * across[0],
        along * now[1] + rate * across[1],
        along * now[2] + rate * across[2],
    )
    return Change(acceleration, jerk, turning)


@outlined
def most_acceleration(kind: int, v: Vector, w: Vector, a: Vector, begin: float, end: float, rest: float) -> float:
    """Bound on the acceleration (m/s^2) of a body's origin between two times (s) after its state."""
    if begin >= rest:
        return 0.0
    if kind != ARC:
        return sqrt(dot(a, a))
    c, across = speed_change(v, a), cross(w, v)
    most = max(abs(1.0 + c * begin), abs(1.0 + c * min(end, rest)))
    return sqrt(c * c * dot(v, v) + most**4 * dot(across, across))

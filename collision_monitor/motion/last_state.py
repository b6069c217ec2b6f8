"""Where a body is now: its last state, extrapolated along its course."""

from __future__ import annotations

from math import inf
from typing import Any

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, minus, scaled
from collision_monitor.motion.course import STRAIGHT, Place, most_acceleration, place_on, turned_for
from collision_monitor.motion.motion import Twist, quaternion_to_matrix, turn_quaternion, twist_on


@inlined
def age_of(bodies: Any, i: int, now: float) -> float:
    """Seconds since the last state of body i; 0 for a static one."""
    return 0.0 if bodies.static[i] else now - bodies.time[i]


@inlined
def place_now(bodies: Any, i: int, age: float) -> Place:
    """Where body i is `age` seconds after its last state, relative to it."""
    v = bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2]
    w = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    a = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    return place_on(bodies.course[i], v, w, a, age, bodies.rest[i])


@inlined
def position_now(bodies: Any, i: int, age: float) -> Vector:
    """Position of body i's origin `age` seconds after its last state (m)."""
    p, v, a = bodies.position, bodies.linear, bodies.acceleration
    if bodies.course[i] != STRAIGHT:
        moved = place_now(bodies, i, age).moved
        return p[i, 0] + moved[0], p[i, 1] + moved[1], p[i, 2] + moved[2]
    return (
        p[i, 0] + (v[i, 0] * age + 0.5 * a[i, 0] * age * age),
        p[i, 1] + (v[i, 1] * age + 0.5 * a[i, 1] * age * age),
        p[i, 2] + (v[i, 2] * age + 0.5 * a[i, 2] * age * age),
    )


@inlined
def bending_now(bodies: Any, i: int, age: float, ahead: float) -> float:
    """Bound on the acceleration (m/s^2) of body i's origin in `ahead` s, from `age` s after its last state on."""
    v = bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2]
    w = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    a = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    return most_acceleration(bodies.course[i], v, w, a, age, age + ahead, bodies.rest[i])


@inlined
def _coordinate(bodies: Any, i: int, age_i: float, j: int, age_j: float, c: int) -> float:
    moved = bodies.linear[j, c] * age_j - bodies.linear[i, c] * age_i
    bent = 0.5 * bodies.acceleration[j, c] * age_j * age_j - 0.5 * bodies.acceleration[i, c] * age_i * age_i
    return bodies.position[j, c] - bodies.position[i, c] + (moved + bent)


@inlined
def relative_state_now(
    bodies: Any, i: int, age_i: float, j: int, age_j: float
) -> tuple[Vector, Vector, Vector, Vector]:  # fmt: skip
    """Position (m) and velocity (m/s) of body j's origin relative to body i's, and both angular velocities (rad/s).

    Each body is extrapolated by the age (s) of its last state.
    """
    p, v, a, w = bodies.position, bodies.linear, bodies.acceleration, bodies.angular
    w_i, w_j = (w[i, 0], w[i, 1], w[i, 2]), (w[j, 0], w[j, 1], w[j, 2])
    if bodies.course[i] != STRAIGHT or bodies.course[j] != STRAIGHT:
        one, other = place_now(bodies, i, age_i), place_now(bodies, j, age_j)
        moved = minus(other.moved, one.moved)
        return (
            (p[j, 0] - p[i, 0] + moved[0], p[j, 1] - p[i, 1] + moved[1], p[j, 2] - p[i, 2] + moved[2]),
            minus(other.velocity, one.velocity), scaled(w_i, one.rate), scaled(w_j, other.rate),
        )  # fmt: skip
    position = (
        _coordinate(bodies, i, age_i, j, age_j, 0),
        _coordinate(bodies, i, age_i, j, age_j, 1),
        _coordinate(bodies, i, age_i, j, age_j, 2),
    )
    velocity = (
        v[j, 0] - v[i, 0] + (a[j, 0] * age_j - a[i, 0] * age_i),
        v[j, 1] - v[i, 1] + (a[j, 1] * age_j - a[i, 1] * age_i),
        v[j, 2] - v[i, 2] + (a[j, 2] * age_j - a[i, 2] * age_i),
    )
    return position, velocity, w_i, w_j


@inlined
def twist_now(bodies: Any, i: int, age: float) -> Twist:
    """How body i moves `age` seconds after its last state."""
    v = bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2]
    w = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    a = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    return twist_on(bodies.course[i], v, w, a, age, bodies.rest[i])


@inlined
def quaternion_now(bodies: Any, i: int, age: float, out: Any) -> None:
    """Write the orientation of body i `age` seconds after its last state into out (4,)."""
    wx, wy, wz = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    if bodies.course[i] != STRAIGHT:
        v = bodies.linear[i, 0], bodies.linear[i, 1], bodies.linear[i, 2]
        a = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
        age = turned_for(bodies.course[i], v, a, age, bodies.rest[i])
    turn_quaternion(bodies.quaternion, i, wx, wy, wz, age, out)


@device
def rotation_now(bodies: Any, i: int, now: float, q: Any, R: Any) -> None:
    """Write the rotation of body i at `now`, extrapolated from its last state, into R (3, 3); q (1, 4): scratch."""
    quaternion_now(bodies, i, age_of(bodies, i, now), q[0])
    quaternion_to_matrix(q, 0, R)


@device
def carry_on(bodies: Any, i: int, now: float, q: Any, m: Any) -> float:
    """Write body i's last state, extrapolated to `now`, as the motion m (MOTION) with time 0 = now. Return its age."""
    age = 0.0 if bodies.static[i] else now - bodies.time[i]
    set_reference(bodies, i, age, 0.0, q, 0, m)
    m.radius = bodies.motion[i].radius
    return age


@inlined
def set_reference(bodies: Any, i: int, age: float, time: float, q: Any, k: int, m: Any) -> None:
    """Make body i's course, from `age` seconds after its last state on, the motion m (MOTION) from `time` on.

    q[k] (4,), written: its orientation then.
    """
    p, v, w, a = bodies.position, bodies.linear, bodies.angular, bodies.acceleration
    quaternion_now(bodies, i, age, q[k])
    quaternion_to_matrix(q, k, m.rotation)
    _set_course(
        bodies.course[i], (p[i, 0], p[i, 1], p[i, 2]), (v[i, 0], v[i, 1], v[i, 2]), (w[i, 0], w[i, 1], w[i, 2]),
        (a[i, 0], a[i, 1], a[i, 2]), bodies.rest[i], age, time, m,
    )  # fmt: skip


@outlined
def _set_course(
    kind: int, p: Vector, v: Vector, w: Vector, a: Vector, rest: float, age: float, time: float, m: Any
) -> None:  # fmt: skip
    """Make the course from a state, `age` seconds after it, the motion m (MOTION) from `time` on; see `place_on`."""
    m.course, m.rest, m.time = kind, inf, time
    if kind == STRAIGHT:
        m.x = p[0] + (v[0] * age + 0.5 * a[0] * age * age)
        m.y = p[1] + (v[1] * age + 0.5 * a[1] * age * age)
        m.z = p[2] + (v[2] * age + 0.5 * a[2] * age * age)
        m.vx, m.vy, m.vz = v[0] + a[0] * age, v[1] + a[1] * age, v[2] + a[2] * age
        m.wx, m.wy, m.wz = w
        m.ax, m.ay, m.az = a
        return
    there, m.rest = twist_on(kind, v, w, a, age, rest), time + (rest - age)
    m.x, m.y, m.z = p[0] + there.moved[0], p[1] + there.moved[1], p[2] + there.moved[2]
    m.vx, m.vy, m.vz = there.velocity
    m.wx, m.wy, m.wz = there.angular
    m.ax, m.ay, m.az = scaled(there.velocity, there.change)
    if m.rest <= time:
        m.course, m.rest = STRAIGHT, inf

"""Motion of bodies: constant twist and acceleration from a reference state, and a tube that bounds the deviation.

Every point of a body stays within tube_0 + tube_1 * (t - tube_time) metres of its place in the reference motion. While
that holds, the predictions made from the reference motion hold too. The tube of a stale object is wider (tracking.py).
"""

from __future__ import annotations

from math import sqrt
from typing import Any

import numpy as np

from collision_monitor._jit import device, inlined
from collision_monitor.broad_phase.region import Region
from collision_monitor.geometry.vector import Vector
from collision_monitor.motion.trigonometry import sin_cos

MOTION = np.dtype(
    [
        ("x", np.float64),  # position at `time` (m)
        ("y", np.float64),
        ("z", np.float64),
        ("vx", np.float64),  # m/s
        ("vy", np.float64),
        ("vz", np.float64),
        ("ax", np.float64),  # m/s^2: of the origin, constant
        ("ay", np.float64),
        ("az", np.float64),
        ("radius", np.float64),  # of the sphere about the body's origin that holds all its shapes
        ("time", np.float64),  # s after the monitor's origin, like all times
        ("tube_0", np.float64),  # m
        ("tube_1", np.float64),  # m/s
        ("spread_0", np.float64),  # m: width of its box for its uncertainty, from tube_time on
        ("spread_1", np.float64),  # m/s
        ("tube_time", np.float64),  # when the body was last within tube_0 of the reference
        ("cover", np.float64),  # collisions are predicted until this time
        ("covered", np.float64),  # and were until this time before this step; -inf: not at all
        ("wx", np.float64),  # rad/s
        ("wy", np.float64),
        ("wz", np.float64),
        ("rotation", np.float64, (3, 3)),  # at `time`
    ]
)
"""The reference motion that predictions rest on. One record per body, because a prediction reads two of them whole."""


@inlined
def quaternion_to_matrix(q: Any, i: int, out: Any) -> None:
    """Write the rotation matrix of the unit quaternion q[i] (x, y, z, w) into out (3, 3)."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    out[0, 0] = 1.0 - 2.0 * (y * y + z * z)
    out[0, 1] = 2.0 * (x * y - w * z)
    out[0, 2] = 2.0 * (x * z + w * y)
    out[1, 0] = 2.0 * (x * y + w * z)
    out[1, 1] = 1.0 - 2.0 * (x * x + z * z)
    out[1, 2] = 2.0 * (y * z - w * x)
    out[2, 0] = 2.0 * (x * z - w * y)
    out[2, 1] = 2.0 * (y * z + w * x)
    out[2, 2] = 1.0 - 2.0 * (x * x + y * y)


@inlined
def rotation_at(m: Any, t: float, out: Any) -> None:
    """Write the rotation of the motion m (MOTION) at time t, exp((t - m.time) [w]x) R, into out (3, 3) (Rodrigues)."""
    R = m.rotation
    rate = sqrt(m.wx * m.wx + m.wy * m.wy + m.wz * m.wz)
    angle = rate * (t - m.time)
    if angle == 0.0:
        for i in range(3):
            for j in range(3):
                out[i, j] = R[i, j]
        return
    kx, ky, kz = m.wx / rate, m.wy / rate, m.wz / rate
    half_sine, half_cosine = sin_cos(0.5 * angle)
    c = 2.0 * half_sine * half_sine  # 1 - cos, without cancellation
    s = 2.0 * half_sine * half_cosine
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        ax, ay, az = ky * z - kz * y, kz * x - kx * z, kx * y - ky * x
        out[0, j] = x + s * ax + c * (ky * az - kz * ay)
        out[1, j] = y + s * ay + c * (kz * ax - kx * az)
        out[2, j] = z + s * az + c * (kx * ay - ky * ax)


@inlined
def relative_position(A: Any, B: Any, t: float) -> Vector:
    """Position of motion B relative to motion A at time t (m). Positions are subtracted first, against round-off."""
    ta, tb = t - A.time, t - B.time
    sa, sb = 0.5 * ta * ta, 0.5 * tb * tb
    return (
        B.x - A.x + (B.vx * tb - A.vx * ta) + (B.ax * sb - A.ax * sa),
        B.y - A.y + (B.vy * tb - A.vy * ta) + (B.ay * sb - A.ay * sa),
        B.z - A.z + (B.vz * tb - A.vz * ta) + (B.az * sb - A.az * sa),
    )


@inlined
def relative_velocity(A: Any, B: Any, t: float) -> Vector:
    """Velocity of motion B relative to motion A at time t (m/s)."""
    ta, tb = t - A.time, t - B.time
    return (
        B.vx - A.vx + (B.ax * tb - A.ax * ta),
        B.vy - A.vy + (B.ay * tb - A.ay * ta),
        B.vz - A.vz + (B.az * tb - A.az * ta),
    )


@inlined
def half_acceleration(A: Any, B: Any) -> float:
    """Half the magnitude of the acceleration of motion B relative to motion A (m/s^2)."""
    x, y, z = B.ax - A.ax, B.ay - A.ay, B.az - A.az
    return 0.5 * sqrt(x * x + y * y + z * z)


@inlined
def position_now(bodies: Any, i: int, age: float, c: int) -> float:
    """Coordinate c of body i's origin `age` seconds after its last state (m)."""
    return bodies.position[i, c] + (bodies.linear[i, c] * age + 0.5 * bodies.acceleration[i, c] * age * age)


@inlined
def relative_position_now(bodies: Any, i: int, age_i: float, j: int, age_j: float, c: int) -> float:
    """Coordinate c of body j's origin relative to body i's (m), each extrapolated by the age (s) of its last state."""
    moved = bodies.linear[j, c] * age_j - bodies.linear[i, c] * age_i
    bent = 0.5 * bodies.acceleration[j, c] * age_j * age_j - 0.5 * bodies.acceleration[i, c] * age_i * age_i
    return bodies.position[j, c] - bodies.position[i, c] + (moved + bent)


@inlined
def relative_velocity_now(bodies: Any, i: int, age_i: float, j: int, age_j: float, c: int) -> float:
    """Coordinate c of the velocity (m/s) of body j's origin relative to body i's."""
    return (
        bodies.linear[j, c]
        - bodies.linear[i, c]
        + (bodies.acceleration[j, c] * age_j - bodies.acceleration[i, c] * age_i)
    )


@device
def turn_quaternion(q: Any, i: int, wx: float, wy: float, wz: float, t: float, out: Any) -> None:
    """Write the orientation q[i] after t (s) at angular velocity w (rad/s, world frame) into out (4,)."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    rate = sqrt(wx * wx + wy * wy + wz * wz)
    if rate * abs(t) == 0.0:
        out[0], out[1], out[2], out[3] = x, y, z, w
        return
    s, c = sin_cos(0.5 * rate * t)
    s /= rate
    ax, ay, az = s * wx, s * wy, s * wz
    out[0] = c * x + ax * w + ay * z - az * y
    out[1] = c * y - ax * z + ay * w + az * x
    out[2] = c * z + ax * y - ay * x + az * w
    out[3] = c * w - ax * x - ay * y - az * z


@inlined
def chord_angle(ax: float, ay: float, az: float, aw: float, bx: float, by: float, bz: float, bw: float) -> float:
    """Upper bound on the angle (rad) between two unit quaternions; exact to second order for small angles."""
    dot = ax * bx + ay * by + az * bz + aw * bw
    sign = 1.0 if dot >= 0.0 else -1.0
    dx, dy, dz, dw = ax - sign * bx, ay - sign * by, az - sign * bz, aw - sign * bw
    chord = sqrt(dx * dx + dy * dy + dz * dz + dw * dw)  # = 2 sin(angle / 4)
    return 2.0 * chord * (1.0 + 0.056 * chord * chord)  # >= 4 asin(chord / 2) up to angle pi


@inlined
def age_of(bodies: Any, i: int, now: float) -> float:
    """Seconds since the last state of body i; 0 for a static one."""
    return 0.0 if bodies.static[i] else now - bodies.time[i]


@device
def rotation_now(bodies: Any, i: int, now: float, q: Any, R: Any) -> None:
    """Write the rotation of body i at `now`, extrapolated from its last state, into R (3, 3); q (1, 4): scratch."""
    wx, wy, wz = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    turn_quaternion(bodies.quaternion, i, wx, wy, wz, age_of(bodies, i, now), q[0])
    quaternion_to_matrix(q, 0, R)


@device
def swept_box(bodies: Any, i: int, begin: float, margin: float) -> Region:
    """Box that contains body i, its tube and spread, and `margin` (m), from `begin` until its cover time."""
    m = bodies.motion[i]
    sweep = 0.0 if bodies.static[i] else m.cover - begin
    half = m.radius + margin + m.tube_0 + m.spread_0 + (m.tube_1 + m.spread_1) * (begin - m.tube_time + sweep)
    ahead = 0.5 * sweep
    middle = begin - m.time + ahead
    # a t^2 / 2: the mean of both ends, and half of their difference
    first, last = 0.25 * (middle - ahead) ** 2, 0.25 * (middle + ahead) ** 2
    between, bent = first + last, last - first
    return Region(
        m.x + middle * m.vx + between * m.ax,
        m.y + middle * m.vy + between * m.ay,
        m.z + middle * m.vz + between * m.az,
        half + ahead * abs(m.vx) + bent * abs(m.ax),
        half + ahead * abs(m.vy) + bent * abs(m.ay),
        half + ahead * abs(m.vz) + bent * abs(m.az),
    )  # fmt: skip


@device
def carry_on(bodies: Any, i: int, now: float, q: Any, m: Any) -> float:
    """Write body i's last state, extrapolated to `now`, as the motion m (MOTION) with time 0 = now. Return its age."""
    age = 0.0 if bodies.static[i] else now - bodies.time[i]
    m.ax, m.ay, m.az = bodies.acceleration[i, 0], bodies.acceleration[i, 1], bodies.acceleration[i, 2]
    m.x, m.y, m.z = (
        position_now(bodies, i, age, 0), position_now(bodies, i, age, 1), position_now(bodies, i, age, 2)
    )  # fmt: skip
    m.vx = bodies.linear[i, 0] + m.ax * age
    m.vy = bodies.linear[i, 1] + m.ay * age
    m.vz = bodies.linear[i, 2] + m.az * age
    m.wx, m.wy, m.wz = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    turn_quaternion(bodies.quaternion, i, m.wx, m.wy, m.wz, age, q[0])
    quaternion_to_matrix(q, 0, m.rotation)
    m.time = 0.0
    m.radius = bodies.motion[i].radius
    return age

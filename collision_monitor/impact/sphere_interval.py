"""Time interval in which two moving, growing spheres overlap, in closed form."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final, NamedTuple

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector
from collision_monitor.motion.motion import half_acceleration, position_at, relative_position, relative_velocity
from collision_monitor.tolerances import EPSILON

_SMALLEST: Final = 1e-240
"""m^4/s^2: product of a squared length and a squared speed below which round-off nears the smallest float64."""


class RelativeMotion(NamedTuple):
    """Position (m) and velocity (m/s) of the second of two bodies relative to the first, at one time."""

    p: Any  # (3,)
    v: Any  # (3,)


@inlined
def relative_motion_at(A: Any, B: Any, t: float) -> RelativeMotion:
    """Approach of motion B to motion A (MOTION) at time t."""
    return RelativeMotion(relative_position(A, B, t), relative_velocity(A, B, t))


@device
def sphere_interval(
    d: Vector, v: Vector, reach: float, growth: float, end: float, outward: float
) -> tuple[float, float]:
    """First and last time (s) in [0, end] at which |d + v t| <= reach + growth t; (inf, -inf): never. d, v: (3,).

    Rounded outward, so that the interval contains all these times (outward = 1), or inward, so that it contains only
    these (outward = -1). In the closed form neither the discriminant |reach v - growth d|^2 - |d x v|^2 nor the root
    c / (-b + sqrt(D)) cancels (Numerical Recipes 5.6; Haines et al., Precision improvements for ray/sphere
    intersection, 2019).
    """
    dx, dy, dz = d
    vx, vy, vz = v
    size = dx * dx + dy * dy + dz * dz + reach * reach
    rate = vx * vx + vy * vy + vz * vz + growth * growth
    if size * rate < _SMALLEST and rate > 0.0:
        # the products would underflow: scale lengths and speeds, and convert the times back
        length = 1.0 / max(abs(dx), abs(dy), abs(dz), reach, 1e-300)
        speed = 1.0 / max(abs(vx), abs(vy), abs(vz), abs(growth), 1e-300)
        unit = length / speed
        until = end * unit
        d = (dx * length, dy * length, dz * length)
        v = (vx * speed, vy * speed, vz * speed)
        first, last = _interval(d, v, reach * length, growth * speed, until, outward)
        return first / unit, end if last == until else last / unit
    return _interval(d, v, reach, growth, end, outward)


@inlined
def _interval(d: Vector, v: Vector, reach: float, growth: float, end: float, outward: float) -> tuple[float, float]:
    dx, dy, dz = d
    vx, vy, vz = v
    e = outward * EPSILON
    pp = dx * dx + dy * dy + dz * dz
    vv = vx * vx + vy * vy + vz * vz
    qq = (pp + reach * reach) * (vv + growth * growth)
    c = pp - reach * reach - 4.0 * e * (pp + reach * reach)
    a = vv - growth * growth - 4.0 * e * (vv + growth * growth)
    b = dx * vx + dy * vy + dz * vz - reach * growth
    # most pairs move apart or pass; these are found without a root
    if c > 0.0 and a >= 0.0 and b > 0.0 and b * b > 100.0 * EPSILON * EPSILON * qq:
        return inf, -inf
    sx, sy, sz = reach * vx - growth * dx, reach * vy - growth * dy, reach * vz - growth * dz
    ox, oy, oz = dy * vz - dz * vy, dz * vx - dx * vz, dx * vy - dy * vx
    near, far = sx * sx + sy * sy + sz * sz, ox * ox + oy * oy + oz * oz
    miss = far - near
    if c > 0.0 and miss > 100.0 * EPSILON * EPSILON * qq and miss * miss > 1e4 * EPSILON * EPSILON * qq * (near + far):
        return inf, -inf
    q = sqrt(qq)
    b -= 8.0 * e * q
    if c > 0.0 and b >= 0.0 and a >= 0.0:
        return inf, -inf
    discriminant = near - far + 32.0 * e * q * (sqrt(near + far) + EPSILON * q)
    first = 0.0
    s = sqrt(max(discriminant, 0.0)) - b
    if c > 0.0:
        if discriminant < 0.0 or s <= 0.0:
            return inf, -inf
        first = c / s * (1.0 - 4.0 * e)
        if first > end:
            return inf, -inf
    if a <= 0.0:
        return first, end
    return first, min(end, s / a * (1.0 + 4.0 * e))


@inlined
def meeting_of_spheres(A: Any, B: Any, approach: RelativeMotion, begin: float, t: float, event: Any) -> None:
    """Write point, normal and closing speed of the contact of the bounding spheres of A and B, t (s) after begin.

    approach: of B to A at begin. event: the IMPACT record to write.
    """
    p, v = approach
    dx, dy, dz = (
        relative_position(A, B, begin + t)
        if half_acceleration(A, B, begin, begin + t) > 0.0
        else (p[0] + v[0] * t, p[1] + v[1] * t, p[2] + v[2] * t)
    )
    length = sqrt(dx * dx + dy * dy + dz * dz)
    if length > 0.0:
        nx, ny, nz = dx / length, dy / length, dz / length
    else:
        nx, ny, nz = 0.0, 0.0, 1.0
    x, y, z = position_at(A, begin + t)
    share = A.radius / (A.radius + B.radius) * length
    event.point_x, event.point_y, event.point_z = x + share * nx, y + share * ny, z + share * nz
    event.normal_x, event.normal_y, event.normal_z = nx, ny, nz
    vx, vy, vz = relative_velocity(A, B, begin + t)
    event.closing_speed = -(vx * nx + vy * ny + vz * nz)

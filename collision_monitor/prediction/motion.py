"""Bodies and how they move: constant twist from a reference state, and how far the truth may be from it.

The deviation of a body is bounded by a tube: every point of it stays within tube_0 + tube_1 * (t - ref_time) metres
of where the reference motion puts it. While that holds, what was predicted from the reference holds too.
"""

from __future__ import annotations

from math import cos, sin, sqrt
from typing import Any, NamedTuple

import numpy as np

from collision_monitor._jit import device


class Bodies(NamedTuple):
    """N slots of bodies, structure of arrays. Times are seconds after the monitor's origin. World frame."""

    id: Any  # (N,) uint32
    used: Any  # (N,) bool: the slot holds a body
    static: Any  # (N,) bool
    seen: Any  # (N,) bool: there is a state (always for static bodies)
    group: Any  # (N,) uint32
    mask: Any  # (N,) uint32
    first_shape: Any  # (N,) int32: slot in the shape table; further shapes follow by next_shape
    radius: Any  # (N,) float64: of the sphere about the body's origin that holds all its shapes
    # the last state
    time: Any  # (N,) float64
    position: Any  # (N, 3)
    quaternion: Any  # (N, 4)
    linear: Any  # (N, 3)
    angular: Any  # (N, 3)
    # the reference motion that predictions rest on
    version: Any  # (N,) uint32: counts up whenever the reference changes
    ref_time: Any  # (N,) float64
    ref_position: Any  # (N, 3)
    ref_quaternion: Any  # (N, 4)
    ref_rotation: Any  # (N, 3, 3)
    ref_linear: Any  # (N, 3)
    ref_angular: Any  # (N, 3)
    tube_0: Any  # (N,) float64, m
    tube_1: Any  # (N,) float64, m/s
    cover: Any  # (N,) float64: collisions are predicted until this time


def make_bodies(capacity: int) -> Bodies:
    """Empty slots."""
    n = capacity
    return Bodies(
        id=np.zeros(n, np.uint32),
        used=np.zeros(n, np.bool_),
        static=np.zeros(n, np.bool_),
        seen=np.zeros(n, np.bool_),
        group=np.zeros(n, np.uint32),
        mask=np.zeros(n, np.uint32),
        first_shape=np.full(n, -1, np.int32),
        radius=np.zeros(n),
        time=np.zeros(n),
        position=np.zeros((n, 3)),
        quaternion=np.zeros((n, 4)),
        linear=np.zeros((n, 3)),
        angular=np.zeros((n, 3)),
        version=np.zeros(n, np.uint32),
        ref_time=np.zeros(n),
        ref_position=np.zeros((n, 3)),
        ref_quaternion=np.zeros((n, 4)),
        ref_rotation=np.zeros((n, 3, 3)),
        ref_linear=np.zeros((n, 3)),
        ref_angular=np.zeros((n, 3)),
        tube_0=np.zeros(n),
        tube_1=np.zeros(n),
        cover=np.zeros(n),
    )


def grown(bodies: Bodies, capacity: int) -> Bodies:
    """The same bodies in more slots."""
    new = make_bodies(capacity)
    for source, target in zip(bodies, new, strict=True):
        target[: len(source)] = source
    return new


@device
def quaternion_to_matrix(q, i, out):  # type: ignore[no-untyped-def]
    """Rotation matrix of the unit quaternion q[i] (x, y, z, w) into out (3, 3)."""
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


@device
def turned(R, wx, wy, wz, t, out):  # type: ignore[no-untyped-def]
    """out (3, 3) = exp(t [w]x) R: the rotation after t seconds at angular velocity w in the world (Rodrigues)."""
    rate = sqrt(wx * wx + wy * wy + wz * wz)
    if rate * abs(t) == 0.0:
        for i in range(3):
            for j in range(3):
                out[i, j] = R[i, j]
        return
    kx, ky, kz = wx / rate, wy / rate, wz / rate
    s = sin(rate * t)
    half = sin(0.5 * rate * t)
    c = 2.0 * half * half  # 1 - cos, without cancellation
    for j in range(3):
        x, y, z = R[0, j], R[1, j], R[2, j]
        ax, ay, az = ky * z - kz * y, kz * x - kx * z, kx * y - ky * x
        out[0, j] = x + s * ax + c * (ky * az - kz * ay)
        out[1, j] = y + s * ay + c * (kz * ax - kx * az)
        out[2, j] = z + s * az + c * (kx * ay - ky * ax)


@device
def turn_quaternion(q, i, wx, wy, wz, t, out):  # type: ignore[no-untyped-def]
    """out (4,) = the orientation q[i] after t seconds at angular velocity w in the world."""
    x, y, z, w = q[i, 0], q[i, 1], q[i, 2], q[i, 3]
    rate = sqrt(wx * wx + wy * wy + wz * wz)
    if rate * abs(t) == 0.0:
        out[0], out[1], out[2], out[3] = x, y, z, w
        return
    s = sin(0.5 * rate * t) / rate
    c = cos(0.5 * rate * t)
    ax, ay, az = s * wx, s * wy, s * wz
    out[0] = c * x + ax * w + ay * z - az * y
    out[1] = c * y - ax * z + ay * w + az * x
    out[2] = c * z + ax * y - ay * x + az * w
    out[3] = c * w - ax * x - ay * y - az * z


@device
def angle_between(a, i, bx, by, bz, bw):  # type: ignore[no-untyped-def]
    """Upper bound on the angle (rad) between the orientations a[i] and b; exact to second order for small angles."""
    dot = a[i, 0] * bx + a[i, 1] * by + a[i, 2] * bz + a[i, 3] * bw
    sign = 1.0 if dot >= 0.0 else -1.0
    dx, dy = a[i, 0] - sign * bx, a[i, 1] - sign * by
    dz, dw = a[i, 2] - sign * bz, a[i, 3] - sign * bw
    chord = sqrt(dx * dx + dy * dy + dz * dz + dw * dw)  # = 2 sin(angle / 4)
    return 2.0 * chord * (1.0 + 0.056 * chord * chord)  # >= 4 asin(chord / 2) up to angle pi

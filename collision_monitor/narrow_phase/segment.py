"""Closest points of two segments, and a direction across one.

(Ericson, Real-Time Collision Detection, 5.1.9; Lumelsky, 1985)"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.tolerances import SEGMENT_PARALLEL_SIN2


@inlined
def clamp(value: float) -> float:
    """Into -1 ... 1."""
    return min(max(value, -1.0), 1.0)


@inlined
def segment_segment(
    ux: float, uy: float, uz: float, vx: float, vy: float, vz: float, px: float, py: float, pz: float
) -> Any:
    """Parameters s, t in [-1, 1] of the closest points s u and p + t v (u, v: half segments; p: B's middle from A's).

    Parallel segments answer with the middle of where they run beside each other.
    """
    a = ux * ux + uy * uy + uz * uz
    e = vx * vx + vy * vy + vz * vz
    b = ux * vx + uy * vy + uz * vz
    c = ux * px + uy * py + uz * pz
    f = vx * px + vy * py + vz * pz
    if not a > 0.0:
        return 0.0, clamp(-f / e) if e > 0.0 else 0.0
    if not e > 0.0:
        return clamp(c / a), 0.0
    # |u x v|^2 from the product itself: a e - b^2 cancels
    wx = uy * vz - uz * vy
    wy = uz * vx - ux * vz
    wz = ux * vy - uy * vx
    cross2 = wx * wx + wy * wy + wz * wz
    if cross2 <= SEGMENT_PARALLEL_SIN2 * a * e:
        # B covers [c - |b|, c + |b|] / a of A's parameter; the middle of the overlap, or the nearer end
        low = max(-1.0, (c - abs(b)) / a)
        high = min(1.0, (c + abs(b)) / a)
        s = clamp(0.5 * (low + high))
    else:
        # s of the lines' closest points: (p x v) . (u x v) / |u x v|^2
        s = clamp(
            ((py * vz - pz * vy) * wx + (pz * vx - px * vz) * wy + (px * vy - py * vx) * wz) / cross2
        )
    t = (b * s - f) / e
    if t < -1.0:
        return clamp((c - b) / a), -1.0
    if t > 1.0:
        return clamp((c + b) / a), 1.0
    return s, t

@inlined
def across(x: float, y: float, z: float, wx: float, wy: float, wz: float) -> Any:
    """A unit vector at a right angle to the unit vector (x, y, z), on the side of w."""
    if abs(x) <= abs(y) and abs(x) <= abs(z):
        nx, ny, nz = 0.0, z, -y
    elif abs(y) <= abs(z):
        nx, ny, nz = -z, 0.0, x
    else:
        nx, ny, nz = y, -x, 0.0
    length = copysign(sqrt(nx * nx + ny * ny + nz * nz), nx * wx + ny * wy + nz * wz)
    return nx / length, ny / length, nz / length

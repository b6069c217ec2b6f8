"""Closest points of two segments.

(Ericson, Real-Time Collision Detection, 5.1.9; Lumelsky, 1985)
"""

from __future__ import annotations

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, cross, dot
from collision_monitor.tolerances import SEGMENT_PARALLEL_SIN2


@inlined
def clamp_cosine(value: float) -> float:
    """Clamp to -1 ... 1."""
    return min(max(value, -1.0), 1.0)


@inlined
def segment_segment(u: Vector, v: Vector, p: Vector) -> tuple[float, float]:
    """Parameters s, t in [-1, 1] of the closest points s u and p + t v.

    u, v: half segments; p: B's middle relative to A's. For parallel segments, the closest points are in the middle of
    the part in which they run side by side.
    """
    a = dot(u, u)
    e = dot(v, v)
    b = dot(u, v)
    c = dot(u, p)
    f = dot(v, p)
    if not a > 0.0:
        return 0.0, clamp_cosine(-f / e) if e > 0.0 else 0.0
    if not e > 0.0:
        return clamp_cosine(c / a), 0.0
    # |u x v|^2 from the product itself, because a e - b^2 cancels
    w = cross(u, v)
    cross2 = dot(w, w)
    if cross2 <= SEGMENT_PARALLEL_SIN2 * a * e:
        # B covers [c - |b|, c + |b|] / a of A's parameter; take the middle of the overlap, or the nearer end
        low = max(-1.0, (c - abs(b)) / a)
        high = min(1.0, (c + abs(b)) / a)
        s = clamp_cosine(0.5 * (low + high))
    else:
        # s of the lines' closest points: (p x v) . (u x v) / |u x v|^2
        s = clamp_cosine(dot(cross(p, v), w) / cross2)
    t = (b * s - f) / e
    if t < -1.0:
        return clamp_cosine((c - b) / a), -1.0
    if t > 1.0:
        return clamp_cosine((c + b) / a), 1.0
    return s, t

"""Sphere against box, by the centre clamped to the box, or by the nearest face if it is inside. (Ericson, 5.2.5)"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import (
    Vector,
    direction,
    opposite,
    rotate,
    rotate_back,
    scaled,
    sum_of_sizes,
)
from collision_monitor.narrow_phase.contact_row import FEATURE_INDEX_B, FEATURE_TYPE_A, FEATURE_TYPE_B, write
from collision_monitor.shapes.feature_types import EDGE, FACE, SURFACE, VERTEX
from collision_monitor.tolerances import EPSILON


@inlined
def sphere_box_separation(radius: float, half: Vector, R: Any, p: Vector, out: Any) -> float:
    """Certified lower bound of the signed distance (m), its unit direction in out[0:3].

    half (m) and R (3, 3) are the box's; radius includes the margins; p = box - sphere (m).
    """
    q = opposite(rotate_back(R, p))
    x, y, z = _to_box(q, half)
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        d = (x / length, y / length, z / length)
    else:
        length, d = _nearest_face(q, half)
    out[0], out[1], out[2] = rotate(R, d)
    return length - radius - 16.0 * EPSILON * sum_of_sizes(p)


@inlined
def _to_box(q: Vector, half: Vector) -> Vector:
    """Vector from a point to the nearest point of the box."""
    return (
        min(max(q[0], -half[0]), half[0]) - q[0],
        min(max(q[1], -half[1]), half[1]) - q[1],
        min(max(q[2], -half[2]), half[2]) - q[2],
    )


@inlined
def _nearest_face(q: Vector, half: Vector) -> tuple[float, Vector]:
    """Negative depth (m) of a point in a box, and the inward normal of its nearest face; x wins ties, then y."""
    dx = half[0] - abs(q[0])
    dy = half[1] - abs(q[1])
    dz = half[2] - abs(q[2])
    if dx <= dy and dx <= dz:
        return -dx, (-copysign(1.0, q[0]), 0.0, 0.0)
    if dy <= dz:
        return -dy, (0.0, -copysign(1.0, q[1]), 0.0)
    return -dz, (0.0, 0.0, -copysign(1.0, q[2]))


@inlined
def sphere_box_contact(radius: float, half: Vector, margin: float, R: Any, p: Vector, out: Any) -> None:
    """Write the contact of a sphere (`radius` includes its margin) and a box with `margin` (m).

    The features of the box are numbered as in box_box.
    """
    q = opposite(rotate_back(R, p))
    qx, qy, qz = q
    outside = int(abs(qx) > half[0]) + int(abs(qy) > half[1]) + int(abs(qz) > half[2])
    if outside > 0:
        distance, d = direction(_to_box(q, half))
    else:
        distance, d = _nearest_face(q, half)
    n = rotate(R, d)
    bound = 16.0 * EPSILON * (sum_of_sizes(p) + radius + margin)
    write(out, distance - radius - margin, n, scaled(n, radius), bound)
    out[FEATURE_TYPE_A] = SURFACE
    if outside <= 1:
        x, y, z = d
        out[FEATURE_TYPE_B] = FACE
        if abs(x) >= abs(y) and abs(x) >= abs(z):
            out[FEATURE_INDEX_B] = 0.0 if x < 0.0 else 1.0
        elif abs(y) >= abs(z):
            out[FEATURE_INDEX_B] = 2.0 if y < 0.0 else 3.0
        else:
            out[FEATURE_INDEX_B] = 4.0 if z < 0.0 else 5.0
    elif outside == 2:
        out[FEATURE_TYPE_B] = EDGE
        if abs(qx) <= half[0]:
            out[FEATURE_INDEX_B] = 0.0 + (1.0 if qy > 0.0 else 0.0) + (2.0 if qz > 0.0 else 0.0)
        elif abs(qy) <= half[1]:
            out[FEATURE_INDEX_B] = 4.0 + (1.0 if qz > 0.0 else 0.0) + (2.0 if qx > 0.0 else 0.0)
        else:
            out[FEATURE_INDEX_B] = 8.0 + (1.0 if qx > 0.0 else 0.0) + (2.0 if qy > 0.0 else 0.0)
    else:
        out[FEATURE_TYPE_B] = VERTEX
        out[FEATURE_INDEX_B] = (1.0 if qx > 0.0 else 0.0) + (2.0 if qy > 0.0 else 0.0) + (4.0 if qz > 0.0 else 0.0)

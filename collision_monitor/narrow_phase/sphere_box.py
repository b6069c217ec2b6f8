"""Sphere against box: the centre clamped to the box, or the nearest face where it is inside. (Ericson, 5.2.5)"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.narrow_phase.contact_row import EDGE, FACE, SURFACE, VERTEX, write
from collision_monitor.narrow_phase.sphere_sphere import direction
from collision_monitor.tolerances import EPSILON


@inlined
def sphere_box_separation(
    radius: float, hx: float, hy: float, hz: float, R: Any, px: float, py: float, pz: float, out: Any
) -> float:
    """Distance of the surfaces (m), negative where they overlap. R (3, 3) is the box's; p = box - sphere."""
    qx = -(R[0, 0] * px + R[1, 0] * py + R[2, 0] * pz)
    qy = -(R[0, 1] * px + R[1, 1] * py + R[2, 1] * pz)
    qz = -(R[0, 2] * px + R[1, 2] * py + R[2, 2] * pz)
    x = min(max(qx, -hx), hx) - qx
    y = min(max(qy, -hy), hy) - qy
    z = min(max(qz, -hz), hz) - qz
    length = sqrt(x * x + y * y + z * z)
    if length > 0.0:
        x /= length
        y /= length
        z /= length
    else:
        length, x, y, z = _nearest_face(qx, qy, qz, hx, hy, hz)
    out[0] = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
    out[1] = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
    out[2] = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
    return length - radius - 16.0 * EPSILON * (abs(px) + abs(py) + abs(pz))


@inlined
def _nearest_face(qx: float, qy: float, qz: float, hx: float, hy: float, hz: float) -> Any:
    """Minus the depth of a point in a box, and the direction against the face it is nearest to; x wins ties, then y."""
    dx = hx - abs(qx)
    dy = hy - abs(qy)
    dz = hz - abs(qz)
    if dx <= dy and dx <= dz:
        return -dx, -copysign(1.0, qx), 0.0, 0.0
    if dy <= dz:
        return -dy, 0.0, -copysign(1.0, qy), 0.0
    return -dz, 0.0, 0.0, -copysign(1.0, qz)


@inlined
def sphere_box_contact(
    radius: float,
    hx: float,
    hy: float,
    hz: float,
    margin: float,
    R: Any,
    px: float,
    py: float,
    pz: float,
    out: Any,
) -> None:
    """radius with the sphere's margin, `margin` of the box (m). Features of the box as in box_box."""
    qx = -(R[0, 0] * px + R[1, 0] * py + R[2, 0] * pz)
    qy = -(R[0, 1] * px + R[1, 1] * py + R[2, 1] * pz)
    qz = -(R[0, 2] * px + R[1, 2] * py + R[2, 2] * pz)
    outside = int(abs(qx) > hx) + int(abs(qy) > hy) + int(abs(qz) > hz)
    if outside > 0:
        x = min(max(qx, -hx), hx) - qx
        y = min(max(qy, -hy), hy) - qy
        z = min(max(qz, -hz), hz) - qz
        distance, x, y, z = direction(x, y, z)
    else:
        distance, x, y, z = _nearest_face(qx, qy, qz, hx, hy, hz)
    nx = R[0, 0] * x + R[0, 1] * y + R[0, 2] * z
    ny = R[1, 0] * x + R[1, 1] * y + R[1, 2] * z
    nz = R[2, 0] * x + R[2, 1] * y + R[2, 2] * z
    bound = 16.0 * EPSILON * (abs(px) + abs(py) + abs(pz) + radius + margin)
    write(out, distance - radius - margin, nx, ny, nz, nx * radius, ny * radius, nz * radius, bound)
    out[11] = SURFACE
    if outside <= 1:
        out[13] = FACE
        if abs(x) >= abs(y) and abs(x) >= abs(z):
            out[14] = 0.0 if x < 0.0 else 1.0
        elif abs(y) >= abs(z):
            out[14] = 2.0 if y < 0.0 else 3.0
        else:
            out[14] = 4.0 if z < 0.0 else 5.0
    elif outside == 2:
        out[13] = EDGE
        if abs(qx) <= hx:
            out[14] = 0.0 + (1.0 if qy > 0.0 else 0.0) + (2.0 if qz > 0.0 else 0.0)
        elif abs(qy) <= hy:
            out[14] = 4.0 + (1.0 if qz > 0.0 else 0.0) + (2.0 if qx > 0.0 else 0.0)
        else:
            out[14] = 8.0 + (1.0 if qx > 0.0 else 0.0) + (2.0 if qy > 0.0 else 0.0)
    else:
        out[13] = VERTEX
        out[14] = (1.0 if qx > 0.0 else 0.0) + (2.0 if qy > 0.0 else 0.0) + (4.0 if qz > 0.0 else 0.0)

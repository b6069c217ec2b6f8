"""Sphere against sphere: the distance of the centres. (Ericson, Real-Time Collision Detection, 4.3.1)"""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.narrow_phase.contact_row import SURFACE, write
from collision_monitor.tolerances import EPSILON


@inlined
def direction(x: float, y: float, z: float) -> Any:
    """Length and unit vector of (x, y, z); of a zero vector: 0 and +z. Safe from overflow and underflow."""
    scale = max(abs(x), abs(y), abs(z))
    if not scale > 0.0:
        return 0.0, 0.0, 0.0, 1.0
    x /= scale
    y /= scale
    z /= scale
    length = sqrt(x * x + y * y + z * z)
    return length * scale, x / length, y / length, z / length


@inlined
def sphere_sphere_separation(ra: float, rb: float, px: float, py: float, pz: float, out: Any) -> float:
    """Distance of the surfaces (m), negative inside."""
    length = sqrt(px * px + py * py + pz * pz)
    if length > 0.0:
        out[0] = px / length
        out[1] = py / length
        out[2] = pz / length
    else:
        out[0] = 0.0
        out[1] = 0.0
        out[2] = 1.0
    return length * (1.0 - 4.0 * EPSILON) - (ra + rb)


@inlined
def sphere_sphere_contact(ra: float, rb: float, px: float, py: float, pz: float, out: Any) -> None:
    """Spheres of radius ra and rb (m), margins included; concentric ones part along +z."""
    length, nx, ny, nz = direction(px, py, pz)
    write(out, length - (ra + rb), nx, ny, nz, nx * ra, ny * ra, nz * ra, 8.0 * EPSILON * (length + ra + rb))
    out[11] = SURFACE
    out[13] = SURFACE

"""Sphere against sphere, by the distance of the centres. (Ericson, Real-Time Collision Detection, 4.3.1)"""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, direction, dot, scaled
from collision_monitor.narrow_phase.contact_row import FEATURE_TYPE_A, FEATURE_TYPE_B, write
from collision_monitor.shapes.feature_types import SURFACE
from collision_monitor.tolerances import EPSILON


@inlined
def sphere_sphere_separation(ra: float, rb: float, p: Vector, out: Any) -> float:
    """Certified lower bound of the signed distance (m), its unit direction in out[0:3]; radii include margins (m)."""
    length = sqrt(dot(p, p))
    if length > 0.0:
        out[0] = p[0] / length
        out[1] = p[1] / length
        out[2] = p[2] / length
    else:
        out[0] = 0.0
        out[1] = 0.0
        out[2] = 1.0
    return length * (1.0 - 4.0 * EPSILON) - (ra + rb)


@inlined
def sphere_sphere_contact(ra: float, rb: float, p: Vector, out: Any) -> None:
    """Write the contact of spheres with radii ra and rb (m), margins included; the normal of concentric ones is +z."""
    length, n = direction(p)
    write(out, length - (ra + rb), n, scaled(n, ra), 8.0 * EPSILON * (length + ra + rb))
    out[FEATURE_TYPE_A] = SURFACE
    out[FEATURE_TYPE_B] = SURFACE

"""Sphere against cone, as a point against a triangle in the plane through the axis."""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, across, column, dot, scaled
from collision_monitor.narrow_phase.contact_row import FEATURE_TYPE_A, write
from collision_monitor.shapes.feature_types import SURFACE
from collision_monitor.tolerances import SAT_ROUND_OFF


@inlined
def sphere_cone_contact(radius: float, r: float, h: float, margin: float, R: Any, p: Vector, out: Any) -> None:
    """Write the contact of a sphere (`radius` includes its margin) and a cone of base radius r and half height h (m).

    margin (m) and R (3, 3) are the cone's; p: the cone's centre relative to the sphere's (m).
    """
    px, py, pz = p
    axis = column(R, 2)
    zx, zy, zz = axis
    # the sphere's centre relative to the cone's: v along the axis, u away from it
    v = -dot(axis, p)
    x, y, z = -px - v * zx, -py - v * zy, -pz - v * zz
    u = sqrt(x * x + y * y + z * z)
    if u > SAT_ROUND_OFF * (r + h + abs(v)):
        x, y, z = x / u, y / u, z / u
    else:
        x, y, z = across(axis, (x, y, z))
    length = sqrt(4.0 * h * h + r * r)
    slant = (2.0 * h * u + r * (v - h)) / length
    base = -h - v
    if slant <= 0.0 and base <= 0.0:
        if slant >= base:
            distance, nu, nv = slant, 2.0 * h / length, r / length
        else:
            distance, nu, nv = base, 0.0, -1.0
    else:
        # nearest points of the slant, from the apex (0, h) to the rim (r, -h), and of the base
        t = min(max((u * r + (h - v) * 2.0 * h) / (length * length), 0.0), 1.0)
        su, sv = u - t * r, v - (h - 2.0 * t * h)
        bu, bv = u - min(u, r), v + h
        if su * su + sv * sv <= bu * bu + bv * bv:
            nu, nv = su, sv
        else:
            nu, nv = bu, bv
        distance = sqrt(nu * nu + nv * nv)
        if 0.0 < t < 1.0 and slant > 0.0 and slant <= distance:
            distance, nu, nv = slant, 2.0 * h / length, r / length
        else:
            nu, nv = nu / distance, nv / distance
    # (nu, nv) points from the cone to the sphere
    n = (-(nu * x + nv * zx), -(nu * y + nv * zy), -(nu * z + nv * zz))
    bound = SAT_ROUND_OFF * (r + h + radius + margin + abs(px) + abs(py) + abs(pz))
    write(out, distance - radius - margin, n, scaled(n, radius), bound)
    out[FEATURE_TYPE_A] = SURFACE

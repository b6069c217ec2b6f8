"""Bounds on the signed distance of a point from a convex solid, and the direction that gives the lower one.

As `point_distance`, but exact for a cone too, and close for an ellipsoid, where the upper bound is the distance along
the ray from its centre, or a ball about a point inside.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.meshes.distance.point_solid import point_solid_distance
from collision_monitor.shapes.shape_table import CONE, ELLIPSOID


@device
def point_range(table: Any, s: int, x: Vector) -> tuple[float, float, Vector]:
    """Bounds (m) on the signed distance of a point, in the frame of a solid without margin, and a unit direction n.

    The lower bound is n . x - h(n), with the support function h of the solid. The upper one may be infinite.
    """
    kind = table.kind[s]
    if kind == CONE:
        distance, n = _of_cone(table.size[s, 0], table.size[s, 1], x)
        return distance, distance, n
    if kind == ELLIPSOID:
        return _of_ellipsoid((table.size[s, 0], table.size[s, 1], table.size[s, 2]), x)
    distance, n, is_exact = point_solid_distance(table, s, x)
    return distance, distance if is_exact else inf, n


@device
def _of_cone(r: float, h: float, x: Vector) -> tuple[float, Vector]:
    """Signed distance from a cone by its base radius and half height (m), and its direction: a triangle in a plane."""
    u, v = sqrt(x[0] * x[0] + x[1] * x[1]), x[2]
    length = sqrt(4.0 * h * h + r * r)
    across, along = 2.0 * h / length, r / length  # normal of the slant
    slant, base = across * u + along * (v - h), -h - v
    nu, nv, distance = (across, along, slant) if slant >= base else (0.0, -1.0, base)
    if distance > 0.0:
        # nearest points of the slant, from the apex (0, h) to the rim (r, -h), and of the base
        t = min(max((u * r + (h - v) * 2.0 * h) / (length * length), 0.0), 1.0)
        su, sv = u - t * r, v - (h - 2.0 * t * h)
        bu, bv = u - min(u, r), v + h
        if bu * bu + bv * bv < su * su + sv * sv:
            su, sv = bu, bv
        apart = sqrt(su * su + sv * sv)
        if apart > distance:  # else that face is the nearest, and its normal is exact
            nu, nv, distance = su / apart, sv / apart, apart
    ex, ey = (x[0] / u, x[1] / u) if u > 0.0 else (1.0, 0.0)
    return distance, (nu * ex, nu * ey, nv)


@device
def _of_ellipsoid(e: Vector, x: Vector) -> tuple[float, float, Vector]:
    """`point_range` from an ellipsoid by its half axes (m)."""
    f = sqrt((x[0] / e[0]) ** 2 + (x[1] / e[1]) ** 2 + (x[2] / e[2]) ** 2)
    least = min(e[0], e[1], e[2])
    w = x[0] / (e[0] * e[0]), x[1] / (e[1] * e[1]), x[2] / (e[2] * e[2])
    steep = sqrt(dot(w, w))
    lower, n = -inf, (1.0, 0.0, 0.0)
    if steep > 0.0:  # the normal of the similar ellipsoid through the point
        n = w[0] / steep, w[1] / steep, w[2] / steep
        h = sqrt((e[0] * n[0]) ** 2 + (e[1] * n[1]) ** 2 + (e[2] * n[2]) ** 2)
        lower = dot(n, x) - h
    if f < 1.0:
        for k in range(3):
            out = abs(x[k]) - e[k]
            if out > lower:
                side = -1.0 if x[k] < 0.0 else 1.0
                lower = out
                n = (side if k == 0 else 0.0, side if k == 1 else 0.0, side if k == 2 else 0.0)
        return lower, (f - 1.0) * least, n
    return lower, sqrt(dot(x, x)) * (1.0 - 1.0 / f), n

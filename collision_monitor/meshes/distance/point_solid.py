"""Signed distance of a point from a convex solid of the shape table: exact in closed form, or a lower bound.

The signed distance from a convex solid is the largest n . x - h(n) over unit directions n, where h is the support
function of the solid. So every direction gives a lower bound. (van den Bergen, Collision Detection in Interactive 3D
Environments, 2003, chapter 4)
"""

from __future__ import annotations

from math import sqrt
from typing import Any

from collision_monitor._jit import device
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.narrow_phase.support_value import core_support
from collision_monitor.shapes.shape_table import BOX, CAPSULE, CYLINDER, HALF_SPACE, SPHERE


@device
def point_solid_distance(table: Any, s: int, x: Vector) -> tuple[float, Vector, bool]:
    """Signed distance (m) of a point, in the frame of a solid without margin, its direction out of the solid, and True.

    False: the distance is a lower bound, along the direction.
    """
    kind = table.kind[s]
    if kind == HALF_SPACE:
        n = table.size[s, 0], table.size[s, 1], table.size[s, 2]
        return dot(n, x) - table.size[s, 3], n, True
    if kind == BOX:
        return _of_box(table.size[s, 0], table.size[s, 1], table.size[s, 2], x)
    if kind == CYLINDER:
        return _of_cylinder(table.size[s, 0], table.size[s, 1], x)
    height = min(max(x[2], -table.size[s, 1]), table.size[s, 1]) if kind == CAPSULE else 0.0
    w = x[0], x[1], x[2] - height
    length = sqrt(dot(w, w))
    n = (w[0] / length, w[1] / length, w[2] / length) if length > 0.0 else (1.0, 0.0, 0.0)
    if kind == SPHERE or kind == CAPSULE:
        return length - table.size[s, 0], n, True
    return length - core_support(table, s, n[0], n[1], n[2]), n, False


@device
def _of_box(hx: float, hy: float, hz: float, x: Vector) -> tuple[float, Vector, bool]:
    """`point_distance` from a box by its half extents (m)."""
    gx, gy, gz = abs(x[0]) - hx, abs(x[1]) - hy, abs(x[2]) - hz
    sx, sy, sz = (-1.0 if x[0] < 0.0 else 1.0), (-1.0 if x[1] < 0.0 else 1.0), (-1.0 if x[2] < 0.0 else 1.0)
    w = max(gx, 0.0), max(gy, 0.0), max(gz, 0.0)
    length = sqrt(dot(w, w))
    if length > 0.0:
        return length, (sx * w[0] / length, sy * w[1] / length, sz * w[2] / length), True
    if gx >= gy and gx >= gz:
        return gx, (sx, 0.0, 0.0), True
    if gy >= gz:
        return gy, (0.0, sy, 0.0), True
    return gz, (0.0, 0.0, sz), True


@device
def _of_cylinder(r: float, h: float, x: Vector) -> tuple[float, Vector, bool]:
    """`point_distance` from a cylinder by its radius and half height (m)."""
    rim = sqrt(x[0] * x[0] + x[1] * x[1])
    side, end = rim - r, abs(x[2]) - h
    up = -1.0 if x[2] < 0.0 else 1.0
    out = (x[0] / rim, x[1] / rim, 0.0) if rim > 0.0 else (1.0, 0.0, 0.0)
    if side > 0.0 and end > 0.0:
        length = sqrt(side * side + end * end)
        return length, (out[0] * side / length, out[1] * side / length, up * end / length), True
    if side > end:
        return side, out, True
    return end, (0.0, 0.0, up), True

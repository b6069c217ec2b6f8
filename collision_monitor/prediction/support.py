"""Support values: how far a shape reaches in a direction. What speed bounds along a separating axis are made of."""

from __future__ import annotations

from math import inf, sqrt

from collision_monitor._jit import inlined
from collision_monitor.geometry.shape_table import (
    BOX,
    CAPSULE,
    CIRCLE,
    CONE,
    CONVEX_HULL,
    CYLINDER,
    POLYGON,
    SPHERE,
)


@inlined
def support_value(table, slot, R, mx, my, mz):
    """max of m . x over the points x of a shape turned by R (3, 3), margin included. m need not be of unit length."""
    kind = table.kind[slot]
    s0 = table.size[slot, 0]
    s1 = table.size[slot, 1]
    length = sqrt(mx * mx + my * my + mz * mz)
    grown = table.margin[slot] * length
    if kind == SPHERE:
        return s0 * length + grown
    x = mx * R[0, 0] + my * R[1, 0] + mz * R[2, 0]
    y = mx * R[0, 1] + my * R[1, 1] + mz * R[2, 1]
    z = mx * R[0, 2] + my * R[1, 2] + mz * R[2, 2]
    if kind == BOX:
        return abs(x) * s0 + abs(y) * s1 + abs(z) * table.size[slot, 2] + grown
    if kind == CAPSULE:
        return abs(z) * s1 + s0 * length + grown
    if kind == CYLINDER:
        return abs(z) * s1 + s0 * sqrt(x * x + y * y) + grown
    if kind == CONE:
        return max(z * s1, s0 * sqrt(x * x + y * y) - z * s1) + grown
    if kind == CIRCLE:
        return s0 * sqrt(x * x + y * y) + grown
    if kind == CONVEX_HULL or kind == POLYGON:
        best = -inf
        first = table.vertex_start[slot]
        for k in range(first, first + table.vertex_count[slot]):
            best = max(best, x * table.vertices[0, k] + y * table.vertices[1, k] + z * table.vertices[2, k])
        return best + grown
    return inf

"""Support value of a core along a direction, for bounds on the speed at which a gap closes."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.shapes.shape_table import (
    BOX,
    CAPSULE,
    CIRCLE,
    CONE,
    CONVEX_HULL,
    CYLINDER,
    ELLIPSOID,
    POLYGON,
    SPHERE,
)


@inlined
def core_support(table: Any, slot: int, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of the core (m), for m = (x, y, z) of any length in the shape's own axes."""
    kind = table.kind[slot]
    s0 = table.size[slot, 0]
    s1 = table.size[slot, 1]
    if kind == SPHERE:
        return 0.0
    if kind == BOX:
        return abs(x) * s0 + abs(y) * s1 + abs(z) * table.size[slot, 2]
    if kind == CAPSULE:
        return abs(z) * s1
    if kind == CYLINDER:
        return abs(z) * s1 + s0 * sqrt(x * x + y * y)
    if kind == CONE:
        return max(z * s1, s0 * sqrt(x * x + y * y) - z * s1)
    if kind == ELLIPSOID:
        u, v, w = x * s0, y * s1, z * table.size[slot, 2]
        return sqrt(u * u + v * v + w * w)
    if kind == CIRCLE:
        return s0 * sqrt(x * x + y * y)
    if kind == CONVEX_HULL or kind == POLYGON:
        best = -inf
        first = table.vertex_start[slot]
        for k in range(first, first + table.vertex_count[slot]):
            best = max(best, x * table.vertices[0, k] + y * table.vertices[1, k] + z * table.vertices[2, k])
        return best
    return inf

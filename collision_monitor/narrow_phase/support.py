"""Support functions: the farthest point of a core shape in a direction, in the shape's own frame.

A core is the shape without its radius: a point for a sphere, a segment for a capsule, else the shape itself.
(Ericson, Real-Time Collision Detection, 9.5.4; van den Bergen, Collision Detection in
Interactive 3D Environments, 4.3.4)
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.shape_table import BOX, CAPSULE, CIRCLE, CONE, CONVEX_HULL, CYLINDER, POLYGON, SPHERE
from collision_monitor.narrow_phase.vertex_scan import farthest_vertex


@inlined
def core_radius(kind: int, s0: float) -> float:
    """Radius (m) by which the core of a shape is grown: 0 but for spheres and capsules."""
    return s0 if kind == SPHERE or kind == CAPSULE else 0.0


@inlined
def support(
    kind: int, s0: float, s1: float, s2: float, vertices: Any, start: int, count: int, dx: float, dy: float, dz: float
) -> Any:
    """Farthest point (x, y, z) of the core along d, which need not be a unit vector, and its vertex number or -1."""
    if kind == BOX:
        index = int(dx > 0.0) + 2 * int(dy > 0.0) + 4 * int(dz > 0.0)
        return (
            s0 if dx > 0.0 else -s0,
            s1 if dy > 0.0 else -s1,
            s2 if dz > 0.0 else -s2,
            index,
        )
    if kind == CAPSULE:
        return 0.0, 0.0, copysign(s1, dz), -1
    if kind == CYLINDER or kind == CONE:
        rim = sqrt(dx * dx + dy * dy)
        if kind == CONE and dz * s1 >= s0 * rim - dz * s1:
            return 0.0, 0.0, s1, -1
        z = -s1 if kind == CONE else copysign(s1, dz)
        if rim > 0.0:
            return s0 * dx / rim, s0 * dy / rim, z, -1
        return 0.0, 0.0, z, -1
    if kind == SPHERE:
        return 0.0, 0.0, 0.0, -1
    best = farthest_vertex(vertices, start, count, dx, dy, dz)
    return vertices[0, best], vertices[1, best], vertices[2, best], best


@inlined
def support_difference(
    ka: int,
    a0: float,
    a1: float,
    a2: float,
    sa: int,
    na: int,
    kb: int,
    b0: float,
    b1: float,
    b2: float,
    sb: int,
    nb: int,
    vertices: Any,
    work: Any,
    dx: float,
    dy: float,
    dz: float,
    at: int,
) -> Any:
    """Farthest point of B - A along d in A's frame; work[0:12] holds R_AB (row by row) and p_AB.

    Writes a row at work[at:at + 8]: the difference, the point on A, the vertex numbers; returns the difference.
    """
    ax, ay, az, ia = support(ka, a0, a1, a2, vertices, sa, na, -dx, -dy, -dz)
    lx, ly, lz, ib = support(
        kb,
        b0,
        b1,
        b2,
        vertices,
        sb,
        nb,
        work[0] * dx + work[3] * dy + work[6] * dz,
        work[1] * dx + work[4] * dy + work[7] * dz,
        work[2] * dx + work[5] * dy + work[8] * dz,
    )
    x = work[0] * lx + work[1] * ly + work[2] * lz + work[9] - ax
    y = work[3] * lx + work[4] * ly + work[5] * lz + work[10] - ay
    z = work[6] * lx + work[7] * ly + work[8] * lz + work[11] - az
    work[at] = x
    work[at + 1] = y
    work[at + 2] = z
    work[at + 3] = ax
    work[at + 4] = ay
    work[at + 5] = az
    work[at + 6] = ia
    work[at + 7] = ib
    return x, y, z


@inlined
def is_centred_box(kind):
    """Whether the core is a box about its origin: a segment for a capsule, a point for a sphere."""
    return kind == BOX or kind == CAPSULE or kind == SPHERE


@inlined
def core_box(table, slot):
    """Half extents (m) of such a core."""
    if table.kind[slot] == BOX:
        return table.size[slot, 0], table.size[slot, 1], table.size[slot, 2]
    if table.kind[slot] == CAPSULE:
        return 0.0, 0.0, table.size[slot, 1]
    return 0.0, 0.0, 0.0


@inlined
def rounding(table, slot):
    """Radius (m) of the sphere that rounds the core."""
    if table.kind[slot] == CAPSULE or table.kind[slot] == SPHERE:
        return table.size[slot, 0] + table.margin[slot]
    return table.margin[slot]


@inlined
def core_support(table, slot, x, y, z):
    """max of m . p over the points p of the core, for m = (x, y, z) of any length in the shape's own axes (m)."""
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
    if kind == CIRCLE:
        return s0 * sqrt(x * x + y * y)
    if kind == CONVEX_HULL or kind == POLYGON:
        best = -inf
        first = table.vertex_start[slot]
        for k in range(first, first + table.vertex_count[slot]):
            best = max(best, x * table.vertices[0, k] + y * table.vertices[1, k] + z * table.vertices[2, k])
        return best
    return inf

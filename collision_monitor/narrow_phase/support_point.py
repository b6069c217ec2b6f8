"""Support points: the farthest point of a core in a direction, for GJK, EPA and half-spaces.

(Ericson, Real-Time Collision Detection, 9.5.4; van den Bergen, Collision Detection in Interactive 3D Environments,
4.3.4)
"""

from __future__ import annotations

from math import copysign, sqrt
from typing import Any

from collision_monitor._jit import inlined
from collision_monitor.geometry.vector import Vector, minus, opposite
from collision_monitor.narrow_phase.core import Core, CorePair
from collision_monitor.narrow_phase.vertex_scan import farthest_vertex
from collision_monitor.narrow_phase.work_memory import ON_A, P_AB, R_AB
from collision_monitor.shapes.shape_table import BOX, CAPSULE, CONE, CYLINDER, ELLIPSOID, SPHERE


@inlined
def support_point(core: Core, vertices: Any, d: Vector) -> Vector:
    """Farthest point of the core along d, which need not be a unit vector, in the shape's own frame."""
    dx, dy, dz = d
    s0, s1, s2 = core.size
    kind = core.kind
    if kind == BOX:
        return s0 if dx > 0.0 else -s0, s1 if dy > 0.0 else -s1, s2 if dz > 0.0 else -s2
    if kind == CAPSULE:
        return 0.0, 0.0, copysign(s1, dz)
    if kind == CYLINDER or kind == CONE:
        rim = sqrt(dx * dx + dy * dy)
        if kind == CONE and dz * s1 >= s0 * rim - dz * s1:
            return 0.0, 0.0, s1
        z = -s1 if kind == CONE else copysign(s1, dz)
        if rim > 0.0:
            return s0 * dx / rim, s0 * dy / rim, z
        return 0.0, 0.0, z
    if kind == SPHERE:
        return 0.0, 0.0, 0.0
    if kind == ELLIPSOID:
        x, y, z = s0 * dx, s1 * dy, s2 * dz
        length = sqrt(x * x + y * y + z * z)
        if length > 0.0:
            return s0 * (x / length), s1 * (y / length), s2 * (z / length)
        return 0.0, 0.0, s2
    best = farthest_vertex(vertices, core.first, core.count, dx, dy, dz)
    return vertices[0, best], vertices[1, best], vertices[2, best]


@inlined
def support_difference(cores: CorePair, work: Any, d: Vector, at: int) -> Vector:
    """Farthest point of B - A along d in A's frame; the scratch memory holds the pose of B in that frame.

    Writes a row of the simplex at work[at]: the difference and the point on A; returns the difference.
    """
    dx, dy, dz = d
    a = support_point(cores.A, cores.vertices, opposite(d))
    lx, ly, lz = support_point(
        cores.B,
        cores.vertices,
        (
            work[R_AB] * dx + work[R_AB + 3] * dy + work[R_AB + 6] * dz,
            work[R_AB + 1] * dx + work[R_AB + 4] * dy + work[R_AB + 7] * dz,
            work[R_AB + 2] * dx + work[R_AB + 5] * dy + work[R_AB + 8] * dz,
        ),
    )
    b = (
        work[R_AB] * lx + work[R_AB + 1] * ly + work[R_AB + 2] * lz + work[P_AB],
        work[R_AB + 3] * lx + work[R_AB + 4] * ly + work[R_AB + 5] * lz + work[P_AB + 1],
        work[R_AB + 6] * lx + work[R_AB + 7] * ly + work[R_AB + 8] * lz + work[P_AB + 2],
    )
    difference = minus(b, a)
    work[at] = difference[0]
    work[at + 1] = difference[1]
    work[at + 2] = difference[2]
    work[at + ON_A] = a[0]
    work[at + ON_A + 1] = a[1]
    work[at + ON_A + 2] = a[2]
    return difference

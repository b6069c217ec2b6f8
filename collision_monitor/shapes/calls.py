"""What kernels ask of a shape of any kind: the only chains of `if kind ==` in the package that name every kind.

A chain is as fast as its branches, because LLVM inlines them; numba has no pointers to functions that it could inline.
The last line of each chain is safe: an answer for a kind that has no branch never says that a shape is smaller than it
is. test/shapes/test_kinds.py fails for a kind that lacks a branch.

A core is a shape without the radius that rounds it: a point for a sphere, a segment for a capsule, else the shape
itself. (Ericson, Real-Time Collision Detection, 9.5.4; van den Bergen, Collision Detection in Interactive 3D
Environments, 4.3.4)
"""

from __future__ import annotations

from math import copysign, inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import Vector, dot
from collision_monitor.geometry.vertex_scan import farthest_vertex
from collision_monitor.shapes.feature_types import FACE, SURFACE, UNKNOWN
from collision_monitor.shapes.kinds.box import BOX, box_distance, box_feature, box_support, box_support_point
from collision_monitor.shapes.kinds.capsule import CAPSULE, capsule_distance
from collision_monitor.shapes.kinds.circle import CIRCLE, circle_support, circle_support_point
from collision_monitor.shapes.kinds.cone import CONE, cone_support, cone_support_point
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.cylinder import (
    CYLINDER,
    cylinder_distance,
    cylinder_support,
    cylinder_support_point,
)
from collision_monitor.shapes.kinds.ellipsoid import (
    ELLIPSOID,
    ellipsoid_distance,
    ellipsoid_support,
    ellipsoid_support_point,
)
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.kinds.sphere import SPHERE, distance_from_centre
from collision_monitor.shapes.kinds.truncated_cone import TRUNCATED_CONE
from collision_monitor.shapes.revolved import (
    revolved_distance,
    revolved_feature,
    revolved_support,
    revolved_support_point,
)
from collision_monitor.tolerances import LARGEST_INPUT

BEYOND: Final = 2.0 * LARGEST_INPUT
"""Support value of a kind without a branch (m): farther than any shape reaches, so that its pairs overlap."""


@inlined
def support_point(kind: int, size: Vector, vertices: Any, first: int, count: int, d: Vector) -> Vector:
    """Farthest point of a core along d, which need not be a unit vector, in the shape's own frame."""
    if kind == BOX:
        return box_support_point(size, d)
    if kind == CAPSULE:
        return 0.0, 0.0, copysign(size[1], d[2])
    if kind == CYLINDER:
        return cylinder_support_point(size[0], size[1], d)
    if kind == CONE:
        return cone_support_point(size[0], size[1], d)
    if kind == SPHERE:
        return 0.0, 0.0, 0.0
    if kind == ELLIPSOID:
        return ellipsoid_support_point(size, d)
    if kind == CIRCLE:
        return circle_support_point(size[0], d)
    if kind == TRUNCATED_CONE:
        return revolved_support_point(size[2], size[0], size[1], d)
    if kind == CONVEX_HULL or kind == POLYGON:
        best = farthest_vertex(vertices, first, count, d[0], d[1], d[2])
        return vertices[0, best], vertices[1, best], vertices[2, best]
    return copysign(BEYOND, d[0]), copysign(BEYOND, d[1]), copysign(BEYOND, d[2])


@inlined
def core_support(table: Any, slot: int, x: float, y: float, z: float) -> float:
    """Return max m . p over the points p of the core (m), for m = (x, y, z) of any length in the shape's own axes."""
    kind = table.kind[slot]
    s0 = table.size[slot, 0]
    s1 = table.size[slot, 1]
    if kind == SPHERE:
        return 0.0
    if kind == BOX:
        return box_support((s0, s1, table.size[slot, 2]), x, y, z)
    if kind == CAPSULE:
        return abs(z) * s1
    if kind == CYLINDER:
        return cylinder_support(s0, s1, x, y, z)
    if kind == CONE:
        return cone_support(s0, s1, x, y, z)
    if kind == ELLIPSOID:
        return ellipsoid_support((s0, s1, table.size[slot, 2]), x, y, z)
    if kind == CIRCLE:
        return circle_support(s0, x, y)
    if kind == TRUNCATED_CONE:
        return revolved_support(table.size[slot, 2], s0, s1, x, y, z)
    if kind == CONVEX_HULL or kind == POLYGON:
        best = -inf
        first = table.vertex_start[slot]
        for k in range(first, first + table.vertex_count[slot]):
            best = max(best, x * table.vertices[0, k] + y * table.vertices[1, k] + z * table.vertices[2, k])
        return best
    return inf


@inlined
def core_radius(table: Any, slot: int) -> float:
    """Radius (m) by which the core of a shape without margin is grown: 0 except for spheres and capsules."""
    kind = table.kind[slot]
    return table.size[slot, 0] if kind == SPHERE or kind == CAPSULE else 0.0


@inlined
def is_centred_box(kind: int) -> bool:
    """Whether the core is a box about its origin: a segment for a capsule, a point for a sphere."""
    return kind == BOX or kind == CAPSULE or kind == SPHERE


@inlined
def core_box(table: Any, slot: int) -> Vector:
    """Half extents (m) of a core that is a box about its origin."""
    if table.kind[slot] == BOX:
        return table.size[slot, 0], table.size[slot, 1], table.size[slot, 2]
    if table.kind[slot] == CAPSULE:
        return 0.0, 0.0, table.size[slot, 1]
    return 0.0, 0.0, 0.0


@inlined
def revolved_profile(kind: int, size: Vector) -> tuple[float, float, float]:
    """Half widths of a core's profile at the top and at the bottom, and its half height (m); for kinds in REVOLVED."""
    if kind == CYLINDER:
        return size[0], size[0], size[1]
    if kind == CONE:
        return 0.0, size[0], size[1]
    if kind == TRUNCATED_CONE:
        return size[2], size[0], size[1]
    return 0.0, 0.0, size[1] if kind == CAPSULE else 0.0


@device
def point_distance_range(table: Any, s: int, x: Vector) -> tuple[float, float, Vector]:
    """Bounds (m) on the signed distance of a point, in the frame of a solid without margin, and a unit direction n.

    The lower bound is n . x - h(n), with the support function h of the solid. Both are equal where there is a closed
    form. The upper one may be infinite. The signed distance from a convex solid is the largest n . x - h(n), so every
    direction gives a lower bound.
    """
    kind = table.kind[s]
    s0, s1, s2 = table.size[s, 0], table.size[s, 1], table.size[s, 2]
    if kind == BOX:
        distance, n = box_distance((s0, s1, s2), x)
    elif kind == SPHERE:
        distance, n = distance_from_centre(x, s0)
    elif kind == CAPSULE:
        distance, n = capsule_distance(s0, s1, x)
    elif kind == CYLINDER:
        distance, n = cylinder_distance(s0, s1, x)
    elif kind == CONE:
        distance, n = revolved_distance(0.0, s0, s1, x)
    elif kind == TRUNCATED_CONE:
        distance, n = revolved_distance(s2, s0, s1, x)
    elif kind == HALF_SPACE:
        n = s0, s1, s2
        distance = dot(n, x) - table.size[s, 3]
    elif kind == ELLIPSOID:
        return ellipsoid_distance((s0, s1, s2), x)
    else:
        length = sqrt(dot(x, x))
        n = (x[0] / length, x[1] / length, x[2] / length) if length > 0.0 else (1.0, 0.0, 0.0)
        return length - core_support(table, s, n[0], n[1], n[2]), inf, n
    return distance, distance, n


@device
def point_feature(table: Any, s: int, x: Vector, n: Vector, reach: float) -> tuple[float, float]:
    """Type (feature_types.py) and index of the feature at a point x of a core's surface, for an outward normal n.

    UNKNOWN for hulls and polygons, whose features depend on their vertices. reach (m): distances up to it count as 0.
    """
    kind = table.kind[s]
    size = table.size[s, 0], table.size[s, 1], table.size[s, 2]
    if kind == BOX:
        return box_feature(size, x, n, reach)
    if kind == CYLINDER or kind == CONE or kind == TRUNCATED_CONE:
        top, bottom, half = revolved_profile(kind, size)
        return revolved_feature(top, bottom, half, x, n, reach)
    if kind == HALF_SPACE:
        return FACE, 0.0
    if kind == SPHERE or kind == CAPSULE or kind == ELLIPSOID or kind == CIRCLE:
        return SURFACE, 0.0
    return UNKNOWN, 0.0

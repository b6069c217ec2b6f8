"""What the pair tests leave open in the contacts of a step: which features touch, and how deep compounds may overlap.

Only the pairs that touch need it.
"""

from __future__ import annotations

from math import inf, sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.shape_table import (
    BOX,
    CONE,
    CONVEX_HULL,
    CYLINDER,
    HALF_SPACE,
    MESH,
    POINTS,
    POLYGON,
    TREE,
)
from collision_monitor.meshes.extent import farthest
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    DISTANCE,
    EDGE,
    FACE,
    FEATURE_INDEX_A,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    SURFACE,
    UNKNOWN,
    VERTEX,
)
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.narrow_phase.support_value import core_support
from collision_monitor.narrow_phase.vector import Vector, dot, opposite, rotate_back
from collision_monitor.prediction.bodies import place_shape
from collision_monitor.prediction.body_contact import SHAPE_I, SHAPE_J, STATUS, TOUCHING, relative_now
from collision_monitor.prediction.mesh_pair import has_mesh
from collision_monitor.prediction.motion import rotation_now
from collision_monitor.tolerances import FEATURE_TIE

ROUND_TIE: Final = 1e-6
"""Sine of the angle between a normal and an axis below which they count as parallel, because the normals that GJK finds
on round surfaces are off by up to 1e-7. Larger: a tilted cylinder stands on its face."""


@device
def _of_box(table: Any, s: int, n: Vector) -> tuple[float, float]:
    """Feature of a box that is farthest along n, numbered as in box_box.py."""
    tie = FEATURE_TIE * table.radius[s]
    free, axis, normal_axis = 0, 0, 0
    bits = 0
    for c in range(3):
        if 2.0 * table.size[s, c] * abs(n[c]) <= tie:
            free, axis = free + 1, c
        else:
            normal_axis = c
        if n[c] > 0.0:
            bits |= 1 << c
    if free == 0:
        return VERTEX, float(bits)
    if free == 1:
        return EDGE, 4.0 * axis + (bits >> (axis + 1) % 3 & 1) + 2.0 * (bits >> (axis + 2) % 3 & 1)
    return FACE, 2.0 * normal_axis + (0.0 if n[normal_axis] > 0.0 else 1.0)


@device
def _of_solid_of_revolution(table: Any, s: int, n: Vector) -> tuple[float, float]:
    """Feature of a cylinder or a cone that is farthest along n, numbered as in geometry/round_features.py."""
    r, h = table.size[s, 0], table.size[s, 1]
    rim = sqrt(n[0] * n[0] + n[1] * n[1])
    slope = n[2]
    if table.kind[s] == CONE:
        slope = (2.0 * h * n[2] - r * rim) / sqrt(4.0 * h * h + r * r)
        if slope > ROUND_TIE:
            return VERTEX, 0.0
    if abs(slope) <= ROUND_TIE:
        return SURFACE, 0.0
    end = 1.0 if table.kind[s] == CYLINDER and n[2] < 0.0 else 0.0
    return (FACE if rim <= ROUND_TIE else EDGE), end


@inlined
def _along(table: Any, k: int, n: Vector) -> Any:
    return n[0] * table.vertices[0, k] + n[1] * table.vertices[1, k] + n[2] * table.vertices[2, k]


@device
def _of_vertices(table: Any, s: int, n: Vector) -> tuple[float, float]:
    """Feature of a hull or a polygon that is farthest along n; edges and faces have the lowest number of a vertex.

    The edge of a polygon between its last and its first point has the number of the last.
    """
    first, count = table.vertex_start[s], table.vertex_count[s]
    farthest = -inf
    for k in range(first, first + count):
        farthest = max(farthest, _along(table, k, n))
    level = farthest - FEATURE_TIE * table.radius[s]
    touching, lowest, highest = 0, 0, 0
    for k in range(first, first + count):
        index = table.vertex_index[k]
        if k > first and index == table.vertex_index[k - 1]:
            continue  # padding
        if _along(table, k, n) >= level:
            lowest = index if touching == 0 else min(lowest, index)
            highest = max(highest, index)
            touching += 1
    if touching == 1:
        return VERTEX, float(lowest)
    if table.kind[s] == POLYGON:
        return EDGE, float(highest if highest - lowest > 1 and lowest == 0 else lowest)
    return (EDGE if touching == 2 else FACE), float(lowest)


@device
def feature_along(table: Any, s: int, n: Vector) -> tuple[float, float]:
    """Type (contact_row.py) and index of the feature of the shape in slot s that is farthest along n, in its frame."""
    kind = table.kind[s]
    if kind == BOX:
        return _of_box(table, s, n)
    if kind == CYLINDER or kind == CONE:
        return _of_solid_of_revolution(table, s, n)
    if kind == CONVEX_HULL or kind == POLYGON:
        return _of_vertices(table, s, n)
    if kind == HALF_SPACE:
        return FACE, 0.0
    return SURFACE, 0.0


@device
def _reach_of_body(multibody: Any, i: int, n: Vector, R_body: Any, R_shape: Any, work: Any) -> float:
    """How far all shapes of a body reach from its origin along n (m), in world axes."""
    table, parts, bodies = multibody
    reach = -inf
    s = bodies.first_shape[i]
    while s >= 0:
        o = place_shape(table, parts, s, R_body, R_shape)
        d = rotate_back(R_shape, n)
        if table.kind[s] == MESH or table.kind[s] == POINTS:
            own = farthest(table.blocks, int(table.size[s, TREE]) - 1, d, work) + table.margin[s]
        elif table.kind[s] == HALF_SPACE:
            own = table.radius[s]
        else:
            own = core_support(table, s, d[0], d[1], d[2]) + rounding(table, s)
        reach = max(reach, dot(n, o) + own)
        s = parts.next[s]
    return reach


@device
def complete_contact(multibody: Any, i: int, j: int, now: float, scratch: Any, row: Any) -> None:
    """Name the features that are UNKNOWN in a result row (RESULT) of bodies i and j, which touch, and widen its bound.

    Features are named where the contact is settled and the object is tested exactly.

    The depth of compounds and meshes is that of their deepest two pieces. A translation along the normal that parts all
    of them may be longer, by what is added to the bound. scratch: see `body_impact`.
    """
    table, parts, bodies = multibody
    quaternion, R = scratch.quaternion, scratch.rotation
    several = parts.next[bodies.first_shape[i]] >= 0 or parts.next[bodies.first_shape[j]] >= 0
    several = several or has_mesh(table, bodies.first_shape[i], bodies.first_shape[j])
    is_named = row[FEATURE_TYPE_A] != UNKNOWN and row[FEATURE_TYPE_B] != UNKNOWN
    if is_named and not (several and row[DISTANCE] <= 0.0):
        return
    n = (row[NORMAL], row[NORMAL + 1], row[NORMAL + 2])
    rotation_now(bodies, i, now, quaternion, R[0])
    rotation_now(bodies, j, now, quaternion, R[1])
    for side in range(2):
        at = FEATURE_TYPE_A if side == 0 else FEATURE_TYPE_B
        exact = bodies.excess[i if side == 0 else j] == 0.0
        if row[at] == UNKNOWN and exact and row[STATUS] == TOUCHING:
            s = int(row[SHAPE_I] if side == 0 else row[SHAPE_J])
            place_shape(table, parts, s, R[side], R[2])
            row[at], row[at + FEATURE_INDEX_A - FEATURE_TYPE_A] = feature_along(
                table, s, rotate_back(R[2], n if side == 0 else opposite(n))
            )
    if several and row[DISTANCE] <= 0.0:
        if table.kind[int(row[SHAPE_I])] == HALF_SPACE or table.kind[int(row[SHAPE_J])] == HALF_SPACE:
            return  # the only way out is along its normal
        reach = _reach_of_body(multibody, i, n, R[0], R[2], scratch.tree)
        reach += _reach_of_body(multibody, j, opposite(n), R[1], R[2], scratch.tree)
        row[BOUND] += max(reach - dot(n, relative_now(bodies, i, j, now).p) + row[DISTANCE], 0.0)

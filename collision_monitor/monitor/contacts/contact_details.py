"""What the pair tests leave open in the contacts of a step: which features touch, and how deep compounds may overlap.

Only the pairs that touch need it.
"""

from __future__ import annotations

from math import inf
from typing import Any, Final

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.vector import (
    Vector,
    along,
    dot,
    minus,
    opposite,
    plus,
    rotate_back,
    sum_of_sizes,
)
from collision_monitor.impact.body_contact import SHAPE_I, SHAPE_J, STATUS, TOUCHING, relative_now
from collision_monitor.impact.mesh_pair import has_mesh
from collision_monitor.meshes.distance.feature import (
    feature_in_triangle,
    number_in_hull,
    off_segment,
    off_triangle,
    slot_tie,
    vertex_at,
)
from collision_monitor.meshes.distance.triangle_pair import Corners
from collision_monitor.meshes.extent import farthest
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.last_state import age_of, position_now, rotation_now
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    DISTANCE,
    FEATURE_INDEX_A,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
)
from collision_monitor.narrow_phase.core import Core, CorePair, core_length, core_of, rounding
from collision_monitor.narrow_phase.gjk import EXACT, gjk, simplex_point
from collision_monitor.narrow_phase.work_memory import P_AB, R_AB
from collision_monitor.shapes.calls import core_support, point_feature
from collision_monitor.shapes.feature_types import EDGE, FACE, UNKNOWN, VERTEX
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import POINTS
from collision_monitor.shapes.kinds.polygon import POLYGON
from collision_monitor.shapes.kinds.sphere import SPHERE
from collision_monitor.shapes.shape_table import TREE
from collision_monitor.tolerances import FEATURE_TIE, SAT_ROUND_OFF

LIFT: Final = 1e-3
"""Height above a hull, as a part of its size, from which the nearest point of the hull is searched to find the face at
a point of it. The nearest point is beside that point by the height times the error of the normal, which may be 1e-3 for
round surfaces. Larger: points near an edge are put on it. Smaller: the direction to the nearest point is round-off."""


@inlined
def _along(table: Any, k: int, n: Vector) -> Any:
    return n[0] * table.vertices[0, k] + n[1] * table.vertices[1, k] + n[2] * table.vertices[2, k]


@device
def _of_polygon(table: Any, s: int, n: Vector) -> tuple[float, float]:
    """Feature of a polygon that is farthest along n, which SAT finds without an error.

    The edge between its last and its first point has the number of the last.
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
    return EDGE, float(highest if highest - lowest > 1 and lowest == 0 else lowest)


@device
def _of_hull(table: Any, s: int, x: Vector, n: Vector, reach: float, work: Any) -> tuple[float, float]:
    """Feature of a hull, numbered as in meshes/distance/feature.py; work: scratch of GJK.

    A hull has no list of faces. The vertices that span the point nearest to one above x are those of its face.
    """
    first, count, height = table.vertex_start[s], table.vertex_count[s], dot(x, n)
    level, lowest, p, q = 0, 0, first, first
    for k in range(first, first + count):
        index = table.vertex_index[k]
        if k > first and index == table.vertex_index[k - 1]:
            continue  # padding
        if abs(_along(table, k, n) - height) <= reach:
            lowest = index if level == 0 else min(lowest, index)
            p, q = q, k
            level += 1
    if level > 2:
        return FACE, float(lowest)
    if level == 2 and off_segment(x, vertex_at(table, p), vertex_at(table, q)) <= reach * reach:
        return EDGE, float(lowest)
    radius = core_length(table, s)
    above = along(x, LIFT * radius, n)
    for i in range(9):
        work[R_AB + i] = 1.0 if i % 4 == 0 else 0.0
    work[P_AB], work[P_AB + 1], work[P_AB + 2] = opposite(above)
    cores = CorePair(Core(SPHERE, (0.0, 0.0, 0.0), 0, 0), core_of(table, s), table.vertices, table.vertices)
    spanned, _, _ = gjk(cores, work, 2.0 * radius, inf, EXACT)
    # a simplex of one or two points repeats the last; one of four points is flat, so any three of them are its face
    last = min(spanned, 3) - 1
    T = Corners(
        plus(simplex_point(work, 0), above),
        plus(simplex_point(work, min(1, last)), above),
        plus(simplex_point(work, last), above),
    )
    _, foot = off_triangle(x, T)
    _, kind, c = feature_in_triangle(T, foot, n, reach)
    if kind == FACE and spanned < 3:
        kind, c = (EDGE if spanned == 2 else VERTEX), 0.0
    return kind, number_in_hull(table, s, T, kind, c, reach)


@device
def shape_feature_at(table: Any, s: int, x: Vector, n: Vector, reach: float, work: Any) -> tuple[float, float]:
    """Type (contact_row.py) and index of the feature of the shape in slot s at a point x of its surface, in its frame.

    It is the face or the edge at the point that touches as a whole, because the outward normal n is at a right angle to
    it; else the vertex at the point, else the edge or the face that contains it. So a normal that is a little off does
    not move the feature away from the point. reach (m): heights and distances up to it count as 0.
    """
    if table.kind[s] == CONVEX_HULL:
        return _of_hull(table, s, x, n, reach, work)
    if table.kind[s] == POLYGON:
        return _of_polygon(table, s, n)
    return point_feature(table, s, x, n, reach)


@inlined
def origin_now(bodies: Any, i: int, now: float) -> Vector:
    """Position of body i in the world at `now` (s)."""
    at: Vector = position_now(bodies, i, age_of(bodies, i, now))
    return at


@inlined
def core_point(table: Any, s: int, R: Any, o: Vector, world: Vector, n: Vector) -> tuple[Vector, float]:
    """Point of a shape's core below a point of its surface, in its frame, and the round-off of that (m).

    R, o: rotation and position of the shape in the world; n: outward normal there, in its frame.
    """
    x = along(rotate_back(R, minus(world, o)), -table.margin[s], n)
    return x, SAT_ROUND_OFF * (sum_of_sizes(world) + sum_of_sizes(o))


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
            body, s = (i, int(row[SHAPE_I])) if side == 0 else (j, int(row[SHAPE_J]))
            o = plus(origin_now(bodies, body, now), place_shape(table, parts, s, R[side], R[2]))
            p = POINT_A if side == 0 else POINT_B
            d = rotate_back(R[2], n if side == 0 else opposite(n))
            x, round_off = core_point(table, s, R[2], o, (row[p], row[p + 1], row[p + 2]), d)
            size = table.radius[s] if table.kind[s] != HALF_SPACE else 0.0
            reach = slot_tie(table, int(row[SHAPE_I]), int(row[SHAPE_J])) * size + round_off
            row[at], row[at + FEATURE_INDEX_A - FEATURE_TYPE_A] = shape_feature_at(table, s, x, d, reach, scratch.work)
    if several and row[DISTANCE] <= 0.0:
        if table.kind[int(row[SHAPE_I])] == HALF_SPACE or table.kind[int(row[SHAPE_J])] == HALF_SPACE:
            return  # the only way out is along its normal
        reach = _reach_of_body(multibody, i, n, R[0], R[2], scratch.tree)
        reach += _reach_of_body(multibody, j, opposite(n), R[1], R[2], scratch.tree)
        row[BOUND] += max(reach - dot(n, relative_now(bodies, i, j, now).p) + row[DISTANCE], 0.0)

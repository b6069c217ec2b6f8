"""Contacts of meshes that persist, carried over by a pair of triangles that still meets (`distance_tolerance`).

The depth of two solids changes by at most the distance that the origins move relative to each other, plus the angle
that each body turns times its radius. It is at least the depth of any pair of their triangles. So one pair of triangles
that meets proves the contact, and bounds the distance from above; the last answer bounds it from both sides. The middle
of this range is reported. A new answer is a range too (meshes/distance/depth_range.py): to find all pairs of
triangles that meet takes much longer.
"""

from __future__ import annotations

from math import sqrt
from typing import Any, Final

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, dot, opposite, rotate_back
from collision_monitor.impact.body_contact import (
    RESULT,
    SHAPE_I,
    SHAPE_J,
    STATUS,
    TOUCHING,
    closing_now,
    move_to_world,
    relative_now,
    widening,
)
from collision_monitor.impact.body_impact import CLOSING
from collision_monitor.impact.mesh_pair import enclosure, has_mesh, have_trees, root_of, triangles_contact
from collision_monitor.meshes.boxes import half_of
from collision_monitor.meshes.distance.depth_range import depth_range
from collision_monitor.meshes.distance.nearest import PAIRS, PLACE_A, PLACE_B
from collision_monitor.meshes.layout import CENTER, WIDTH
from collision_monitor.meshes.overlap.inside import OUTSIDE
from collision_monitor.meshes.overlap.touching_triangles import touching_triangles
from collision_monitor.meshes.placing import relative, turned_back
from collision_monitor.motion.bodies import place_shape
from collision_monitor.motion.last_state import rotation_now
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.pair_pose import PairPose

PLACE_I: Final = RESULT + 11
PLACE_J: Final = RESULT + 12
"""Columns of a carried row: places of two triangles that met, WIDTH * block + member relative to the roots of their
trees, which a snapshot does not keep in place. NONE: not known; NO_MESH: the pair has no trees."""

LASTING: Final = 1.0
LASTS: Final = 0.5
"""Largest motion until the next step with which a contact is carried over, and the width of the range of its answer, in
tolerances. The range widens by half of the motion, where the deepest triangles stay the same."""

WHOLE: Final = 2.0 - 1e-6
"""Width of the range of an answer whose error is the whole tolerance, but for round-off, in tolerances."""

SMALL: Final = 0.1
"""Tolerance, in radii of the smaller body, from which the boxes of two trees bound the depth well enough."""

NONE: Final = -1.0
NO_MESH: Final = -2.0

APART: Final = -2.0
"""In place of a spread: the bodies certainly do not touch."""


@inlined
def has_one_shape(multibody: Any, i: int) -> bool:
    """Whether body i is one shape."""
    return multibody.parts.next[multibody.bodies.first_shape[i]] < 0


@inlined
def meets_by_trees(multibody: Any, i: int, j: int) -> bool:
    """Whether bodies i and j are one shape each, no models of objects, that meet by trees, one of them a mesh."""
    table, bodies = multibody.table, multibody.bodies
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    if not (has_one_shape(multibody, i) and has_one_shape(multibody, j) and has_mesh(table, a, b)):
        return False
    return have_trees(table, a, b) and bodies.excess[i] + bodies.excess[j] == 0.0


@device
def _meet(table: Any, a: int, b: int, pose: PairPose, row: Any, scratch: Any) -> bool:
    """Write the contact of two triangles that meet into scratch.out: those of the row, or others, noted there.

    Returns whether there are any.
    """
    first, second = WIDTH * root_of(table, a), WIDTH * root_of(table, b)
    if row[PLACE_I] >= 0.0:
        triangles_contact(table, a, b, pose, (first + int(row[PLACE_I]), second + int(row[PLACE_J])), scratch.out)
        if scratch.out[DISTANCE] <= 0.0:
            return True
    X, work = relative(pose.R_A, pose.R_B, pose.p), scratch.tree
    found, _ = touching_triangles(table.blocks, root_of(table, a), table.blocks, root_of(table, b), X, 1, work)
    if found == 0:
        return False
    row[PLACE_I], row[PLACE_J] = work[PAIRS] - first, work[PAIRS + 1] - second
    triangles_contact(table, a, b, pose, (int(work[PAIRS]), int(work[PAIRS + 1])), scratch.out)
    return scratch.out[DISTANCE] <= 0.0


@inlined
def placed_shapes(multibody: Any, i: int, j: int, now: float, there: Any, scratch: Any) -> Any:
    """Offset of the shape of body i from its origin in world axes, and the pose of the pair of shapes at `now` (s)."""
    table, parts, bodies = multibody
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    R_i, R_j, R_a, R_b = scratch.rotation[0], scratch.rotation[1], scratch.rotation[2], scratch.rotation[3]
    rotation_now(bodies, i, now, scratch.quaternion, R_i)
    rotation_now(bodies, j, now, scratch.quaternion, R_j)
    oa, ob, p = place_shape(table, parts, a, R_i, R_a), place_shape(table, parts, b, R_j, R_b), there.p
    return oa, PairPose(R_a, R_b, (p[0] + ob[0] - oa[0], p[1] + ob[1] - oa[1], p[2] + ob[2] - oa[2]))


@inlined
def reach_of_tree(table: Any, s: int, R: Any, n: Vector) -> float:
    """How far the box of a whole tree reaches from its shape's origin along n (m). R: rotation of the shape."""
    blocks, root, d = table.blocks, root_of(table, s), rotate_back(R, n)
    m, e = turned_back(blocks, root, 0, d), half_of(blocks, root, 0)
    c = blocks[root, CENTER, 0], blocks[root, CENTER + 1, 0], blocks[root, CENTER + 2, 0]
    return dot(c, d) + abs(m[0]) * e[0] + abs(m[1]) * e[1] + abs(m[2]) * e[2] + table.margin[s]


@device
def _write(
    multibody: Any, i: int, j: int, there: Any, placed: Any, known: Any, query: Any, out: Any, result: Any
) -> float:
    """Write a contact of triangles (`out`) into a result row; the deepest ones have a distance in known (m, m).

    A translation along the normal that parts both solids may be longer than the depth; the bound holds that of their
    boxes. placed: of `placed_shapes`. Returns half of the width of the known range.
    """
    table, bodies = multibody.table, multibody.bodies
    oa, pose = placed
    least, most = known
    half = max(0.5 * (most - least), 0.0)
    n = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    parting = reach_of_tree(table, bodies.first_shape[i], pose.R_A, n) - dot(n, pose.p)
    parting += reach_of_tree(table, bodies.first_shape[j], pose.R_B, opposite(n))
    for c in range(CONTACT_SIZE):
        result[c] = out[c]
    for c in range(3):
        result[POINT_A + c] += oa[c]
        result[POINT_B + c] += oa[c]
    result[CLOSING] = closing_now(there, result)
    result[DISTANCE] = most - half
    result[BOUND] += max(half, parting + most - half) + widening(there, query.stale_acceleration)
    result[STATUS] = TOUCHING
    result[SHAPE_I], result[SHAPE_J] = bodies.first_shape[i], bodies.first_shape[j]
    move_to_world(bodies, i, there, result)
    return half


@device
def carry_triangles(
    multibody: Any, i: int, j: int, now: float, there: Any, moved: float, query: Any, tolerance: float, scratch: Any,
    row: Any, result: Any,
) -> bool:  # fmt: skip
    """Write the contact of bodies i and j at `now` (s) into a result row, from their carried row, if triangles meet.

    there: the bodies (Now). moved (m): how far a surface can have moved relative to the other since the answer.
    query: ContactQuery. tolerance: largest error (m) that this may add. Returns whether that suffices.
    """
    table, bodies = multibody.table, multibody.bodies
    placed = placed_shapes(multibody, i, j, now, there, scratch)
    pose = placed[1]
    if not _meet(table, bodies.first_shape[i], bodies.first_shape[j], pose, row, scratch):
        return False
    out, moved = scratch.out, moved + row[BOUND]
    most, least = min(out[DISTANCE], row[DISTANCE] + moved), row[DISTANCE] - moved
    if not most - least <= 2.0 * tolerance:
        return False
    _write(multibody, i, j, there, placed, (least, most), query, out, result)
    return True


@inlined
def turning(bodies: Any, i: int) -> float:
    """Speed (m/s) at which the surface of body i turns."""
    x, y, z = bodies.angular[i, 0], bodies.angular[i, 1], bodies.angular[i, 2]
    return bodies.spin_radius[i] * sqrt(x * x + y * y + z * z)


@inlined
def lasts(bodies: Any, i: int, j: int, v: Vector, carrying: Any) -> bool:
    """Whether to carry the contact of bodies over that have the relative velocity v (m/s).

    They have to move by less than the tolerance until the next step. If the tolerance is not small beside their
    boxes, a new answer takes no longer.
    """
    speed = sqrt(dot(v, v)) + turning(bodies, i) + turning(bodies, j)
    small = carrying.tolerance < SMALL * min(bodies.motion[i].radius, bodies.motion[j].radius)
    return small and speed * carrying.period <= LASTING * carrying.tolerance


@inlined
def apart_or_none(multibody: Any, a: int, b: int, pose: PairPose, there: Any, query: Any, scratch: Any) -> float:
    """APART if two shapes with surfaces that do not meet do not touch either; else NONE."""
    if query.margin + widening(there, query.stale_acceleration) > 0.0:
        return NONE
    return APART if enclosure(multibody.table, a, b, pose, scratch) == OUTSIDE else NONE


@outlined
def overlap_of_trees(
    multibody: Any, i: int, j: int, now: float, query: Any, carrying: Any, scratch: Any, result: Any
) -> float:
    """Write the contact of bodies i and j at `now` (s) into a result row, if triangles of both meet.

    The search for the deepest triangles ends when the depth is known within the tolerance, or within a quarter of it if
    the answer is carried over. Returns by how much the distance of the deepest triangles may differ (m); APART; or NONE
    if only `body_contact` can tell. query: ContactQuery. carrying: see carried_contacts.py.
    """
    if not meets_by_trees(multibody, i, j):
        return NONE
    table, bodies = multibody.table, multibody.bodies
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    there = relative_now(bodies, i, j, now)
    p, reach = there.p, bodies.motion[i].radius + bodies.motion[j].radius
    if dot(p, p) > reach * reach:
        return NONE
    placed = placed_shapes(multibody, i, j, now, there, scratch)
    pose = placed[1]
    X, out, answer = relative(pose.R_A, pose.R_B, pose.p), scratch.out, scratch.answer
    wanted = (LASTS if lasts(bodies, i, j, there.v, carrying) else WHOLE) * carrying.tolerance
    least, most = depth_range(table.blocks, root_of(table, a), root_of(table, b), X, wanted, answer, scratch.tree)
    if least < 0.0:
        is_known = most == 0.0 and table.margin[a] + table.margin[b] == 0.0
        return apart_or_none(multibody, a, b, pose, there, query, scratch) if is_known else NONE
    triangles_contact(table, a, b, pose, (int(answer[PLACE_A]), int(answer[PLACE_B])), out)
    if not out[DISTANCE] <= 0.0:
        return NONE
    known = out[DISTANCE] - (most - least), out[DISTANCE]
    return _write(multibody, i, j, there, placed, known, query, out, result)

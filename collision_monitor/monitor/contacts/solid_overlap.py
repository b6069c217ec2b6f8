"""Contacts of meshes with cylinders, cones, ellipsoids and half-spaces, within the `distance_tolerance`.

The search for the deepest triangle ends when the depth is known within the tolerance
(meshes/distance/solid_range.py), which takes so much less than the answer that nothing is carried over to the next
step.
"""

from __future__ import annotations

from math import inf
from typing import Any

from collision_monitor._jit import inlined, outlined
from collision_monitor.geometry.vector import dot, opposite, rotate_back
from collision_monitor.impact.body_contact import (
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
from collision_monitor.impact.mesh_pair import has_mesh, have_trees, is_mesh, root_of
from collision_monitor.meshes.distance.solid import SolidMemory
from collision_monitor.meshes.distance.solid_range import solid_range
from collision_monitor.monitor.contacts.carried_triangles import (
    NONE,
    WHOLE,
    apart_or_none,
    has_one_shape,
    placed_shapes,
    reach_of_tree,
)
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A, POINT_B
from collision_monitor.narrow_phase.core import rounding
from collision_monitor.narrow_phase.dispatch import mirror
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.shapes.calls import core_support
from collision_monitor.shapes.kinds.half_space import HALF_SPACE


@inlined
def _parting(table: Any, a: int, b: int, pose: PairPose, out: Any) -> float:
    """Length of a translation along the normal of a contact that parts a tree and a solid (m), by the tree's box."""
    n = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    if table.kind[b] == HALF_SPACE:  # the only way out is along its normal
        return -float(out[DISTANCE])
    d = rotate_back(pose.R_B, opposite(n))
    reach: float = reach_of_tree(table, a, pose.R_A, n) + core_support(table, b, d[0], d[1], d[2]) + rounding(table, b)
    return reach - dot(n, pose.p)


@outlined
def overlap_of_solid(
    multibody: Any, i: int, j: int, now: float, query: Any, tolerance: float, scratch: Any, result: Any
) -> float:
    """Write the contact of bodies i and j at `now` (s) into a result row, if one is a mesh that overlaps a solid.

    A translation along the normal that parts both may be longer than the depth; the bound holds that of the tree's box.
    query: ContactQuery. tolerance: largest error (m) that this may add. The contact names no features. Returns 0; or
    APART; or NONE if only `body_contact` can tell.
    """
    table, bodies = multibody.table, multibody.bodies
    a, b = bodies.first_shape[i], bodies.first_shape[j]
    if not (has_mesh(table, a, b) and has_one_shape(multibody, i) and has_one_shape(multibody, j)):
        return NONE
    if have_trees(table, a, b) or bodies.excess[i] + bodies.excess[j] != 0.0:
        return NONE
    there = relative_now(bodies, i, j, now)
    p, reach = there.p, bodies.motion[i].radius + bodies.motion[j].radius
    if dot(p, p) > reach * reach:
        return NONE
    origin, pose = placed_shapes(multibody, i, j, now, there, scratch)
    out, memory = scratch.out, SolidMemory(scratch.triangle, scratch.work, scratch.tree)
    is_swapped, p = not is_mesh(table, a), pose.p
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    wanted = WHOLE * tolerance
    least, most = solid_range(table.blocks, root_of(table, a), table.margin[a], table, b, pose, wanted, out, memory)
    if not most <= 0.0:
        return apart_or_none(multibody, a, b, pose, there, query, scratch) if least == inf else NONE
    half = 0.5 * (most - least)
    out[BOUND] += max(half, _parting(table, a, b, pose, out) + most - half)
    if is_swapped:
        mirror(out, p)
    for c in range(CONTACT_SIZE):
        result[c] = out[c]
    for c in range(3):
        result[POINT_A + c] += origin[c]
        result[POINT_B + c] += origin[c]
    result[CLOSING] = closing_now(there, result)
    result[DISTANCE] = most - half
    result[BOUND] += widening(there, query.stale_acceleration)
    result[STATUS] = TOUCHING
    result[SHAPE_I], result[SHAPE_J] = bodies.first_shape[i], bodies.first_shape[j]
    move_to_world(bodies, i, there, result)
    return 0.0

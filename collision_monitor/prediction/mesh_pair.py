"""Pairs of shapes with a mesh or a cloud: their contact at one time, and a time without one, by their trees."""

from __future__ import annotations

from math import sqrt

from collision_monitor._jit import device, inlined
from collision_monitor.geometry.shape_table import HALF_SPACE, MESH, POINTS, TREE
from collision_monitor.meshes.advance import advance_trees
from collision_monitor.meshes.approach import Approach
from collision_monitor.meshes.contact import FARTHER, OPEN, tree_contact
from collision_monitor.meshes.feature import triangle_feature
from collision_monitor.meshes.layout import FACE, WIDTH
from collision_monitor.meshes.nearest import PLACE_A, PLACE_B
from collision_monitor.meshes.placing import relative
from collision_monitor.meshes.solid import SolidMemory, advance_to_solid, solid_contact
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    DISTANCE,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
    VERTEX,
)
from collision_monitor.narrow_phase.dispatch import contact_within
from collision_monitor.narrow_phase.pair_pose import PairPose, swapped
from collision_monitor.narrow_phase.vector import dot, opposite, rotate_back


@inlined
def has_mesh(table, a, b):
    """Whether one of two shapes is a mesh or a cloud."""
    return _is_mesh(table, a) or _is_mesh(table, b)


@inlined
def _is_mesh(table, s):
    return table.kind[s] == MESH or table.kind[s] == POINTS


@inlined
def _has_tree(table, s):
    return table.size[s, TREE] > 0.0 and table.kind[s] != HALF_SPACE


@inlined
def _are_trees(table, a, b):
    """Whether the trees of both shapes meet. A cloud meets convex solids point by point, which tells how deep."""
    if not (_has_tree(table, a) and _has_tree(table, b)):
        return False
    if table.kind[a] == POINTS or table.kind[b] == POINTS:
        return _is_mesh(table, a) and _is_mesh(table, b)
    return True


@inlined
def _root(table, s):
    """First block of a shape's tree."""
    return int(table.size[s, TREE]) - 1


@device
def mesh_within(table, a, b, pose, limit, out, scratch):
    """Whether the distance of two shapes with trees, or of one and a solid, is at most `limit` (m); writes the contact.

    The pair is brought into the canonical order of the pair tests. If they overlap, the depth is that of the deepest
    pair of triangles or points; a translation that parts them may be longer.
    """
    kind_a, kind_b, p = table.kind[a], table.kind[b], pose.p
    are_trees = _are_trees(table, a, b)
    is_swapped = (kind_a > kind_b or (kind_a == kind_b and a > b)) if are_trees else not _is_mesh(table, a)
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    margins = table.margin[a] + table.margin[b]
    if are_trees:
        answer, work = scratch.answer, scratch.tree
        answer[PLACE_A] = answer[PLACE_B] = -1.0
        first, second = _root(table, a), _root(table, b)
        known = tree_contact(table.blocks, first, table.blocks, second, pose, limit + margins, out, answer, work)
        if known == FARTHER:
            return False
        out[DISTANCE] -= margins
        for c in range(3):
            out[POINT_A + c] += table.margin[a] * out[NORMAL + c]
            out[POINT_B + c] = out[POINT_A + c] + out[DISTANCE] * out[NORMAL + c]
        if known == OPEN:  # one may be inside the other, at any depth
            out[BOUND] += table.radius[a] + table.radius[b] + sqrt(dot(p, p))
        if known != OPEN and not out[DISTANCE] <= limit:
            return False
        n = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
        _name_feature(table, a, answer[PLACE_A], rotate_back(pose.R_A, n), out, 0)
        _name_feature(table, b, answer[PLACE_B], rotate_back(pose.R_B, opposite(n)), out, 1)
    else:
        memory = SolidMemory(scratch.triangle, scratch.work, scratch.tree)
        if not solid_contact(table.blocks, _root(table, a), table.margin[a], table, b, pose, limit, out, memory):
            return False
    if is_swapped:
        for c in range(3):
            out[NORMAL + c] = -out[NORMAL + c]
            witness = out[POINT_A + c]
            out[POINT_A + c] = out[POINT_B + c] + p[c]
            out[POINT_B + c] = witness + p[c]
        for c in range(2):
            out[FEATURE_TYPE_A + c], out[FEATURE_TYPE_B + c] = out[FEATURE_TYPE_B + c], out[FEATURE_TYPE_A + c]
    return True


@device
def _name_feature(table, s, place, n, out, side):
    """Write the feature of a mesh or a cloud at the place of a triangle or point, farthest along n in its frame."""
    at = FEATURE_TYPE_B if side else FEATURE_TYPE_A
    block, k = int(place) // WIDTH, int(place) % WIDTH
    if table.kind[s] == POINTS:
        out[at], out[at + 1] = VERTEX, table.blocks[block, FACE, k]
    elif table.kind[s] == MESH:
        out[at], out[at + 1] = triangle_feature(table.blocks, block, k, n, table.radius[s])


@inlined
def shapes_within(table, a, b, pose, limit, out, scratch):
    """`contact_within` of any two shapes, meshes included."""
    if has_mesh(table, a, b):
        return mesh_within(table, a, b, pose, limit, out, scratch)
    return contact_within(table, a, b, pose, limit, out, scratch.work)


@device
def advance_mesh(table, at, margin, growth, until, tolerance, scratch):
    """Return a time in (0, until] (s) up to which two shapes with a mesh stay apart, and the gap that limits it (m).

    at (Placed): the two shapes now, and their motion. margin (m): gap that counts as contact now; growth: of it (m/s).
    The time is 0 if the gap is within the tolerance (m). scratch.answer: a hint, as `advance_trees` leaves it.
    """
    a, b, R_a, R_b, o_a, o_b = at.a, at.b, at.R_a, at.R_b, at.o_a, at.o_b
    w_a, w_b, v, acceleration = at.w_a, at.w_b, at.v, at.acceleration
    p = at.p[0] + o_b[0] - o_a[0], at.p[1] + o_b[1] - o_a[1], at.p[2] + o_b[2] - o_a[2]
    are_trees = _are_trees(table, a, b)
    if not are_trees and not _is_mesh(table, a):
        a, b, R_a, R_b, o_a, o_b = b, a, R_b, R_a, o_b, o_a
        w_a, w_b, v, acceleration, p = w_b, w_a, opposite(v), opposite(acceleration), opposite(p)
    # velocity of the shapes' origins, which turn about those of their bodies
    v = (
        v[0] + (w_b[1] * o_b[2] - w_b[2] * o_b[1]) - (w_a[1] * o_a[2] - w_a[2] * o_a[1]),
        v[1] + (w_b[2] * o_b[0] - w_b[0] * o_b[2]) - (w_a[2] * o_a[0] - w_a[0] * o_a[2]),
        v[2] + (w_b[0] * o_b[1] - w_b[1] * o_b[0]) - (w_a[0] * o_a[1] - w_a[1] * o_a[0]),
    )
    bend_a, bend_b = dot(w_a, w_a), dot(w_b, w_b)
    bend = sqrt(dot(acceleration, acceleration)) + bend_a * sqrt(dot(o_a, o_a)) + bend_b * sqrt(dot(o_b, o_b))
    move = Approach(
        rotate_back(R_a, v),
        rotate_back(R_a, w_a),
        rotate_back(R_a, w_b),
        bend_a,
        bend_b,
        bend,
        margin + table.margin[a] + table.margin[b],
        growth,
    )
    if are_trees:
        X, answer, work = relative(R_a, R_b, p), scratch.answer, scratch.tree
        first, second = _root(table, a), _root(table, b)
        return advance_trees(table.blocks, first, table.blocks, second, X, move, until, tolerance, answer, work)
    pose, memory = PairPose(R_a, R_b, p), SolidMemory(scratch.triangle, scratch.work, scratch.tree)
    return advance_to_solid(table.blocks, _root(table, a), table, b, pose, move, until, tolerance, memory)

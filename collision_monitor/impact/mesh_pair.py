"""Contacts of pairs of shapes with a mesh or a cloud, by their trees."""

from __future__ import annotations

from math import inf, sqrt
from typing import Any

from collision_monitor._jit import device, inlined, outlined
from collision_monitor.geometry.vector import Vector, along, dot, minus, opposite, rotate, rotate_back, sum_of_sizes
from collision_monitor.meshes.distance.contact import APART, FARTHER, OPEN, tree_contact
from collision_monitor.meshes.distance.feature import (
    feature_in_triangle,
    number_in_hull,
    off_triangle,
    triangle_feature,
)
from collision_monitor.meshes.distance.nearest import PLACE_A, PLACE_B, nearest_triangles, triangle_at
from collision_monitor.meshes.distance.solid import SolidMemory, solid_contact
from collision_monitor.meshes.layout import CLOSED, FACE, MOST_PARTS, PARTS, WIDTH
from collision_monitor.meshes.overlap.inside import INSIDE, OUTSIDE, is_either_in, locate_in_surface
from collision_monitor.meshes.overlap.touching_triangles import contact_of_places, touching_triangles
from collision_monitor.meshes.placing import inverse, relative
from collision_monitor.narrow_phase.contact_row import (
    BOUND,
    DISTANCE,
    FEATURE_TYPE_A,
    FEATURE_TYPE_B,
    NORMAL,
    POINT_A,
    POINT_B,
    write,
)
from collision_monitor.narrow_phase.dispatch import contact_within, is_second, mirror
from collision_monitor.narrow_phase.pair_pose import swapped
from collision_monitor.shapes.feature_types import VERTEX
from collision_monitor.shapes.kinds.box import BOX
from collision_monitor.shapes.kinds.convex_hull import CONVEX_HULL
from collision_monitor.shapes.kinds.half_space import HALF_SPACE
from collision_monitor.shapes.kinds.mesh import MESH
from collision_monitor.shapes.kinds.points import POINTS
from collision_monitor.shapes.shape_table import TREE
from collision_monitor.tolerances import FEATURE_TIE, SAT_ROUND_OFF

SURFACES, SOLIDS = range(2)
"""What a search of a pair with a mesh has to tell of an overlap: how deep the surfaces are in each other; or how deep
the triangles are in the other solid, if that is convex, which is deeper and takes longer."""


@inlined
def has_mesh(table: Any, a: int, b: int) -> bool:
    """Whether one of two shapes is a mesh or a cloud."""
    return is_mesh(table, a) or is_mesh(table, b)


@inlined
def is_mesh(table: Any, s: int) -> bool:
    """Whether a shape is a mesh or a cloud."""
    return table.kind[s] == MESH or table.kind[s] == POINTS


@inlined
def _has_tree(table: Any, s: int) -> bool:
    return table.size[s, TREE] > 0.0 and table.kind[s] != HALF_SPACE


@inlined
def have_trees(table: Any, a: int, b: int) -> bool:
    """Whether the trees of both shapes meet. A cloud meets convex solids point by point, which tells how deep."""
    if not (_has_tree(table, a) and _has_tree(table, b)):
        return False
    if table.kind[a] == POINTS or table.kind[b] == POINTS:
        return is_mesh(table, a) and is_mesh(table, b)
    return True


@inlined
def root_of(table: Any, s: int) -> int:
    """First block of a shape's tree."""
    return int(table.size[s, TREE]) - 1


@inlined
def _may_hold_many(table: Any, a: int, b: int) -> bool:
    """Whether shape a has an inside, and b so many parts that their number decides what it costs to locate them."""
    first, second = root_of(table, a), root_of(table, b)
    return table.blocks[first, CLOSED, 1] != 0.0 and table.blocks[second, PARTS, 1] > MOST_PARTS


@device
def enclosure(table: Any, a: int, b: int, pose: Any, scratch: Any) -> int:
    """INSIDE if one shape is in the solid that the other one, a mesh, bounds; UNKNOWN if round-off leaves it open.

    No surfaces meet. pose: as for every pair test, of two shapes with a mesh or a cloud among them.
    """
    X = relative(pose.R_A, pose.R_B, pose.p)
    if have_trees(table, a, b):
        blocks, answer, work = table.blocks, scratch.answer, scratch.tree
        first, second, clear = root_of(table, a), root_of(table, b), 0.0
        if _may_hold_many(table, a, b) or _may_hold_many(table, b, a):
            place_a, place_b = answer[PLACE_A], answer[PLACE_B]
            answer[PLACE_A] = answer[PLACE_B] = -1.0
            clear = nearest_triangles(blocks, first, blocks, second, X, inf, answer, work)
            answer[PLACE_A], answer[PLACE_B] = place_a, place_b
        return is_either_in(blocks, first, blocks, second, X, clear, work)
    mesh, solid = (a, b) if is_mesh(table, a) else (b, a)
    root = root_of(table, mesh)
    if table.kind[solid] == HALF_SPACE or table.blocks[root, CLOSED, 1] == 0.0:  # a cloud encloses nothing
        return OUTSIDE
    if mesh != a:
        X = inverse(X)
    return locate_in_surface(table.blocks, root, (X.x, X.y, X.z), scratch.tree)  # the solid's origin is inside it


@outlined
def mesh_within(table: Any, a: int, b: int, pose: Any, limit: float, effort: int, out: Any, scratch: Any) -> bool:
    """Whether the distance of two shapes with trees, or of one and a solid, is at most `limit` (m); writes the contact.

    If they overlap, the depth is that of the deepest pair of triangles or points; a translation that parts them may be
    longer. effort: SURFACES or SOLIDS.
    """
    if have_trees(table, a, b):
        found, known = _trees_within(table, a, b, pose, limit, out, scratch)
        if effort != SOLIDS or known == FARTHER or known == APART or is_polytope(table, a) == is_polytope(table, b):
            return found
    return _solid_within(table, a, b, pose, limit, out, scratch)


@inlined
def is_polytope(table: Any, s: int) -> bool:
    """Whether a shape is a convex polytope."""
    return table.kind[s] == BOX or table.kind[s] == CONVEX_HULL


@device
def _trees_within(table: Any, a: int, b: int, pose: Any, limit: float, out: Any, scratch: Any) -> tuple[bool, int]:
    """`mesh_within` of two shapes by their trees, in the canonical order of the pair tests, and what is known."""
    p = pose.p
    is_swapped = is_second(table, a, b, p)
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    margins = table.margin[a] + table.margin[b]
    answer, work = scratch.answer, scratch.tree
    answer[PLACE_A] = answer[PLACE_B] = -1.0
    first, second = root_of(table, a), root_of(table, b)
    known = tree_contact(table.blocks, first, table.blocks, second, pose, limit + margins, out, answer, work)
    if known == FARTHER:
        return False, known
    out[DISTANCE] -= margins
    for c in range(3):
        out[POINT_A + c] += table.margin[a] * out[NORMAL + c]
        out[POINT_B + c] = out[POINT_A + c] + out[DISTANCE] * out[NORMAL + c]
    if known == OPEN:  # one may be inside the other, at any depth
        out[BOUND] += table.radius[a] + table.radius[b] + sqrt(dot(p, p))
    elif not out[DISTANCE] - out[BOUND] <= limit:
        return False, known
    n = out[NORMAL], out[NORMAL + 1], out[NORMAL + 2]
    n_a, n_b = rotate_back(pose.R_A, n), rotate_back(pose.R_B, opposite(n))
    on_a = out[POINT_A], out[POINT_A + 1], out[POINT_A + 2]
    on_b = minus((out[POINT_B], out[POINT_B + 1], out[POINT_B + 2]), pose.p)
    _name_feature(table, a, answer[PLACE_A], rotate_back(pose.R_A, on_a), n_a, out, 0)
    _name_feature(table, b, answer[PLACE_B], rotate_back(pose.R_B, on_b), n_b, out, 1)
    if is_swapped:
        mirror(out, p)
    return True, known


@device
def _solid_within(table: Any, a: int, b: int, pose: Any, limit: float, out: Any, scratch: Any) -> bool:
    """`mesh_within` of a tree and a convex solid."""
    p = pose.p
    is_swapped = not is_mesh(table, a)
    if is_swapped:
        a, b = b, a
        pose = swapped(pose)
    memory = SolidMemory(scratch.triangle, scratch.work, scratch.tree)
    found = solid_contact(table.blocks, root_of(table, a), table.margin[a], table, b, pose, limit, out, memory)
    where = OUTSIDE if found and out[DISTANCE] <= 0.0 else enclosure(table, a, b, pose, scratch)
    if where != OUTSIDE:
        if not found:
            solid_contact(table.blocks, root_of(table, a), table.margin[a], table, b, pose, inf, out, memory)
        if where == INSIDE:
            out[DISTANCE] = -out[DISTANCE]
            for c in range(3):
                out[NORMAL + c] = -out[NORMAL + c]
        else:
            out[BOUND] += table.radius[a] + table.radius[b] + sqrt(dot(p, p))
    elif not found:
        return False
    if is_swapped:
        mirror(out, p)
    return True


@device
def _name_feature(table: Any, s: int, place: float, x: Vector, n: Vector, out: Any, side: int) -> None:
    """Write the feature of a mesh, a cloud or a hull at a point x of the triangle at a place, for a normal n.

    The triangle itself tells it, because a normal of two triangles need not be one of the solids at that point.
    """
    at = FEATURE_TYPE_B if side else FEATURE_TYPE_A
    block, k = int(place) // WIDTH, int(place) % WIDTH
    reach = FEATURE_TIE * table.radius[s]
    if table.kind[s] == POINTS:
        out[at], out[at + 1] = VERTEX, table.blocks[block, FACE, k]
    elif table.kind[s] == MESH or table.kind[s] == CONVEX_HULL:
        T = triangle_at(table.blocks, block, k)
        x = along(x, -table.margin[s], n)
        if table.kind[s] == MESH:
            out[at], out[at + 1] = triangle_feature(T, table.blocks[block, FACE, k], x, n, reach)
        else:
            _, foot = off_triangle(x, T)
            _, kind, c = feature_in_triangle(T, foot, n, reach)
            out[at], out[at + 1] = kind, number_in_hull(table, s, T, kind, c, reach)


@device
def triangles_contact(table: Any, a: int, b: int, pose: Any, places: Any, out: Any) -> None:
    """Write the contact of two triangles of shapes with trees, at places as in `meshes.distance.nearest`."""
    X = relative(pose.R_A, pose.R_B, pose.p)
    depth, n, x = contact_of_places(table.blocks, places[0], table.blocks, places[1], X)
    n, margins = rotate(pose.R_A, n), table.margin[a] + table.margin[b]
    round_off = SAT_ROUND_OFF * (table.radius[a] + table.radius[b] + sum_of_sizes(pose.p))
    write(out, -depth - margins, n, along(rotate(pose.R_A, x), table.margin[a], n), round_off)


@inlined
def shapes_within(table: Any, a: int, b: int, pose: Any, limit: float, effort: int, out: Any, scratch: Any) -> bool:
    """`contact_within` of any two shapes, meshes included; effort: see `mesh_within`."""
    if has_mesh(table, a, b):
        return mesh_within(table, a, b, pose, limit, effort, out, scratch)
    return contact_within(table, a, b, pose, limit, out, scratch.work)


@device
def shapes_overlap(table: Any, a: int, b: int, pose: Any, scratch: Any) -> bool:
    """Whether two shapes have a point in common, of an open mesh on its surface; meshes whose test is too long may."""
    if has_mesh(table, a, b) and have_trees(table, a, b) and table.margin[a] + table.margin[b] == 0.0:
        X, blocks, work = relative(pose.R_A, pose.R_B, pose.p), table.blocks, scratch.tree
        first, second = root_of(table, a), root_of(table, b)
        if not touching_triangles(blocks, first, blocks, second, X, 1, work)[1]:
            return True
        return is_either_in(blocks, first, blocks, second, X, 0.0, work) != OUTSIDE
    return shapes_within(table, a, b, pose, 0.0, SURFACES, scratch.out, scratch) and scratch.out[DISTANCE] <= 0.0

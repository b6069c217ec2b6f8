"""The nearest or deepest place of two objects: by trees, by clouds, or by pairs of convex pieces."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.inside import UNKNOWN, locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.meshes.distance.contact import APART, OPEN, contact_of_trees, in_root_box, tree_reach
from collision_monitor.meshes.distance.nearest import MEMORY, answer_row
from collision_monitor.meshes.trees.shape_trees import shape_tree
from collision_monitor.narrow_phase.contact_row import BOUND, CONTACT_SIZE, DISTANCE, NORMAL, POINT_A
from collision_monitor.objects.models import exact_model
from collision_monitor.query.contact.nearest_pieces import NearestPieces
from collision_monitor.query.contact.surface_pair import surface_contact
from collision_monitor.query.posed import Posed, pose_in_world
from collision_monitor.records import Model
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.registry import Capsule, ConvexHull, Mesh, Points, Sphere

Array = NDArray[np.float64]


MOST_TESTS: Final = 300_000_000
"""Most pairs of a point and a face to locate points in a mesh without a tree of its solid, 0.3 s."""


class Deepest(NamedTuple):
    """The nearest or deepest contact of two objects, about A's origin in world axes.

    pieces: finds the pieces that touch in one plane; None: the contact is one point.
    """

    row: Array
    pieces: Callable[[], NearestPieces] | None


def nearest_pieces(a: Posed, b: Posed, offset: Array) -> NearestPieces:
    """Search the convex pieces of two objects. offset: position of B relative to A (m)."""
    return NearestPieces(a.pieces, (a.rotation, np.zeros(3)), b.pieces, (b.rotation, offset))


def by_pieces(a: Posed, b: Posed, offset: Array) -> Deepest:
    """The contact of two objects of any shapes by their convex pieces."""
    found = nearest_pieces(a, b, offset)
    row = found.best.copy()
    row[POINT_A : POINT_A + 3] += found.position[found.pair[0]]
    if row[DISTANCE] > 0.0 and Location.INSIDE in (locate_in_meshes(a, b, offset), locate_in_meshes(b, a, -offset)):
        turn_inward(row)
    return Deepest(row, lambda: found)


def turn_inward(row: Array) -> None:
    """Make the contact of two surfaces that of a solid inside the other, which is at least this deep."""
    row[DISTANCE] *= -1.0
    row[NORMAL : NORMAL + 3] *= -1.0


def by_clouds(a: Posed, b: Posed, offset: Array) -> Deepest | None:
    """The contact of two objects, shape by shape, if either has a cloud; None for others."""
    if not any(isinstance(shape, Points) for shape, _ in (*a.outline, *b.outline)):
        return None
    best: Deepest | None = None
    for pair_a in exact_model(a.outline).pieces:
        for pair_b in exact_model(b.outline).pieces:
            own, other = Posed([pair_a], a.pose, [pair_a]), Posed([pair_b], b.pose, [pair_b])
            if isinstance(pair_a[0], Points) or isinstance(pair_b[0], Points):
                X, (R, p) = pose_in_world(own), pose_in_world(other)
                row = surface_contact(pair_a[0], X, pair_b[0], (R, p + offset))
                row[POINT_A : POINT_A + 3] += X[1]
            else:
                row = (by_trees(own, other, offset) or by_pieces(own, other, offset)).row
            if best is None or row[DISTANCE] < best.row[DISTANCE]:
                best = Deepest(row, None)
    return best


def contact_by_trees(trees: tuple[Array, Array], X: tuple[Array, Array], Y: tuple[Array, Array]) -> tuple[int, Array]:
    """Return what `contact_of_trees` knows of two trees with these rotations and positions, and the contact row.

    The rotations are copied because numba compiles a kernel once more for each combination of read-only arrays.
    """
    row, answer, work = np.empty(CONTACT_SIZE), answer_row(), np.empty(MEMORY)
    R_a, R_b = X[0].copy(), Y[0].copy()
    return contact_of_trees(trees[0], R_a, X[1], trees[1], R_b, Y[1], np.inf, row, answer, work), row


def by_trees(a: Posed, b: Posed, offset: Array) -> Deepest | None:
    """The contact of a concave mesh and another single shape; None for other pairs, and for a hull that it overlaps.

    Where both have a tree, these give it, unless they overlap and the other one is convex: each triangle also tells how
    deep it is inside a convex solid.
    """
    pair = a.outline[0][0], b.outline[0][0]
    if len(a.outline) > 1 or len(b.outline) > 1 or not any(is_concave_mesh(shape) for shape in pair):
        return None

    def pieces() -> NearestPieces:
        return nearest_pieces(a, b, offset)

    (R_a, p_a), (R_b, p_b) = pose_in_world(a), pose_in_world(b)
    p_b = p_b + offset
    trees = shape_tree(pair[0]), shape_tree(pair[1])
    if trees[0] is not None and trees[1] is not None:
        known, row = contact_by_trees((trees[0], trees[1]), (R_a, p_a), (R_b, p_b))
        if known == APART or all(isinstance(shape, Mesh | Sphere | Capsule) for shape in pair):
            if known == OPEN:
                row[BOUND] += tree_reach(trees[0]) + tree_reach(trees[1]) + float(np.linalg.norm(p_b - p_a))
            row[POINT_A : POINT_A + 3] += p_a
            return Deepest(row, pieces)
    if any(isinstance(shape, ConvexHull) for shape in pair):  # the kernel of a triangle and a solid takes no corners
        return None
    row = surface_contact(pair[0], (R_a, p_a), pair[1], (R_b, p_b))
    row[POINT_A : POINT_A + 3] += p_a
    return Deepest(row, pieces)


def locate_in_meshes(inner: Posed, outer: Posed, offset: Array) -> int:
    """Location of `inner` in the meshes of `outer`, at `offset` (m) from it; no surfaces meet.

    It is UNKNOWN where more than MOST_TESTS are needed, as for two soups of 100,000 triangles.
    """
    found: int = Location.OUTSIDE
    if outer.model is not Model.EXACT or not (outer.is_concave or outer.is_uncertain):
        return found
    points = inner.inner @ inner.rotation.T - offset
    for shape, pose in outer.shapes:
        if not isinstance(shape, Mesh):
            continue
        own = (points - outer.rotation @ pose.position) @ (outer.rotation @ pose.rotation)
        tree = shape_tree(shape)
        own = own if tree is None else own[in_root_box(tree, own)]
        if len(own):
            some = own[: max(MOST_TESTS // len(shape.faces), 1)]
            location = locate_in_welded_surface(some, shape.surface)
            if ((location == Location.INSIDE) | (location == Location.BOUNDARY)).any():
                return Location.INSIDE
            if len(some) < len(own) or (location == UNKNOWN).any():
                found = UNKNOWN
    return found

"""The tree of a shape, made once and kept with the shape."""

from __future__ import annotations

from math import inf
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import ShapeError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.meshes.distance.contact import tree_reach
from collision_monitor.meshes.trees.cloud_tree import cloud_tree
from collision_monitor.meshes.trees.tree import tree_of
from collision_monitor.shapes.convex_pieces import is_concave_mesh
from collision_monitor.shapes.registry import Box, Capsule, ConvexHull, Mesh, Points, Shape, Sphere, Triangle

Array = NDArray[np.float64]

CERTAIN, NEVER, UNCERTAIN = range(3)
"""What a tree tells of the inside of its shape: which points are inside; none is certainly inside, because the surface
has a hole; nothing, also of a cloud."""


class KeptTree(NamedTuple):
    """What a shape keeps as its attribute `kept_tree`: in a tuple, since `array_bytes` counts the arrays of the user.

    tree: None for a shape without one. concave: whether it is a concave mesh. inside: CERTAIN, NEVER or UNCERTAIN.
    reach: distance of the farthest point from the origin (m), infinite without a tree.
    """

    tree: Array | None
    concave: bool
    inside: int
    reach: float


def shape_tree(shape: Shape) -> Array | None:
    """Tree of a shape's surface; None for a shape that triangles with a radius cannot represent exactly.

    A sphere is a point with a radius, a capsule an edge with one; a cloud is its points, without their radius; a box
    and a hull are closed surfaces, unless they are too flat.
    """
    return kept_tree(shape).tree


def kept_tree(shape: Shape, split: int = 0) -> KeptTree:
    """Tree of a shape with what is known of it, made at the first call; split: of a mesh's faces, see `tree_of`."""
    known: KeptTree | None = shape.__dict__.get("kept_tree")
    if known is None:
        inside = UNCERTAIN if isinstance(shape, Points) else CERTAIN
        if isinstance(shape, Mesh) and not shape.surface.certain:
            inside = NEVER if len(shape.surface.hole) else UNCERTAIN
        tree, radius = made_tree(shape, split), shape.radius if isinstance(shape, Points) else 0.0
        known = KeptTree(tree, is_concave_mesh(shape), inside, inf if tree is None else tree_reach(tree) + radius)
        shape.__dict__["kept_tree"] = known
    return known


def _plate(box: Box) -> Array:
    """Triangles (12, 3, 3) of the faces of a box without thickness."""
    k = box.corners
    quads = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    return np.array([k[[q[0], q[i], q[i + 1]]] for q in quads for i in (1, 2)])


def made_tree(shape: Shape, split: int = 0) -> Array | None:
    """As `shape_tree`, but made anew; split: of a mesh's faces, see `tree_of`."""
    match shape:
        case Mesh():
            surface = shape.surface
            faces = surface.faces if len(surface.faces) else shape.faces[:1]
            first = np.unique(surface.part, return_index=True)[1] if len(surface.faces) else [0]
            closed = surface.closed and surface.certain
            parts = shape.vertices[faces[first, 0]]
            corners = shape.vertices[shape.faces]
            corners[surface.repeated] = corners[surface.repeated, :1]  # to a point, which no ray crosses
            return tree_of(corners, closed=closed, parts=parts, split=split)
        case Points():
            return cloud_tree(shape.points)
        case Sphere():
            return tree_of(np.zeros((1, 3, 3)), shape.radius)
        case Capsule():
            half = shape.length / 2
            return tree_of(np.array([[[0.0, 0.0, -half], [0.0, 0.0, half], [0.0, 0.0, half]]]), shape.radius)
        case Box() | ConvexHull():
            try:
                hull = convex_hull(shape.corners if isinstance(shape, Box) else shape.points)
            except ShapeError:  # too flat for faces
                return tree_of(_plate(shape)) if isinstance(shape, Box) else None
            return tree_of(hull.vertices[hull.faces], closed=True)
        case Triangle():
            return tree_of(shape.points[None])
    return None

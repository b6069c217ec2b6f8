"""The tree of a shape, made once and kept with the shape."""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.convex_pieces import is_concave_mesh
from collision_monitor.geometry.polyhedra import is_closed
from collision_monitor.geometry.shapes import Box, Capsule, ConvexHull, Mesh, Shape, Sphere, Triangle
from collision_monitor.meshes.tree import tree_of

Array = NDArray[np.float64]

_KEPT: Final = "_tree"
"""Where a shape keeps its tree, in a tuple, since `array_bytes` counts the arrays of the user."""


def shape_tree(shape: Shape) -> Array | None:
    """Tree of a shape's surface; None for a shape that triangles with a radius cannot represent exactly.

    A sphere is a point with a radius, a capsule an edge with a radius; a box and a hull are closed surfaces.
    """
    kept = shape.__dict__.get(_KEPT)
    if kept is None:
        kept = shape.__dict__[_KEPT] = (made_tree(shape), is_concave_mesh(shape))
    tree: Array | None = kept[0]
    return tree


def trees_of_pair(a: Shape, b: Shape) -> tuple[Array, Array] | None:
    """Trees of two shapes; None unless one of them is a concave mesh and the other has a tree."""
    tree_a, tree_b = shape_tree(a), shape_tree(b)
    if tree_a is None or tree_b is None or not (a.__dict__[_KEPT][1] or b.__dict__[_KEPT][1]):
        return None
    return tree_a, tree_b


def made_tree(shape: Shape) -> Array | None:
    """As `shape_tree`, but made anew."""
    match shape:
        case Mesh():
            parts = shape.vertices[shape.faces[one_of_each_part(shape.faces, len(shape.vertices)), 0]]
            return tree_of(shape.vertices[shape.faces], closed=is_closed(shape.faces), parts=parts)
        case Sphere():
            return tree_of(np.zeros((1, 3, 3)), shape.radius)
        case Capsule():
            half = shape.length / 2
            return tree_of(np.array([[[0.0, 0.0, -half], [0.0, 0.0, half], [0.0, 0.0, half]]]), shape.radius)
        case Box() | ConvexHull():
            hull = convex_hull(shape.corners if isinstance(shape, Box) else shape.points)
            return tree_of(hull.vertices[hull.faces], closed=True)
        case Triangle():
            return tree_of(shape.points[None])
    return None


def one_of_each_part(faces: NDArray[np.int_], vertices: int) -> NDArray[np.int_]:
    """Index of one face of each connected part of a mesh."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    graph = coo_array((np.ones(len(start), np.int8), (start, end)), shape=(vertices, vertices))
    _, part = connected_components(graph, directed=False)
    return np.asarray(np.unique(part[faces[:, 0]], return_index=True)[1])

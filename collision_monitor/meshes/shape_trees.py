"""The tree of a shape, made once and kept as long as the shape lives."""

from __future__ import annotations

from typing import Final
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.shapes import Box, Capsule, ConvexHull, Mesh, Shape, Sphere, Triangle
from collision_monitor.meshes.tree import tree_of

Array = NDArray[np.float64]

_TREES: Final[WeakKeyDictionary[Shape, Array]] = WeakKeyDictionary()


def shape_tree(shape: Shape) -> Array | None:
    """Tree of a shape's surface; None for a shape that triangles with a radius cannot represent exactly.

    A sphere is a point with a radius, a capsule an edge with a radius; a box and a hull are closed surfaces.
    """
    tree = _TREES.get(shape)
    if tree is None:
        tree = made_tree(shape)
        if tree is not None:
            _TREES[shape] = tree
    return tree


def made_tree(shape: Shape) -> Array | None:
    """As `shape_tree`, but made anew."""
    match shape:
        case Mesh():
            surface = shape.surface
            faces = surface.faces if len(surface.faces) else shape.faces[:1]
            first = np.unique(surface.part, return_index=True)[1] if len(surface.faces) else [0]
            closed = surface.closed and surface.certain
            return tree_of(shape.vertices[shape.faces], closed=closed, parts=shape.vertices[faces[first, 0]])
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


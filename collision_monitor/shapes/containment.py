"""Which points a solid shape contains, in the shape's frame; the boundary belongs to the shape."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.coordinates import Array, Booleans
from collision_monitor.geometry.point_in_polygon import Location, locate_in_convex, locate_in_polygon
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.polyhedra import locate_in_convex_polyhedron, locate_in_polyhedron
from collision_monitor.shapes.registry import Box, ConvexHull, Mesh, Polygon, Shape, kind_of

TESTS: Final = ("closed form", "ray", "sides")


def inside(shape: Shape, p: Array, test: str) -> Booleans:
    """Mask (n,) of points p (n, 3) in m in the shape. test: one of TESTS. Raises UnsupportedError."""
    if test == "closed form":
        return np.asarray(kind_of(shape).contains(shape, p))
    ray = test == "ray"
    match shape:
        case Polygon() if shape.radius > 0.0:
            raise UnsupportedError(f"test {test}: Polygon with a radius is not offered; use the test 'closed form'")
        case Polygon() if ray:
            return np.asarray(locate_in_polygon(p[:, :2], shape.points)) != Location.OUTSIDE
        case Polygon() if is_convex(shape.points):
            return np.asarray(locate_in_convex(p[:, :2], shape.points)) != Location.OUTSIDE
        case Box() | ConvexHull():
            hull = convex_hull(shape.corners if isinstance(shape, Box) else shape.points)
            find = locate_in_polyhedron if ray else locate_in_convex_polyhedron
            return np.asarray(find(p, hull.vertices, hull.faces)) != Location.OUTSIDE
        case Mesh() if ray and shape.surface.closed:
            return np.asarray(locate_in_polyhedron(p, shape.vertices, shape.surface.faces)) != Location.OUTSIDE
    kinds = "Polygon, Box, ConvexHull, closed Mesh" if ray else "convex Polygon, Box, ConvexHull"
    raise UnsupportedError(f"test {test}: {type(shape).__name__} is not offered; supported are {kinds}")

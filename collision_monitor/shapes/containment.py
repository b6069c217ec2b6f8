"""Which points a solid shape contains, in the shape's frame; the boundary belongs to the shape."""

from __future__ import annotations

from typing import Final

import numpy as np

from collision_monitor.errors import UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.coordinates import Array, Booleans
from collision_monitor.geometry.inside import locate_in_welded_surface
from collision_monitor.geometry.point_in_polygon import Location, locate_in_convex, locate_in_polygon
from collision_monitor.geometry.points import closest_point_on_segment
from collision_monitor.geometry.polygons import is_convex
from collision_monitor.geometry.polyhedra import locate_in_convex_polyhedron, locate_in_polyhedron
from collision_monitor.shapes.shapes import (
    Box,
    Capsule,
    Circle,
    Cone,
    ConvexHull,
    Cylinder,
    Ellipsoid,
    HalfSpace,
    Mesh,
    Points,
    Polygon,
    Shape,
    Sphere,
)

TESTS: Final = ("closed form", "ray", "sides")


def inside(shape: Shape, p: Array, test: str) -> Booleans:
    """Mask (n,) of points p (n, 3) in m in the shape. test: one of TESTS. Raises UnsupportedError."""
    if test == "closed form":
        return _closed_form(shape, p)
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


def _closed_form(shape: Shape, p: Array) -> Booleans:
    """The usual test of each shape."""
    rim, height = np.hypot(p[:, 0], p[:, 1]), np.abs(p[:, 2])
    match shape:
        case Sphere():
            found = np.linalg.norm(p, axis=1) <= shape.radius
        case Box():
            found = (np.abs(p) <= np.array(shape.size) / 2).all(axis=1)
        case Cylinder():
            found = (rim <= shape.radius) & (height <= shape.length / 2)
        case Capsule():
            found = np.hypot(rim, np.maximum(height - shape.length / 2, 0.0)) <= shape.radius
        case Cone():
            found = (height <= shape.length / 2) & (rim * shape.length <= shape.radius * (shape.length / 2 - p[:, 2]))
        case Ellipsoid():
            with np.errstate(over="ignore"):  # a point that is far from a small ellipsoid
                found = np.linalg.norm(p / shape.radii, axis=1) <= 1.0
        case HalfSpace():
            found = p @ shape.normal <= shape.offset
        case Circle():
            found = rim <= shape.radius
        case ConvexHull():
            return inside(shape, p, "sides")
        case Mesh() if not shape.surface.closed:
            raise UnsupportedError(
                f"Mesh: expected a closed surface, which has an inside, got one that is {shape.surface}"
            )
        case Mesh():
            found = locate_in_welded_surface(p, shape.surface) != Location.OUTSIDE
        case Points():
            found = _to_nearest(shape.points, p) <= shape.radius
        case Polygon() if shape.radius > 0.0:
            return _in_rounded_polygon(shape, p[:, :2])
        case Polygon():
            return inside(shape, p, "ray")
        case _:
            raise UnsupportedError(f"{type(shape).__name__}: containment is not offered for it")
    return np.asarray(found)


def _to_nearest(cloud: Array, p: Array) -> Array:
    """Distances (n,) of points (n, 3) from the nearest one of a cloud (k, 3)."""
    from scipy.spatial import cKDTree

    return np.asarray(cKDTree(cloud).query(p)[0])


def _in_rounded_polygon(shape: Polygon, p: Array) -> Booleans:
    """Whether points (n, 2) are in the polygon or within its radius of an edge."""
    start = np.asarray(shape.points)
    at, _ = closest_point_on_segment(p[:, None], start, np.roll(start, -1, axis=0))
    near = (np.hypot(*np.moveaxis(at - p[:, None], -1, 0)) <= shape.radius).any(axis=1)
    if len(start) == 2:
        return np.asarray(near)
    return np.asarray(near | (np.asarray(locate_in_polygon(p, start)) != Location.OUTSIDE))

"""The convex hull of points, and the triangle, which is one face of a mesh."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Final

import numpy as np

from collision_monitor.errors import ShapeError, UnsupportedError
from collision_monitor.geometry.bounding_volumes import convex_hull
from collision_monitor.geometry.contact_features import Feature, mesh_feature_at
from collision_monitor.geometry.point_in_polygon import Location
from collision_monitor.geometry.polyhedra import locate_in_convex_polyhedron
from collision_monitor.geometry.qhull import hull_vertices
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Booleans, Corners, Fields, Kind, Row
from collision_monitor.shapes.mass import MassProperties, polyhedron_mass
from collision_monitor.shapes.rays import RayInterval, planes_interval
from collision_monitor.shapes.shape import Array, Shape, point_rows
from collision_monitor.shapes.surface_parts import hull_triangles

CONVEX_HULL: Final = int(ShapeType.CONVEX_HULL)

TRIANGLE_RING: Final = np.arange(3, dtype=np.int32)
"""The corners of a triangle, in the form of `hull_vertices`."""


@dataclass(frozen=True, eq=False)
class ConvexHull(Shape):
    """Convex hull of points (n, 3) in m, n >= 4 and not all in one plane; interior points are allowed.

    >>> ConvexHull([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]).points.shape
    (4, 3)
    """

    points: Any

    def __post_init__(self) -> None:
        points = point_rows(self.points, "ConvexHull points", 3, 4)
        scale = np.abs(points).max()
        spread = np.linalg.svd((points - points.mean(axis=0)) / (scale or 1.0), compute_uv=False)
        if not spread[2] > 1e-12 * spread[0]:
            raise ShapeError("ConvexHull points: expected a solid, got points in one plane (use a Box or a Mesh)")
        object.__setattr__(self, "points", points)


@dataclass(frozen=True, eq=False)
class Triangle(Shape):
    """One face of a `Mesh` as its pair tests see it: points (3, 3) in m, which may lie on one line or coincide."""

    points: Any

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", point_rows(self.points, "Triangle points", 3, 3))


def _contains(shape: ConvexHull, p: Array) -> Booleans:
    hull = convex_hull(shape.points)
    return np.asarray(locate_in_convex_polyhedron(p, hull.vertices, hull.faces)) != Location.OUTSIDE


def _rays(shape: ConvexHull, p: Array, d: Array) -> list[RayInterval]:
    hull = convex_hull(shape.points)
    a, b, c = (hull.vertices[corner] for corner in hull.faces.T)
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    normal = normal[length > 0.0] / length[length > 0.0, None]
    return [planes_interval(normal, np.einsum("ni,ni->n", normal, a[length > 0.0]), p, d)]


def _feature(shape: ConvexHull, point: Array, normal: Array, tie: float, off: float) -> Feature:
    """Vertices by the numbers of its points, faces by those of `convex_hull`."""
    hull = convex_hull(shape.points)
    found = mesh_feature_at(point, normal, hull.vertices, hull.faces, tie, off)
    same = (shape.points == hull.vertices[list(found.vertices), None]).all(axis=-1)
    return found._replace(vertices=tuple(same.argmax(axis=1).tolist()))


def _mass(shape: ConvexHull, density: float) -> MassProperties:
    return polyhedron_mass(*convex_hull(shape.points), density)


def _no_inside(shape: Triangle, p: Array) -> Booleans:
    raise UnsupportedError("Triangle: containment is not offered for it")


def _row(shape: ConvexHull | Triangle, corners: Corners | None) -> Row:
    if corners is None:
        corners = TRIANGLE_RING if isinstance(shape, Triangle) else hull_vertices(shape.points)
    return Row(CONVEX_HULL, (), float(np.linalg.norm(shape.points, axis=1).max()), points=shape.points, ring=corners)


def _support(shape: ConvexHull | Triangle, d: Array) -> Array:
    return np.asarray((d @ shape.points.T).max(axis=-1))


KIND: Final = Kind(
    number=ShapeType.CONVEX_HULL,
    name="convex hull",
    shape=ConvexHull,
    fields=lambda shape: Fields((), shape.points),
    make=lambda fields: ConvexHull(fields.vertices),
    row=_row,
    support=_support,
    contains=_contains,
    rays=_rays,
    triangles=lambda shape: hull_triangles(np.asarray(shape.points)),
    mass=_mass,
    feature=_feature,
    corners=lambda shape: shape.points,
    middle=lambda shape: np.asarray(shape.points.mean(axis=0)),
    scaled=lambda shape, factor: ConvexHull(factor * shape.points),
    simple=False,
)

TRIANGLE: Final = Kind(
    number=ShapeType.CONVEX_HULL,
    name="triangle",
    shape=Triangle,
    fields=lambda shape: Fields((), shape.points),
    make=lambda fields: Triangle(fields.vertices),
    row=_row,
    support=_support,
    contains=_no_inside,
    triangles=lambda shape: np.asarray(shape.points)[None],
    corners=lambda shape: shape.points,
)
"""The kind of a face, which no message has."""

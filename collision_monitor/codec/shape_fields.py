"""The message Shape: its fields, and the shapes that they describe."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import Floats, Ids, Reader, Writer
from collision_monitor.errors import MessageError, ShapeError
from collision_monitor.records import ShapeType
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

_POINT = ("<f8", 3)
LEAST_SHAPE = 13
"""Bytes of the smallest Shape that can be written."""


def read_shape(reader: Reader) -> tuple[int, Floats, Floats, Ids]:
    """Read type, dimensions (n,), vertices (n, 3), triangles (n,)."""
    return (
        reader.scalar("u1", "type"),
        reader.sequence("<f8", 8, "dimensions"),
        reader.sequence(_POINT, 8, "vertices"),
        reader.sequence("<u4", 4, "triangles"),
    )


_DIMENSIONS: dict[int, tuple[type[Shape], str]] = {
    ShapeType.SPHERE: (Sphere, "radius"),
    ShapeType.BOX: (Box, "x, y, z"),
    ShapeType.CAPSULE: (Capsule, "radius, length"),
    ShapeType.CYLINDER: (Cylinder, "radius, length"),
    ShapeType.CONE: (Cone, "radius, length"),
    ShapeType.ELLIPSOID: (Ellipsoid, "rx, ry, rz"),
    ShapeType.HALF_SPACE: (HalfSpace, "nx, ny, nz, offset"),
    ShapeType.CIRCLE: (Circle, "radius"),
}


def make_shape(kind: int, dimensions: Floats, vertices: Floats, triangles: Ids) -> Shape:
    """Return the shape that the fields describe. Raises ShapeError."""
    if kind in _DIMENSIONS:
        make, names = _DIMENSIONS[kind]
        expected = names.count(",") + 1
        if len(dimensions) != expected:
            raise ShapeError(f"{make.__name__}: expected {expected} dimensions ({names}), got {len(dimensions)}")
        if make in (Box, Ellipsoid):
            return make(dimensions.tolist())
        if make is HalfSpace:
            return HalfSpace(dimensions[:3], dimensions[3])
        return make(*dimensions.tolist())
    if kind == ShapeType.CONVEX_HULL:
        return ConvexHull(vertices)
    if kind == ShapeType.POLYGON:
        if len(dimensions) > 1:
            raise ShapeError(f"Polygon: expected no dimensions, or 1 (radius), got {len(dimensions)}")
        return Polygon(vertices[:, :2], *dimensions.tolist())
    if kind == ShapeType.MESH:
        if len(triangles) % 3:
            raise ShapeError(f"Mesh triangles: expected three indices for each face, got {len(triangles)} indices")
        return Mesh(vertices, triangles.astype(np.int64).reshape(-1, 3))
    if kind == ShapeType.POINTS:
        if len(dimensions) != 1:
            raise ShapeError(f"Points: expected 1 dimension (radius), got {len(dimensions)}")
        return Points(vertices, float(dimensions[0]))
    raise ShapeError(
        f"shape type: expected {min(ShapeType)} to {max(ShapeType)} (Shape.SPHERE to Shape.POINTS), got {kind}"
    )


def write_shape(writer: Writer, shape: Shape) -> None:
    """Write a shape. Raises MessageError for any other object."""
    kind, dimensions, vertices, triangles = _shape_fields(shape)
    writer.scalar("u1", kind, "type")
    writer.sequence(np.array(dimensions, dtype="<f8"), "<f8", 8)
    writer.scalar("u4", len(vertices), "vertices")
    if len(vertices):
        writer.raw(vertices.astype("<f8").tobytes(), 8)
    writer.sequence(triangles.astype("<u4").ravel(), "<u4", 4)


def _shape_fields(shape: Shape) -> tuple[ShapeType, tuple[float, ...], Floats, NDArray[Any]]:
    """Return type, dimensions, vertices (n, 3), triangles (n, 3)."""
    no_vertices, no_triangles = np.empty((0, 3)), np.empty((0, 3), np.uint32)
    match shape:
        case Sphere(radius):
            return ShapeType.SPHERE, (radius,), no_vertices, no_triangles
        case Box(size):
            return ShapeType.BOX, tuple(size), no_vertices, no_triangles
        case Capsule(radius, length):
            return ShapeType.CAPSULE, (radius, length), no_vertices, no_triangles
        case Cylinder(radius, length):
            return ShapeType.CYLINDER, (radius, length), no_vertices, no_triangles
        case Cone(radius, length):
            return ShapeType.CONE, (radius, length), no_vertices, no_triangles
        case Ellipsoid(radii):
            return ShapeType.ELLIPSOID, tuple(radii), no_vertices, no_triangles
        case HalfSpace(normal, offset):
            return ShapeType.HALF_SPACE, (*normal, offset), no_vertices, no_triangles
        case Circle(radius):
            return ShapeType.CIRCLE, (radius,), no_vertices, no_triangles
        case ConvexHull(points):
            return ShapeType.CONVEX_HULL, (), points, no_triangles
        case Mesh(vertices, faces):
            return ShapeType.MESH, (), vertices, faces
        case Points(points, radius):
            return ShapeType.POINTS, (radius,), points, no_triangles
        case Polygon(points, radius):
            level = np.column_stack([points, np.zeros(len(points))])
            return ShapeType.POLYGON, (radius,) if radius else (), level, no_triangles
    raise MessageError(
        f"Shape: expected one of the shapes of collision_monitor.shapes.shapes, got {type(shape).__name__}"
    )

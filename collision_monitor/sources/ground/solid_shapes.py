"""Shapes of shape_msgs as shapes of the monitor, and shapes at another scale."""

from __future__ import annotations

from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import InputError
from collision_monitor.shapes.registry import Box, Cone, Cylinder, HalfSpace, Mesh, Shape, Sphere, kind_of
from collision_monitor.sources.ground.prisms import prism
from collision_monitor.sources.ground.track_shapes import with_extent

_DIMENSIONS: Final = {1: 3, 2: 1, 3: 2, 4: 2, 5: 1}
"""Numbers of a SolidPrimitive by its type: BOX, SPHERE, CYLINDER, CONE, PRISM."""


def primitive_shapes(primitive: Any) -> list[Shape]:
    """Return the shapes of a shape_msgs/SolidPrimitive; a concave prism becomes several. Raises InputError, ShapeError.

    CYLINDER and CONE hold [height, radius], ours [radius, height]. Sizes of 0 become the least extent.
    """
    kind, values = int(primitive.type), with_extent(np.asarray(primitive.dimensions, np.float64)).tolist()
    if kind not in _DIMENSIONS:
        raise InputError(f"SolidPrimitive: expected a type from 1 (BOX) to 5 (PRISM), got {kind}")
    if len(values) != _DIMENSIONS[kind]:
        raise InputError(f"SolidPrimitive of type {kind}: expected {_DIMENSIONS[kind]} dimensions, got {len(values)}")
    if kind == 1:
        return [Box(values)]
    if kind == 2:
        return [Sphere(values[0])]
    if kind == 3:
        return [Cylinder(values[1], values[0])]
    if kind == 4:
        return [Cone(values[1], values[0])]
    if not values[0] > 0.0:
        raise InputError(f"SolidPrimitive of type 5: expected a positive height, got {values[0]}")
    outline = np.array([(p.x, p.y) for p in primitive.polygon.points], np.float64).reshape(-1, 2)
    return [shape for shape, _ in prism(outline, -values[0] / 2, values[0] / 2)]


def mesh_shape(mesh: Any) -> Shape:
    """Return the shape of a shape_msgs/Mesh, decoded or as `message_arrays` left it. Raises ShapeError."""
    vertices, triangles = mesh if isinstance(mesh, tuple) else message_arrays(mesh)
    return Mesh(vertices, triangles)


def message_arrays(mesh: Any) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return vertices (n, 3) and triangles (m, 3) of a shape_msgs/Mesh."""
    vertices = np.array([(p.x, p.y, p.z) for p in mesh.vertices], np.float64).reshape(-1, 3)
    indices = np.concatenate([np.zeros(0, np.int64), *(t.vertex_indices for t in mesh.triangles)])
    return vertices, indices.astype(np.int64).reshape(-1, 3)


def plane_shape(plane: Any) -> Shape:
    """Return the solid below a shape_msgs/Plane a x + b y + c z + d = 0, seen along its normal. Raises ShapeError."""
    a, b, c, d = np.asarray(plane.coef, np.float64).tolist()
    return HalfSpace((a, b, c), -d)


def scaled_shape(shape: Shape, factor: float) -> Shape:
    """Return a shape scaled about its origin, a mesh about the mean of its vertices. Raises ShapeError."""
    if (scaled := kind_of(shape).scaled) is None:
        raise InputError(f"scale: expected a shape of a URDF, got {type(shape).__name__}")
    return scaled(shape, factor)

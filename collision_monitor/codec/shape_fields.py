"""The message Shape: its fields, and the shapes that they describe."""

from __future__ import annotations

import numpy as np

from collision_monitor.codec.cdr import Floats, Ids, Reader, Writer
from collision_monitor.errors import MessageError, ShapeError
from collision_monitor.records import ShapeType
from collision_monitor.shapes.registry import Shape, Triangle, kind_of, kind_with

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


def make_shape(kind: int, dimensions: Floats, vertices: Floats, triangles: Ids) -> Shape:
    """Return the shape that the fields describe. Raises ShapeError."""
    known = kind_with(kind)
    if known is None:
        raise ShapeError(
            f"shape type: expected {min(ShapeType)} to {max(ShapeType)} (Shape.SPHERE to Shape.{max(ShapeType).name}), "
            f"got {kind}"
        )
    expected = known.expected_dimensions
    if expected and len(dimensions) != expected:
        name = known.shape.__name__
        raise ShapeError(f"{name}: expected {expected} dimensions ({known.dimensions}), got {len(dimensions)}")
    return known.make(dimensions.tolist(), vertices, triangles)


def write_shape(writer: Writer, shape: Shape) -> None:
    """Write a shape. Raises MessageError for any other object."""
    if not isinstance(shape, Shape) or isinstance(shape, Triangle):
        raise MessageError(f"Shape: expected a shape of a message, got {type(shape).__name__}")
    kind = kind_of(shape)
    dimensions, vertices, triangles = kind.fields(shape)
    writer.scalar("u1", kind.number, "type")
    writer.sequence(np.array(dimensions, dtype="<f8"), "<f8", 8)
    writer.scalar("u4", len(vertices), "vertices")
    if len(vertices):
        writer.raw(vertices.astype("<f8").tobytes(), 8)
    writer.sequence(triangles.astype("<u4").ravel(), "<u4", 4)

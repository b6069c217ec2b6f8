"""The message Shape: its fields, and the shapes that they describe."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import Floats, Ids, Reader, Writer
from collision_monitor.errors import MessageError, ShapeError
from collision_monitor.records import ShapeType
from collision_monitor.shapes.kind import Fields
from collision_monitor.shapes.registry import Shape, Triangle, kind_of, kind_with

_POINT = ("<f8", 3)
LEAST_SHAPE = 17
"""Bytes of the smallest Shape that can be written."""


class RawShape(NamedTuple):
    """The fields of a Shape in the message, before they are checked."""

    type: int
    dimensions: Floats  # (n,)
    vertices: Floats  # (n, 3)
    triangles: Ids = np.zeros(0, np.uint32)  # (n,)
    data: NDArray[np.uint8] = np.zeros(0, np.uint8)  # (n,)


def read_shape(reader: Reader) -> RawShape:
    """Read a shape."""
    return RawShape(
        reader.scalar("u1", "type"),
        reader.sequence("<f8", 8, "dimensions"),
        reader.sequence(_POINT, 8, "vertices"),
        reader.sequence("<u4", 4, "triangles"),
        reader.sequence("u1", 1, "data"),
    )


def make_shape(raw: RawShape) -> Shape:
    """Return the shape that the fields describe. Raises ShapeError."""
    kind, dimensions, vertices, triangles, data = raw
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
    return known.make(Fields(tuple(dimensions.tolist()), vertices, triangles, data))


def write_shape(writer: Writer, shape: Shape) -> None:
    """Write a shape. Raises MessageError for any other object."""
    if not isinstance(shape, Shape) or isinstance(shape, Triangle):
        raise MessageError(f"Shape: expected a shape of a message, got {type(shape).__name__}")
    kind = kind_of(shape)
    dimensions, vertices, triangles, data = kind.fields(shape)
    writer.scalar("u1", kind.number, "type")
    writer.sequence(np.array(dimensions, dtype="<f8"), "<f8", 8)
    writer.scalar("u4", len(vertices), "vertices")
    if len(vertices):
        writer.raw(vertices.astype("<f8").tobytes(), 8)
    writer.sequence(triangles.astype("<u4").ravel(), "<u4", 4)
    writer.sequence(data, "u1", 1)

"""Messages of recordings that were made before a field was added, as those of today."""

from __future__ import annotations

from typing import Any

import numpy as np

from collision_monitor.codec.cdr import Buffer, Reader, Writer, write_header

_POINT, _POSE = np.dtype("V24"), np.dtype("V56")
"""Elements that are copied as they are: three and seven numbers."""
_DATA = b"uint8[] data"
"""The field of Shape, in a definition of ObjectDescriptionArray, that maps brought."""


def lacks_data(definition: bytes) -> bool:
    """Whether the shapes of an ObjectDescriptionArray with this definition (ros2msg) end before their `data`."""
    return bool(definition) and _DATA not in definition


def with_data(data: Buffer) -> bytes:
    """Return an ObjectDescriptionArray whose shapes have no `data` with empty ones. Raises MessageError."""
    reader, writer = Reader(data, "ObjectDescriptionArray"), Writer("ObjectDescriptionArray")
    write_header(writer, reader.stamp_ns(), reader.string("header.frame_id"))
    _copy(reader, writer, "u1", "snapshot")
    for _ in range(_copied_count(reader, writer, "objects")):
        _copy(reader, writer, "u4", "id")
        _copy(reader, writer, "u1", "operation")
        writer.string(reader.string("name"), "name")
        for _ in range(_copied_count(reader, writer, "shapes")):
            _copy(reader, writer, "u1", "type")
            for dtype, alignment in (("<f8", 8), (_POINT, 8), ("<u4", 4)):
                _copy_sequence(reader, writer, dtype, alignment)
            writer.scalar("u4", 0, "data")
        _copy_sequence(reader, writer, _POSE, 8)
        _copy(reader, writer, "u1", "is_static")
        writer.raw(reader.floats(7, "pose").tobytes(), 8)
        _copy(reader, writer, "u4", "group", "mask")
        _copy_sequence(reader, writer, "<u4", 4)
        _copy(reader, writer, "f8", "padding")
        _copy(reader, writer, "u1", "model")
        _copy(reader, writer, "f8", "max_linear_acceleration", "max_angular_acceleration")
    reader.finish()
    return writer.finish()


def _copy(reader: Reader, writer: Writer, kind: str, *names: str) -> None:
    for name in names:
        writer.scalar(kind, reader.scalar(kind, name), name)


def _copied_count(reader: Reader, writer: Writer, what: str) -> int:
    count = reader.count(1, what)
    writer.scalar("u4", count, what)
    return count


def _copy_sequence(reader: Reader, writer: Writer, dtype: Any, alignment: int) -> None:
    writer.sequence(reader.sequence(dtype, alignment, "sequence"), dtype, alignment)

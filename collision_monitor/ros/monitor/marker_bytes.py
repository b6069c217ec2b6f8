"""visualization_msgs/MarkerArray as CDR bytes: rclpy takes half a second for the corners of a thousand objects."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import Writer

_POINT = np.dtype([("x", "<f8"), ("y", "<f8"), ("z", "<f8")])
_NO_POINTS = np.empty((0, 3))

Color = tuple[float, float, float, float]
"""Red, green, blue, alpha, each 0 to 1."""


class MarkerKind(IntEnum):
    """Values of `Marker.type`."""

    LINE_LIST = 5
    SPHERE_LIST = 7
    TEXT = 9
    TRIANGLE_LIST = 11


@dataclass(frozen=True)
class Marker:
    """One marker: all points (n, 3) in the frame of the array, one colour."""

    namespace: str
    kind: MarkerKind
    color: Color
    points: NDArray[np.float64] = field(default_factory=lambda: _NO_POINTS)
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)
    number: int = 0
    position: tuple[float, float, float] = (0.0, 0.0, 0.0)
    text: str = ""

    @property
    def empty(self) -> bool:
        """Whether there is nothing to draw."""
        return not len(self.points) and not self.text


_ADD, _DELETE = 0, 2


def encode(stamp_ns: int, frame_id: str, markers: list[Marker]) -> bytes:
    """Encode the array. A marker with nothing to draw becomes a DELETE, so that its last picture disappears."""
    writer = Writer("visualization_msgs/MarkerArray")
    writer.scalar("u4", len(markers), "markers")
    for marker in markers:
        _write(writer, stamp_ns, frame_id, marker)
    return writer.finish()


def _write(writer: Writer, stamp_ns: int, frame_id: str, marker: Marker) -> None:
    _header(writer, stamp_ns, frame_id)
    writer.string(marker.namespace, "ns")
    for value in (marker.number, int(marker.kind), _DELETE if marker.empty else _ADD):
        writer.scalar("i4", value, "id, type, action")
    for number in (*marker.position, 0.0, 0.0, 0.0, 1.0, *marker.scale):
        writer.scalar("f8", number, "pose, scale")
    for channel in marker.color:
        writer.scalar("u4", struct.unpack("<I", struct.pack("<f", channel))[0], "color")
    writer.scalar("i4", 0, "lifetime.sec")
    writer.scalar("u4", 0, "lifetime.nanosec")
    writer.scalar("u1", 0, "frame_locked")
    points = np.ascontiguousarray(marker.points, dtype="<f8").view(_POINT).reshape(-1)
    writer.sequence(points, _POINT, 8)
    writer.scalar("u4", 0, "colors")
    writer.string("", "texture_resource")
    _header(writer, 0, "")
    writer.string("", "texture.format")
    writer.scalar("u4", 0, "texture.data")
    writer.scalar("u4", 0, "uv_coordinates")
    writer.string(marker.text, "text")
    writer.string("", "mesh_resource")
    writer.string("", "mesh_file.filename")
    writer.scalar("u4", 0, "mesh_file.data")
    writer.scalar("u1", 0, "mesh_use_embedded_materials")


def _header(writer: Writer, stamp_ns: int, frame_id: str) -> None:
    writer.stamp_ns(stamp_ns)
    writer.string(frame_id, "header.frame_id")

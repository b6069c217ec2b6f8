"""visualization_msgs/Marker and MarkerArray as arrays, read from their bytes: only what an obstacle is made of.

A marker has 25 parts, of which most are for pictures. Objects for all of them take seven times as long. The layout is
that of CDR (OMG DDS-XTypes 1.3, 7.4.1) since ROS 2 Humble.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import ENCAPSULATION, Reader
from collision_monitor.errors import MessageError
from collision_monitor.sources.messages.transform_arrays import MOST_BEHIND, text_of

MARKER: Final = "visualization_msgs/msg/Marker"
MARKERS: Final = "visualization_msgs/msg/MarkerArray"
ADD, DELETE, DELETE_ALL = 0, 2, 3
"""Actions of a marker."""

MARKER_HASHES: Final = {
    MARKER: "RIHS01_45b13ccf791f225962bf74e746f9644518855d783a6f42ba0cc14fde2b4f3ce0",
    MARKERS: "RIHS01_86cb8800b6fb05b5eff1abd7a56f62a5641d3ae9a1c29e78e67e704f1d067dcf",
}
"""Type hashes of the definitions with this layout."""

Floats = NDArray[np.float64]

_LEAST: Final = 200
"""Bytes of the smallest marker."""

_TIME_AND_LENGTH, _LENGTH = struct.Struct("<iII"), struct.Struct("<I")
_NUMBERS, _DURATION = struct.Struct("<iii"), struct.Struct("<iI")
_SECOND: Final = 1_000_000_000


@dataclass(frozen=True, eq=False)
class MarkerArrays:
    """The markers of a message, N rows each.

    frames, namespaces: names. stamps, lifetimes: ns. ids, kinds, actions: numbers. poses (N, 7) in m; scales (N, 3).
    """

    frames: list[str]
    namespaces: list[str]
    stamps: list[int]
    ids: list[int]
    kinds: list[int]
    actions: list[int]
    lifetimes: list[int]
    poses: Floats
    scales: Floats

    @cached_property
    def last(self) -> dict[str, dict[int, int]]:
        """The last row of each marker, by namespace and id. Rows of DELETEALL are left out."""
        found: dict[str, dict[int, int]] = {}
        for row, (namespace, number, action) in enumerate(zip(self.namespaces, self.ids, self.actions, strict=True)):
            if action != DELETE_ALL:
                found.setdefault(namespace, {})[number] = row
        return found

    @cached_property
    def cleared(self) -> dict[str, int]:
        """The last row of DELETEALL of each namespace; of all namespaces it has none."""
        rows = enumerate(zip(self.namespaces, self.actions, strict=True))
        return {namespace: row for row, (namespace, action) in rows if action == DELETE_ALL}


def read_markers(data: bytes, *, single: bool) -> MarkerArrays:
    """Read a MarkerArray, or a Marker if `single`. Raises MessageError."""
    reader = Reader(data, "Marker" if single else "MarkerArray")
    count = 1 if single else reader.count(_LEAST, "markers")
    body = data[len(ENCAPSULATION) :]
    at = len(body) - reader.remaining
    found = MarkerArrays([], [], [], [], [], [], [], np.zeros(0), np.zeros(0))
    starts = []
    tail = b""  # of the last marker
    try:
        for _ in range(count):
            start = _read_marker(body, at, found)
            starts.append(start)
            behind = start + 104
            if not (tail and body.startswith(tail, behind)):
                tail = body[behind : _behind_tail(body, behind)]
            at = behind + len(tail)  # equal bytes have equal lengths in them
        if not 0 <= len(body) - at <= MOST_BEHIND:
            raise ValueError(f"{len(body)} bytes, read to {at}")
    except (struct.error, ValueError) as error:  # UnicodeDecodeError too
        raise MessageError(f"MarkerArray: expected {count} markers, got other bytes: {error!s:.100}") from None
    numbers = np.frombuffer(body, "<f8", len(body) // 8)
    rows = numbers[(np.array(starts, np.int64)[:, None] // 8 + np.arange(10)).reshape(-1, 10)]
    return MarkerArrays(
        found.frames,
        found.namespaces,
        found.stamps,
        found.ids,
        found.kinds,
        found.actions,
        found.lifetimes,
        rows[:, :7],
        rows[:, 7:],
    )


def _read_marker(body: bytes, at: int, found: MarkerArrays) -> int:
    """Read one marker up to its lifetime; return the offset of its pose and scale."""
    at += -at % 4
    sec, nanosec, length = _TIME_AND_LENGTH.unpack_from(body, at)
    found.stamps.append(sec * _SECOND + nanosec)
    found.frames.append(text_of(body, at + 12, length))
    at += 12 + length
    at += -at % 4
    (length,) = _LENGTH.unpack_from(body, at)
    found.namespaces.append(text_of(body, at + 4, length))
    at += 4 + length
    at += -at % 4
    number, kind, action = _NUMBERS.unpack_from(body, at)
    found.ids.append(number)
    found.kinds.append(kind)
    found.actions.append(action)
    start = at + 12 + -(at + 12) % 8
    sec, nanosec = _DURATION.unpack_from(body, start + 96)
    found.lifetimes.append(sec * _SECOND + nanosec)
    return start


def _behind_tail(body: bytes, at: int) -> int:
    """Return the offset behind what follows the lifetime, which is for pictures. `at` is a multiple of 8."""
    at = _behind(body, at + 1, 24, 8)  # frame_locked, then points
    at = _behind(body, at, 16, 4)  # colors
    at = _behind(body, at, 1, 1)  # texture_resource
    at = _behind(body, at + -at % 4 + 8, 1, 1)  # texture: stamp, frame
    at = _behind(body, at, 1, 1)  # its format
    at = _behind(body, at, 1, 1)  # its data
    at = _behind(body, at, 8, 4)  # uv_coordinates
    at = _behind(body, at, 1, 1)  # text
    at = _behind(body, at, 1, 1)  # mesh_resource
    at = _behind(body, at, 1, 1)  # mesh_file: name
    at = _behind(body, at, 1, 1)  # its data
    return at + 1  # mesh_use_embedded_materials


def _behind(body: bytes, at: int, size: int, alignment: int) -> int:
    """Return the offset behind a sequence of elements of `size` bytes, or behind a text."""
    at += -at % 4
    (count,) = _LENGTH.unpack_from(body, at)
    at += 4
    return at + -at % alignment + size * count if count else at


def markers_of(message: Any) -> MarkerArrays:
    """Return the arrays of a decoded message of another definition."""
    each = list(message.markers) if hasattr(message, "markers") else [message]
    poses = [(m.pose.position, m.pose.orientation) for m in each]
    return MarkerArrays(
        [str(m.header.frame_id) for m in each],
        [str(m.ns) for m in each],
        [int(m.header.stamp.sec) * _SECOND + int(m.header.stamp.nanosec) for m in each],
        [int(m.id) for m in each],
        [int(m.type) for m in each],
        [int(m.action) for m in each],
        [int(m.lifetime.sec) * _SECOND + int(m.lifetime.nanosec) for m in each],
        np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for p, q in poses], np.float64).reshape(-1, 7),
        np.array([(m.scale.x, m.scale.y, m.scale.z) for m in each], np.float64).reshape(-1, 3),
    )

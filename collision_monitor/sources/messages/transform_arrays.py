"""tf2_msgs/TFMessage as arrays, read from its bytes: 10,000 transforms in a seventh of the time of objects.

The layout is that of CDR (OMG DDS-XTypes 1.3, 7.4.1). Alignment counts from behind the encapsulation.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.codec.cdr import ENCAPSULATION, Reader
from collision_monitor.errors import MessageError

TRANSFORMS: Final = "tf2_msgs/msg/TFMessage"
TRANSFORMS_HASH: Final = "RIHS01_e369d0f05a23ae52508854b66f6aa0437f3449d652e8cbf22d5abe85d020f087"
"""Type hash of the definition with this layout."""

Floats = NDArray[np.float64]

_LEAST: Final = 76
"""Bytes of the smallest transform."""

MOST_BEHIND: Final = 8
"""Bytes that a middleware may leave behind a message, for its alignment."""

_TIME_AND_LENGTH, _LENGTH = struct.Struct("<iII"), struct.Struct("<I")


@dataclass(frozen=True, eq=False)
class TransformArrays:
    """The transforms of a message, N rows each: frames by name, stamps (N,) in ns, poses (N, 7) of child in parent."""

    parents: list[str]
    children: list[str]
    stamps: list[int]
    poses: Floats


def read_transforms(data: bytes) -> TransformArrays:
    """Read a message. Raises MessageError."""
    reader = Reader(data, "TFMessage")
    count = reader.count(_LEAST, "transforms")
    body = data[len(ENCAPSULATION) :]
    at = len(body) - reader.remaining
    parents, children, stamps, starts = [], [], [], []
    try:
        for _ in range(count):
            at += -at % 4
            sec, nanosec, length = _TIME_AND_LENGTH.unpack_from(body, at)
            at += 12
            parents.append(text_of(body, at, length))
            at += length
            at += -at % 4
            (length,) = _LENGTH.unpack_from(body, at)
            at += 4
            children.append(text_of(body, at, length))
            at += length
            at += -at % 8
            stamps.append(sec * 1_000_000_000 + nanosec)
            starts.append(at)
            at += 56
        if not 0 <= len(body) - at <= MOST_BEHIND:
            raise ValueError(f"{len(body)} bytes, read to {at}")
    except (struct.error, ValueError) as error:  # UnicodeDecodeError too
        raise MessageError(f"TFMessage: expected {count} transforms, got other bytes: {error!s:.100}") from None
    numbers = np.frombuffer(body, "<f8", len(body) // 8)
    rows = np.array(starts, np.int64)[:, None] // 8 + np.arange(7)
    return TransformArrays(parents, children, stamps, numbers[rows.reshape(-1, 7)])


def transforms_of(message: Any) -> TransformArrays:
    """Return the arrays of a decoded message of another definition."""
    each = [(t, t.transform.translation, t.transform.rotation) for t in message.transforms]
    return TransformArrays(
        [str(t.header.frame_id) for t, _, _ in each],
        [str(t.child_frame_id) for t, _, _ in each],
        [int(t.header.stamp.sec) * 1_000_000_000 + int(t.header.stamp.nanosec) for t, _, _ in each],
        np.array([(p.x, p.y, p.z, q.x, q.y, q.z, q.w) for _, p, q in each], np.float64).reshape(-1, 7),
    )


def text_of(body: bytes, at: int, length: int) -> str:
    """Return the text of a CDR string of `length` bytes with its terminator. Raises ValueError."""
    if length == 0:
        return ""
    if at + length > len(body):
        raise ValueError("truncated")
    return str(body[at : at + length - 1], "utf-8")

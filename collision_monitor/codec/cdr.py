"""Little-endian CDR (XCDR1, plain), the wire format of ROS 2: a reader that checks every bound, and a writer.

Source: OMG DDS-XTypes 1.3, 7.4.1. A message begins with four encapsulation bytes; alignment counts from behind them.
"""

from __future__ import annotations

import struct
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import MessageError
from collision_monitor.geometry.bounded_cache import bounded_cache

ENCAPSULATION = b"\x00\x01\x00\x00"
PADDING = 3
"""Most bytes that a middleware adds behind a message to round its size up to a multiple of 4."""

REMEMBERED_STRINGS: Final = 16 << 20
"""Bytes of encoded strings that are remembered: about 35,000 names of usual length. More: memory that hostile names can
fill. Less: a step that mentions more objects encodes names again, 0.5 µs each."""

Buffer = bytes | bytearray | memoryview
Records = NDArray[np.void]
Floats = NDArray[np.float64]
Ids = NDArray[np.uint32]

_NANOSECONDS = 1_000_000_000
_U4 = struct.Struct("<I")
_SCALARS = {
    name: struct.Struct("<" + code)
    for name, code in {"u1": "B", "i4": "i", "u4": "I", "i8": "q", "u8": "Q", "f8": "d"}.items()
}


class Reader:
    """Reads one message from its first byte on. Every method raises MessageError if the bytes do not fit."""

    def __init__(self, data: Buffer, message: str) -> None:
        self._data = memoryview(data).cast("B") if isinstance(data, memoryview) else memoryview(data)
        self._message = message
        self._at = len(ENCAPSULATION)
        self._padding = PADDING
        head = bytes(self._data[:4])
        if len(head) < 4:
            raise self.error(f"expected 4 encapsulation bytes first, got {len(head)} bytes in all")
        if head[:2] != ENCAPSULATION[:2]:
            kind = "big-endian CDR, which is not supported" if head[:2] == b"\x00\x00" else f"0x{head.hex()}"
            raise self.error(f"expected little-endian CDR (encapsulation 0x00010000), got {kind}")

    def error(self, text: str) -> MessageError:
        """Return the error for this message, to be raised."""
        return MessageError(f"{self._message}: {text}")

    @property
    def remaining(self) -> int:
        """Number of bytes that are not read yet."""
        return len(self._data) - self._at

    @property
    def at(self) -> int:
        """Offset of the next byte."""
        return self._at

    def _take(self, size: int, alignment: int, what: str) -> int:
        """Skip the next `size` bytes, behind the alignment, and return their offset."""
        start = self._at + (4 - self._at) % alignment
        if size > len(self._data) - start:
            left = max(0, len(self._data) - start)
            raise self.error(
                f"{what}: expected {size} bytes at offset {start}, got {left}: truncated or of another type"
            )
        self._at = start + size
        return start

    def scalar(self, kind: str, what: str) -> Any:
        """Read one number: u1, i4, u4, i8, u8 or f8."""
        codec = _SCALARS[kind]
        return codec.unpack_from(self._data, self._take(codec.size, codec.size, what))[0]

    def floats(self, count: int, what: str) -> Floats:
        """Read numbers f8 that follow each other, as a read-only view of the bytes."""
        return np.frombuffer(self._data.toreadonly(), "<f8", count, self._take(8 * count, 8, what))

    def boolean(self, what: str) -> bool:
        """Read a byte that is 0 or 1."""
        value = self.scalar("u1", what)
        if value > 1:
            raise self.error(f"{what}: expected 0 or 1 for a bool, got {value}")
        return bool(value)

    def string(self, what: str) -> str:
        """Read UTF-8 text."""
        length = _U4.unpack_from(self._data, self._take(4, 4, what))[0]
        if length == 0:  # some writers leave out the terminator of an empty string
            return ""
        start = self._take(length, 1, what)
        raw = bytes(self._data[start : start + length])
        if raw.find(0) != length - 1:
            raise self.error(
                f"{what}: expected a string of {length} bytes whose only zero byte is the last, got {raw[:40]!r}"
            )
        try:
            return str(raw[:-1], "utf-8")
        except UnicodeDecodeError:
            raise self.error(f"{what}: expected UTF-8 text, got {raw[:40]!r}") from None

    def count(self, least: int, what: str) -> int:
        """Read the length of a sequence whose elements have at least `least` bytes, checked against the bytes left."""
        count: int = _U4.unpack_from(self._data, self._take(4, 4, what))[0]
        if count * least > self.remaining:
            raise self.error(
                f"{what}: expected {count} elements of at least {least} bytes, got {self.remaining} bytes: "
                "truncated or of another type"
            )
        return count

    def sequence(self, dtype: Any, alignment: int, what: str) -> NDArray[Any]:
        """Read a sequence of fixed-size elements as a read-only view of the bytes."""
        dtype = np.dtype(dtype)
        count = self.count(dtype.itemsize, what)
        if count == 0:
            # An empty sequence has no alignment. rmw_fastrtps' serialize() sizes its buffer as if it had one and leaves
            # the unused bytes as garbage behind the message. So each empty sequence may add one alignment to the end.
            self._padding += alignment if alignment > 4 else 0
            return np.empty(0, dtype)
        start = self._take(count * dtype.itemsize, alignment, what)
        return np.frombuffer(self._data.toreadonly(), dtype, count, start)

    def strings(self, what: str) -> list[str]:
        """Read a sequence of texts."""
        return [self.string(what) for _ in range(self.count(4, what))]

    def stamp_ns(self) -> int:
        """Read a builtin_interfaces/Time as integer nanoseconds."""
        seconds = self.scalar("i4", "header.stamp.sec")
        nanoseconds = self.scalar("u4", "header.stamp.nanosec")
        if nanoseconds >= _NANOSECONDS:
            raise self.error(f"header.stamp.nanosec: expected less than 1000000000, got {nanoseconds}")
        return int(seconds * _NANOSECONDS + nanoseconds)

    def finish(self) -> None:
        """Check that the message is complete: only padding may follow."""
        if self.remaining > self._padding:
            raise self.error(f"expected the end at offset {self._at}, got {self.remaining} more bytes: of another type")


def _string(text: str) -> bytes:
    """Return length, bytes and terminator. Raises ValueError."""
    raw = text.encode("utf-8")
    if 0 in raw:
        raise ValueError
    return _U4.pack(len(raw) + 1) + raw + b"\0"


def _memory(encoded: bytes, text: str) -> int:
    return len(encoded) + 4 * len(text)  # Python needs up to 4 bytes for a character


@bounded_cache(REMEMBERED_STRINGS, _memory)  # the same names are published at every step
def _padded_string(text: str) -> bytes:
    """Return the same, padded to a multiple of 4, where the next string begins."""
    raw = _string(text)
    return raw + bytes(-len(raw) % 4)


class Writer:
    """Writes one message. Raises MessageError for a value that its field cannot hold."""

    def __init__(self, message: str) -> None:
        self._parts = [ENCAPSULATION]
        self._size = len(ENCAPSULATION)
        self._message = message

    def error(self, text: str) -> MessageError:
        """Return the error for this message, to be raised."""
        return MessageError(f"{self._message}: {text}")

    def raw(self, data: bytes, alignment: int = 1) -> None:
        """Append bytes that are CDR already."""
        padding = (4 - self._size) % alignment
        if padding:
            self._parts.append(bytes(padding))
        self._parts.append(data)
        self._size += padding + len(data)

    def scalar(self, kind: str, value: float, what: str) -> None:
        """Write one number: u1, i4, u4, i8, u8 or f8."""
        codec = _SCALARS[kind]
        try:
            self.raw(codec.pack(value), codec.size)
        except (struct.error, OverflowError, TypeError):
            raise self.error(f"{what}: expected a number that {kind} can hold, got {value!r}") from None

    def string(self, text: str, what: str) -> None:
        """Write text with its terminator."""
        try:
            self.raw(_string(text), 4)
        except ValueError:
            raise self.error(f"{what}: expected text that UTF-8 can hold, without zero bytes, got {text!r}") from None

    def sequence(self, array: NDArray[Any], dtype: Any, alignment: int) -> None:
        """Write a sequence of fixed-size elements: a one-dimensional array of exactly this dtype, as in memory."""
        dtype = np.dtype(dtype)
        if array.dtype != dtype or array.ndim != 1:
            raise self.error(f"expected a one-dimensional array of {dtype}, got {array.dtype} of shape {array.shape}")
        self.scalar("u4", len(array), "length")
        if len(array):
            self.raw(array.tobytes(), alignment)

    def strings(self, texts: list[str], what: str) -> None:
        """Write a sequence of texts."""
        self.scalar("u4", len(texts), what)
        try:
            self.raw(b"".join(map(_padded_string, texts[:-1])))
        except ValueError:
            raise self.error(f"{what}: expected texts that UTF-8 can hold, without zero bytes") from None
        for text in texts[-1:]:
            self.string(text, what)

    def stamp_ns(self, stamp_ns: int) -> None:
        """Write integer nanoseconds as builtin_interfaces/Time."""
        seconds, nanoseconds = divmod(stamp_ns, _NANOSECONDS)
        self.scalar("i4", seconds, "header.stamp.sec")
        self.scalar("u4", nanoseconds, "header.stamp.nanosec")

    def finish(self) -> bytes:
        """Return the message."""
        return b"".join(self._parts)


def write_header(writer: Writer, stamp_ns: int, frame_id: str) -> None:
    """Write a std_msgs/Header."""
    writer.stamp_ns(stamp_ns)
    writer.string(frame_id, "header.frame_id")

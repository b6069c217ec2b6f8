"""Unpacks the chunks of an MCAP file within limits: no file takes more time or memory than its size justifies.

A few kilobytes can claim, and unpack to, gigabytes of nothing. Each limit lies far above what rosbag2 and our writer
write: chunks of 1 MiB or 8 MiB plus one message, which unpack to at most 300 times their size.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Final

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.opcode import Opcode

from collision_monitor.session.mcap.layout import HEAD

CHUNK_BYTES: Final = 64 << 20
"""Bytes of a chunk besides its largest record, because a reader holds one chunk in memory. Our writer: 8 MiB."""

LARGEST_CHUNK: Final = 1 << 30
"""Bytes of a chunk with its largest record, packed or not: a mesh of 10^7 triangles has 0.4 GiB."""

RATIO: Final = 1000
"""Unpacked bytes for each packed byte, of a chunk above CHUNK_BYTES and of a file above FILE_BYTES. A recording of 100
objects that stand still has 300, the most that our writer was seen to reach."""

FILE_BYTES: Final = 1 << 30
"""Bytes that the chunks of a small file may unpack to. Reading them takes about 1 s."""

RECORD_BYTES: Final = 4
"""Packed bytes for each record of a chunk. The smallest messages take 6: sequence and times differ in each of them."""

FREE_RECORDS: Final = 64
"""Records that a chunk of any size may hold."""

_WINDOW: Final = 1 << 27
"""Memory that a zstd frame may demand (bytes): the limit of zstd's own tools, the window of its highest level."""

_PIECE: Final = 256
"""Packed bytes that are unpacked at a time. They become 8 MiB at most (zstd); what comes before damage is kept."""

_ZSTD, _LZ4 = b"\x28\xb5\x2f\xfd", b"\x04\x22\x4d\x18"


class ChunkLimitError(ValueError):
    """A chunk, or all of a file's, would take more time or memory than the file's size justifies."""


class Unpacker:
    """Unpacks the chunks of one file. size: of the file (bytes)."""

    def __init__(self, size: int) -> None:
        self._left = self._all = max(FILE_BYTES, RATIO * size)

    def unpack(self, packed: bytes) -> tuple[bytes, bool]:
        """Unpack as much as possible, by the magic number of the bytes. Return also whether that was all of them.

        Raises ChunkLimitError.
        """
        if not packed.startswith((_ZSTD, _LZ4)):
            return packed, True
        whole = self._at_once(packed) if packed.startswith(_ZSTD) else None
        return (whole, True) if whole is not None else self._in_pieces(packed)

    def _at_once(self, packed: bytes) -> bytes | None:
        """Unpack a frame that states a size within the limits; None for any other, and for a damaged one."""
        with suppress(zstandard.ZstdError):
            if zstandard.frame_content_size(packed) in range(max(min(CHUNK_BYTES, self._left), -1) + 1):
                unpacker = zstandard.ZstdDecompressor(max_window_size=_WINDOW)
                whole = unpacker.decompress(packed, allow_extra_data=False)
                self._left -= len(whole)
                return whole
        return None

    def _in_pieces(self, packed: bytes) -> tuple[bytes, bool]:
        unpacker: Any
        if packed.startswith(_ZSTD):
            unpacker = zstandard.ZstdDecompressor(max_window_size=_WINDOW).decompressobj()
        else:
            unpacker = lz4.frame.LZ4FrameDecompressor()
        out = bytearray()
        end = 0
        limit = CHUNK_BYTES
        with suppress(zstandard.ZstdError, RuntimeError, EOFError):
            while end < len(packed) and not unpacker.eof:
                piece = unpacker.decompress(packed[end : end + _PIECE])
                out += piece
                end += _PIECE
                self._left -= len(piece)
                if self._left < 0:
                    raise ChunkLimitError(f"the chunks of the file unpack to more than {self._all} bytes")
                if len(out) > limit:
                    limit = _limit(out, len(packed))
        whole = bool(unpacker.eof and not unpacker.unused_data and end >= len(packed))
        del unpacker  # the memory of its window is needed for the copy
        return bytes(out), whole


def _limit(begun: bytearray, packed: int) -> int:
    """Return how long a chunk may become that begins like this, by its largest record. Raises ChunkLimitError."""
    largest = 0
    for opcode, begin, end in records(begun, packed):
        if not opcode:
            break
        largest = max(largest, end - begin)
    limit = min(CHUNK_BYTES + largest, max(CHUNK_BYTES, RATIO * packed), LARGEST_CHUNK)
    if len(begun) > limit:
        raise ChunkLimitError(f"its {packed} bytes unpack to more than {limit}, beyond the size that they justify")
    return limit


def records(data: bytes | bytearray, packed: int) -> Iterator[tuple[int, int, int]]:
    """Yield opcode, begin and end of the content of each record in a chunk. packed: size of the packed chunk (bytes).

    The last one may be incomplete: then it ends behind the data. Raises ChunkLimitError for more than that size
    justifies, and ValueError for an opcode 0, which no record has.
    """
    at = 0
    left = FREE_RECORDS + packed // RECORD_BYTES
    size = len(data)
    while at + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(data, at)
        if not opcode:
            raise ValueError("a record of kind 0 in it is none")
        if not left:
            raise ChunkLimitError(f"its {packed} bytes hold more records than they justify")
        left -= 1
        begin = at + HEAD.size
        at = begin + length
        yield opcode, begin, at
    if at < size:
        yield Opcode.MESSAGE, size, size + 1  # a head that is cut off

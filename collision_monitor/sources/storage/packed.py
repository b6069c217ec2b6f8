"""Messages and files that rosbag2 packed by zstd, unpacked within limits: a few kilobytes may unpack to gigabytes."""

from __future__ import annotations

import os
from pathlib import Path
from typing import BinaryIO, Final

import zstandard

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.chunk import CHUNK_BYTES, FILE_BYTES, LARGEST_CHUNK, RATIO
from collision_monitor.settings.regular_file import open_regular
from collision_monitor.sources.storage.stored_channel import damaged_bag

ZSTD_MAGIC: Final = b"\x28\xb5\x2f\xfd"

_WINDOW: Final = 1 << 27
"""Memory that a frame may demand (bytes), as zstd's own tools allow."""

_PIECE: Final = 1 << 8
"""Packed bytes that are unpacked at a time. They become 8 MiB at most."""


def unpack_message(data: bytes, topic: str) -> bytes:
    """Return the message, unpacked if it is packed. CDR never begins like zstd. Raises SessionError beyond the limits.

    A frame need not state its size: a program that packs a stream does not know it.
    """
    if not data.startswith(ZSTD_MAGIC):
        return data
    limit = min(max(CHUNK_BYTES, RATIO * len(data)), LARGEST_CHUNK)
    unpacker = zstandard.ZstdDecompressor(max_window_size=_WINDOW).decompressobj()
    out = bytearray()
    try:
        for at in range(0, len(data), _PIECE):
            out += unpacker.decompress(data[at : at + _PIECE])
            if len(out) > limit:
                raise SessionError(f"{topic}: expected a message of at most {limit} unpacked bytes, got more")
            if unpacker.eof:
                break
    except zstandard.ZstdError as error:
        raise SessionError(f"{topic}: expected a message packed by zstd, got: {error}") from None
    if not unpacker.eof:
        raise SessionError(f"{topic}: expected a message packed by zstd, got one that is cut off")
    return bytes(out)


def unpack_file(path: Path, target: BinaryIO) -> None:
    """Write the unpacked bytes of a file that is packed as a whole. Raises SessionError beyond the limits."""
    with open_regular(path, "a bag", refused=SessionError) as file:
        limit = max(FILE_BYTES, RATIO * os.fstat(file.fileno()).st_size)
        unpacked = zstandard.ZstdDecompressor(max_window_size=_WINDOW).stream_reader(file, read_across_frames=True)
        size = 0
        try:
            while piece := unpacked.read(1 << 20):
                size += len(piece)
                if size > limit:
                    raise SessionError(damaged_bag(path, f"it unpacks to more than {limit} bytes"))
                target.write(piece)
        except zstandard.ZstdError as error:
            raise SessionError(damaged_bag(path, str(error))) from None
        except OSError as error:
            raise SessionError(f"{path}: expected room to unpack it, got: {error.strerror or error}") from None

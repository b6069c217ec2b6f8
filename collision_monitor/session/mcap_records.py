"""The records of an MCAP file in the order of the file, also where its end is missing or it was damaged."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from collision_monitor.errors import SessionError

_MAGIC: Final = b"\x89MCAP0\r\n"
_HEAD: Final = struct.Struct("<BQ")
_LARGEST_CHUNK: Final = 1 << 30
"""Bytes, unpacked. rosbag2 writes less than 1 MiB; what claims more than this is damaged."""


class McapRecords:
    """A file. damage: what is missing or broken, one sentence each, and position: bytes read, of the last reading.

    Raises SessionError for what is no MCAP file, or cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: list[str] = []
        self.position = 0
        try:
            self.size = path.stat().st_size
            with path.open("rb") as file:
                magic = file.read(len(_MAGIC))
        except OSError as error:
            raise SessionError(f"{path}: expected a file that can be read, got: {error.strerror}") from None
        if magic != _MAGIC:
            what = f"it begins with {magic!r}" if magic else "the file is empty"
            raise SessionError(f"{path}: expected an MCAP file, but {what}")

    def __iter__(self) -> Iterator[Any]:
        """Header, schemas, channels, messages and metadata, from chunks as well. What is damaged is noted, left out."""
        self.damage = []
        with self.path.open("rb") as file:
            for start, opcode, payload in self._whole(file):
                # Whatever the library raises for bytes that are not as they should be: that record is damaged.
                try:
                    records = _unpack(opcode, payload)
                except Exception as error:
                    reason = str(error) or repr(error)
                    self.damage.append(f"{_name(opcode)} of {len(payload)} bytes at byte {start} is damaged: {reason}")
                    continue
                yield from records

    def _whole(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        """Where each record starts, its opcode and its payload, up to the end of the data or of what is there."""
        file.read(len(_MAGIC))
        while True:
            self.position = start = file.tell()
            head = file.read(_HEAD.size)
            if not head:
                self.damage.append("the recording was not closed: it ends without a summary")
                return
            opcode, length = _HEAD.unpack(head) if len(head) == _HEAD.size else (0, self.size)
            if length > self.size - start - _HEAD.size:
                self.damage.append(
                    f"the recording was cut off: its last {self.size - start} bytes are an incomplete record"
                )
                return
            if opcode == Opcode.DATA_END:
                self.position = self.size
                return
            yield start, opcode, file.read(length)


def _unpack(opcode: int, payload: bytes) -> list[Any]:
    """The records in the payload; raises anything where it is damaged."""
    stream = ReadDataStream(BytesIO(payload))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        if chunk.uncompressed_size > _LARGEST_CHUNK:
            raise ValueError(f"it claims {chunk.uncompressed_size} bytes")
        return list(breakup_chunk(chunk, validate_crc=True))
    if opcode == Opcode.MESSAGE:
        return [Message.read(stream, len(payload))]
    for kind, read in _KINDS.items():
        if opcode == kind:
            return [read(stream)]
    return []


_KINDS: Final = {
    Opcode.HEADER: Header.read,
    Opcode.METADATA: Metadata.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
}


def _name(opcode: int) -> str:
    try:
        return f"the {Opcode(opcode).name.lower()}"
    except ValueError:
        return f"a record of unknown kind {opcode}"

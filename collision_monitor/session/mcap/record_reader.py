"""Reads the records of an MCAP file in the order of the file, even if its end is missing or it is damaged."""

from __future__ import annotations

import zlib
from collections.abc import Callable, Iterator
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Header, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.layout import HEAD, LARGEST_CHUNK, MAGIC, MESSAGE

_GLANCE: Final = 256
"""Bytes of a record that hold its times and its name."""


class Message(NamedTuple):
    """A message. Times in ns."""

    channel_id: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class McapReader:
    """Reader of one MCAP file. Raises SessionError if the path is no MCAP file or cannot be read.

    damage: one sentence for each missing or broken part; position: bytes read; both of the last reading.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage: list[str] = []
        self.position = 0
        try:
            self.size = path.stat().st_size
            with path.open("rb") as file:
                magic = file.read(len(MAGIC))
        except OSError as error:
            raise SessionError(f"{path}: expected a file that can be read, got: {error.strerror}") from None
        if magic != MAGIC:
            what = f"it begins with {magic!r}" if magic else "the file is empty"
            raise SessionError(f"{path}: expected an MCAP file, but {what}")

    def __iter__(self) -> Iterator[Any]:
        """Yield header, schemas, channels, messages, metadata and attachments, also those in chunks.

        Damaged records are left out and noted in `damage`.
        """
        return self.read()

    def read(self, begin: int = 0) -> Iterator[Any]:
        """Yield the same. begin: offset of a record; the records from the first message up to it are skipped."""
        self.damage = []
        with self.path.open("rb") as file:
            for start, opcode, payload in self._whole(file):
                # The library raises many kinds of errors for wrong bytes. Each means that the record is damaged.
                try:
                    records = _unpack(opcode, payload)
                except Exception as error:
                    reason = str(error) or repr(error)
                    self.damage.append(f"{_name(opcode)} of {len(payload)} bytes at byte {start} is damaged: {reason}")
                    continue
                for record in records:
                    if start < begin and isinstance(record, Message):
                        file.seek(begin)
                        break
                    yield record

    def glance(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield offset, opcode and first bytes of each record in the file, without unpacking it."""
        self.damage = []
        with self.path.open("rb") as file:
            for start, opcode, length in self._heads(file):
                yield start, opcode, file.read(min(length, _GLANCE))
                file.seek(start + HEAD.size + length)

    def _whole(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
        """Yield offset, opcode and payload of each record."""
        for start, opcode, length in self._heads(file):
            yield start, opcode, file.read(length)

    def _heads(self, file: BinaryIO) -> Iterator[tuple[int, int, int]]:
        """Yield offset, opcode and length of each record, up to the end of the data or of the file."""
        file.seek(len(MAGIC))
        while True:
            self.position = start = file.tell()
            head = file.read(HEAD.size)
            if not head:
                self.damage.append("the recording was not closed: it ends without a summary")
                return
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, self.size)
            if length > self.size - start - HEAD.size:
                self.damage.append(
                    f"the recording was cut off: its last {self.size - start} bytes are an incomplete record"
                )
                return
            if opcode == Opcode.DATA_END:
                self.position = self.size
                return
            yield start, opcode, length


def _unpack(opcode: int, payload: bytes) -> list[Any]:
    """Return the records in the payload. Any exception means that it is damaged."""
    if opcode == Opcode.MESSAGE:
        return [_message(payload, 0, len(payload))]
    stream = ReadDataStream(BytesIO(payload))
    if opcode == Opcode.CHUNK:
        chunk = Chunk.read(stream)
        if chunk.uncompressed_size > LARGEST_CHUNK:
            raise ValueError(f"it claims {chunk.uncompressed_size} bytes")
        records, size = get_chunk_data_stream(chunk, validate_crc=True)
        return _in_chunk(records.read(size))
    if opcode == Opcode.ATTACHMENT and int.from_bytes(payload[-4:], "little") not in (0, zlib.crc32(payload[:-4])):
        raise ValueError("its checksum is wrong")
    return [_DECODERS[opcode](stream)] if opcode in _DECODERS else []


def _in_chunk(data: bytes) -> list[Any]:
    """Return the records of a chunk. Most are messages, which are unpacked here because the library takes longer."""
    records: list[Any] = []
    at = 0
    while at < len(data):
        opcode, length = HEAD.unpack_from(data, at)
        begin, at = at + HEAD.size, at + HEAD.size + length
        if at > len(data):
            raise ValueError(f"a record of {length} bytes in it is cut off")
        if opcode == Opcode.MESSAGE:
            records.append(_message(data, begin, at))
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            records += _unpack(opcode, data[begin:at])
    return records


def _message(data: bytes, begin: int, end: int) -> Message:
    if end - begin < MESSAGE.size:
        raise ValueError(f"a message of {end - begin} bytes is none")
    channel_id, sequence, log_time, publish_time = MESSAGE.unpack_from(data, begin)
    return Message(channel_id, sequence, log_time, publish_time, data[begin + MESSAGE.size : end])


_DECODERS: Final[dict[int, Callable[[ReadDataStream], Any]]] = {
    Opcode.HEADER: Header.read,
    Opcode.METADATA: Metadata.read,
    Opcode.SCHEMA: Schema.read,
    Opcode.CHANNEL: Channel.read,
    Opcode.ATTACHMENT: Attachment.read,
}


def _name(opcode: int) -> str:
    try:
        return f"the {Opcode(opcode).name.lower()}"
    except ValueError:
        return f"a record of unknown kind {opcode}"

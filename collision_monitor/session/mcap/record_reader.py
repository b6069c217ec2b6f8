"""Reads the records of an MCAP file in the order of the file, even if its end is missing or it is damaged."""

from __future__ import annotations

import os
import zlib
from collections.abc import Callable, Iterable, Iterator
from io import SEEK_CUR, BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final, NamedTuple

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema, Statistics

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.chunk import LARGEST_CHUNK, Unpacker, records
from collision_monitor.session.mcap.definitions_in_force import LARGEST_DEFINITION, DefinitionsInForce
from collision_monitor.session.mcap.layout import CHUNK_HEAD, FOOTER, HEAD, MAGIC, MESSAGE
from collision_monitor.session.mcap.sentences import add_sentence
from collision_monitor.settings.regular_file import open_regular

_GLANCE: Final = 256
"""Bytes of a record that hold its times and its name."""

_LARGEST: Final[dict[int, int]] = {
    Opcode.MESSAGE: LARGEST_CHUNK,
    Opcode.CHUNK: LARGEST_CHUNK,
    Opcode.ATTACHMENT: 64 << 20,  # a snapshot of 10,000 objects has 3 MB
    Opcode.METADATA: 4 << 20,  # the longest are rosbag2's copy of metadata.yaml and the losses of a salvage
    Opcode.HEADER: 1 << 20,
    Opcode.SCHEMA: LARGEST_DEFINITION,
    Opcode.CHANNEL: LARGEST_DEFINITION,
}
"""Bytes of a record that is read; longer ones are damage. Records of other kinds are skipped unread."""

_LARGEST_SUMMARY: Final = 64 << 20
"""Bytes of the schemas, channels and statistics in a summary: those of 10,000 topics."""

_DEFINITIONS: Final = 1 << 17
"""Schemas and channels in one chunk: there are 2^16 ids of each."""


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
        self._behind_data = 0
        self._unpacker = Unpacker(0)
        self._in_force = DefinitionsInForce()
        with self._open() as file:
            self.size = os.fstat(file.fileno()).st_size
            magic = file.read(len(MAGIC)) or b""
        if magic != MAGIC:
            what = f"it begins with {magic!r}" if magic else "the file is empty"
            raise SessionError(f"{path}: expected an MCAP file, but {what}")

    def opened(self) -> BinaryIO:
        """Open the file, to read its records from the start on."""
        self.damage = []
        self._unpacker = Unpacker(self.size)
        self._in_force = DefinitionsInForce()
        return self._open()

    def _open(self) -> BinaryIO:
        return open_regular(self.path, "an MCAP file", refused=SessionError)

    def __iter__(self) -> Iterator[Any]:
        """Yield header, schemas, channels, messages, metadata and attachments, also those in chunks.

        Damaged records are left out and noted in `damage`.
        """
        return self.read()

    def read(self, begin: int = 0) -> Iterator[Any]:
        """Yield the same. begin: offset of a record; the records from the first message up to it are skipped."""
        count = 0
        with self.opened() as file:
            for start, _, found_records in self._sections(file):
                for record in found_records:
                    if isinstance(record, Message):
                        if start < begin:
                            file.seek(begin)
                            break
                        count += 1
                    yield record
        if self.position == self.size and not (begin or self.damage):
            self._compare(count)

    def sections(self) -> Iterator[tuple[int, int, Iterable[Any]]]:
        """Yield offset and opcode of each record in the file, and the records that it holds: of a chunk, or itself."""
        with self.opened() as file:
            yield from self._sections(file)

    def record_at(self, file: BinaryIO, start: int) -> Iterable[Any]:
        """Return what the record at an offset holds, which `sections` yielded before. file: from `opened`.

        Raises SessionError.
        """
        file.seek(start)
        try:
            opcode, length = HEAD.unpack(file.read(HEAD.size))
            return self._unpack(opcode, file.read(length))
        except Exception as error:  # as above
            raise SessionError(f"{self.path}: expected the bytes of before, got others: {error}") from None

    def _sections(self, file: BinaryIO) -> Iterator[tuple[int, int, Iterable[Any]]]:
        for start, opcode, length in self._heads(file):
            limit = _LARGEST.get(opcode, 0)
            if not 0 < length <= limit:
                if limit:
                    found = f"expected 1 to {limit} bytes"
                    self._note(f"{_name(opcode)} of {length} bytes at byte {start} is damaged: {found}")
                file.seek(length, SEEK_CUR)
                continue
            # The library raises many kinds of errors for wrong bytes. Each means that the record is damaged.
            try:
                found_records = self._unpack(opcode, file.read(length))
            except Exception as error:
                reason = str(error) or repr(error)
                self._note(f"{_name(opcode)} of {length} bytes at byte {start} is damaged: {reason}")
                continue
            yield start, opcode, found_records

    def glance(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield offset, opcode and first bytes of each record in the file, without unpacking it."""
        self.damage = []
        with self._open() as file:
            for start, opcode, length in self._heads(file):
                yield start, opcode, file.read(min(length, _GLANCE))
                file.seek(start + HEAD.size + length)

    def summary(self) -> Iterator[tuple[int, bytes]]:
        """Yield kind and content of the schemas, channels and statistics in the summary; nothing if there is none.

        Of the index of a chunk, only that it is there.

        The summary is all that follows the end of the data, where the last reading came to it. Raises ValueError if the
        file does not end like an MCAP file, if messages follow the end of the data, or if the summary is too large.
        """
        with self._open() as file:
            file.seek(max(0, self.size - len(MAGIC) - FOOTER.size - HEAD.size))
            end = file.read()
            head = HEAD.unpack_from(end) if len(end) == HEAD.size + FOOTER.size + len(MAGIC) else (0, 0)
            if head != (Opcode.FOOTER, FOOTER.size) or not end.endswith(MAGIC):
                raise ValueError("its end is no end of an MCAP file")
            at, footer = self._behind_data, self.size - len(end)
            room = _LARGEST_SUMMARY
            while at + HEAD.size <= footer:
                file.seek(at)
                opcode, length = HEAD.unpack(file.read(HEAD.size))
                if opcode in (Opcode.MESSAGE, Opcode.CHUNK):
                    raise ValueError("it holds messages behind the end of its data")
                if opcode in (Opcode.STATISTICS, *_DEFINED):
                    room -= length
                    if room < 0:
                        raise ValueError(f"its summary is larger than {_LARGEST_SUMMARY} bytes")
                    yield opcode, file.read(length)
                elif opcode == Opcode.CHUNK_INDEX:
                    yield opcode, b""
                at += HEAD.size + length
            if at != footer:
                raise ValueError("its summary does not lead to its end")

    def _compare(self, count: int) -> None:
        """Compare the number of messages that were read with the statistics of the summary."""
        try:
            for opcode, content in self.summary():
                if opcode == Opcode.STATISTICS:
                    stated = Statistics.read(ReadDataStream(BytesIO(content))).message_count
                    if stated != count:
                        self._note(f"its summary states {stated} messages, there are {count}")
        except Exception as error:  # the library raises many kinds of errors for wrong bytes
            self._note(f"its summary cannot be compared with what is there: {str(error) or repr(error):.100}")

    def _note(self, text: str) -> None:
        add_sentence(self.damage, text)

    def _heads(self, file: BinaryIO) -> Iterator[tuple[int, int, int]]:
        """Yield offset, opcode and length of each record, up to the end of the data or of the file."""
        file.seek(len(MAGIC))
        while True:
            self.position = start = file.tell()
            head = file.read(HEAD.size)
            if not head:
                self._note("the recording was not closed: it ends without a summary")
                return
            opcode, length = HEAD.unpack(head) if len(head) == HEAD.size else (0, self.size)
            if length > self.size - start - HEAD.size:
                self._note(f"the recording was cut off: its last {self.size - start} bytes are an incomplete record")
                return
            if not opcode:
                self._note(f"its last {self.size - start} bytes, from byte {start} on, are zeros or no records")
                return
            if opcode == Opcode.DATA_END:
                self.position, self._behind_data = self.size, start + HEAD.size + length
                return
            yield start, opcode, length

    def _unpack(self, opcode: int, payload: bytes) -> Iterable[Any]:
        """Return the records in the payload. Any exception means that it is damaged."""
        if opcode == Opcode.MESSAGE:
            return [_message(payload, 0, len(payload))]
        if opcode == Opcode.CHUNK:
            return self._in_chunk(*self._unpack_chunk(payload))
        if opcode == Opcode.ATTACHMENT:
            checksum = zlib.crc32(memoryview(payload)[:-4])
            if int.from_bytes(payload[-4:], "little") not in (0, checksum):
                raise ValueError("its checksum is wrong")
        record = _DECODERS[opcode](ReadDataStream(BytesIO(payload)))
        if opcode in _DEFINED:
            self._in_force.add(opcode, record.id, len(payload))
        return [record]

    def _unpack_chunk(self, payload: bytes) -> tuple[bytes, int]:
        """Return the records of a chunk, and the bytes that they had been packed into."""
        _, _, size, checksum = CHUNK_HEAD.unpack_from(payload)
        if size > LARGEST_CHUNK:
            raise ValueError(f"it claims {size} bytes")
        at = CHUNK_HEAD.size
        at += 4 + int.from_bytes(payload[at : at + 4], "little")
        length = int.from_bytes(payload[at : at + 8], "little")
        packed = payload[at + 8 : at + 8 + length]
        if len(packed) < length:
            raise ValueError(f"{len(packed)} of its {length} bytes are there")
        data, whole = self._unpacker.unpack(packed)
        if checksum and zlib.crc32(data) != checksum:
            raise ValueError("its checksum is wrong")
        if not checksum and not (whole and len(data) == size):
            raise ValueError(f"{len(data)} of its {size} unpacked bytes are there")
        return data, len(packed)

    def _in_chunk(self, data: bytes, packed: int) -> Iterator[Any]:
        """Return the records of a chunk, after a check of all. The messages in it are made one by one."""
        definitions: dict[int, Any] = {}
        end = 0
        for opcode, begin, end in records(data, packed):
            if opcode == Opcode.MESSAGE:
                if end - begin < MESSAGE.size:
                    raise ValueError(f"a message of {end - begin} bytes is none")
            elif opcode in _DEFINED:
                if end - begin > _LARGEST[opcode] or len(definitions) >= _DEFINITIONS:
                    raise ValueError("its schemas and channels are too large or too many")
                if end <= len(data):
                    (definitions[begin],) = self._unpack(opcode, data[begin:end])
        if end > len(data):
            raise ValueError("a record in it is cut off")
        return self._yield(data, packed, definitions)

    def _yield(self, data: bytes, packed: int, definitions: dict[int, Any]) -> Iterator[Any]:
        for opcode, begin, end in records(data, packed):
            if opcode == Opcode.MESSAGE:
                yield _message(data, begin, end)
            elif begin in definitions:
                yield definitions[begin]


def _message(data: bytes, begin: int, end: int) -> Message:
    if end - begin < MESSAGE.size:
        raise ValueError(f"a message of {end - begin} bytes is none")
    channel_id, sequence, log_time, publish_time = MESSAGE.unpack_from(data, begin)
    return Message(channel_id, sequence, log_time, publish_time, data[begin + MESSAGE.size : end])


_DEFINED: Final = (Opcode.SCHEMA, Opcode.CHANNEL)

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

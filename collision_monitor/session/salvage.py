"""Recovers what is whole in an MCAP file that was cut off, overwritten or has flipped bits.

Nothing of the file is believed that cannot be checked: a chunk counts where its checksum is right. Of a chunk that the
end of the file cuts, all complete messages count: what is there of it is as it was written.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from enum import IntEnum
from io import BytesIO
from pathlib import Path
from typing import Any, Final

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Metadata, Schema, Statistics
from mcap.writer import Writer

from collision_monitor._version import VERSION
from collision_monitor.errors import SessionError
from collision_monitor.session.reader import SALVAGE

MAGIC: Final = b"\x89MCAP0\r\n"
LARGEST: Final = 1 << 30
"""Bytes of an unpacked chunk; what claims more is damaged."""

_HEAD: Final = struct.Struct("<BQ")
_CHUNK: Final = struct.Struct("<QQQI")  # start time, end time, unpacked size, checksum
_MESSAGE: Final = struct.Struct("<HIQQ")  # channel, sequence, log time, publish time
_LENGTH: Final = struct.Struct("<I")
_LONG: Final = struct.Struct("<Q")
_CANDIDATE: Final = re.compile(rb"[\x01-\x0f].{5}\x00\x00\x00", re.DOTALL)
"""Where a record may begin: a known opcode, and a length below 2^40."""

_PIECE: Final = 1 << 12
"""Bytes that a damaged chunk is unpacked by: what comes before the damage is had to this."""


_DECLARING: Final = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.STATISTICS)
"""What counts behind the end of the data too."""


@dataclass
class Salvaged:
    """What came of it. losses: one sentence for each, in the order of the file; empty: it was whole and is copied.

    unverified: how many of the messages have no right checksum to show that they are as they were written.
    """

    messages: int = 0
    unverified: int = 0
    topics: dict[str, int] = field(default_factory=dict)
    losses: list[str] = field(default_factory=list)


class Trust(IntEnum):
    """How far a record can be believed."""

    NONE = 0  # in a chunk whose checksum is wrong
    WHOLE = 1  # complete, and without a checksum: outside of chunks, or in one that is cut off
    CHECKED = 2  # in a chunk whose checksum is right


@dataclass(frozen=True)
class _Part:
    """A record of the file, from a chunk or by itself."""

    opcode: int
    payload: bytes
    trust: Trust


def salvage(source: str | Path, target: str | Path, *, unverified: bool = False, overwrite: bool = False) -> Salvaged:
    """Copy every complete message of `source` into the new file `target`, with its topic, type, times and sequence.

    unverified: also messages of chunks whose checksum is wrong; some of their bytes may be. Raises SessionError where
    nothing can be recovered, or where `target` exists and is not to be overwritten.
    """
    source, target = Path(source), Path(target)
    try:
        if source.exists() and target.exists() and source.samefile(target):
            raise SessionError(f"{target}: expected another file than the one that is salvaged")
        with source.open("rb") as file:
            if source.stat().st_size == 0:
                raise SessionError(f"{source}: expected an MCAP file, but the file is empty")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as data:
                return _copy(data, source, target, unverified, overwrite)
    except OSError as error:
        raise SessionError(f"{error.filename or source}: expected a file, got: {error.strerror}") from None


def _copy(data: mmap.mmap, source: Path, target: Path, unverified: bool, overwrite: bool) -> Salvaged:
    result = Salvaged()
    schemas, channels, expected, count = _declarations(data, result)
    if not count:
        raise SessionError(
            f"{source}: expected the messages of an MCAP file, found none that is whole; {'; '.join(result.losses[:3])}"
        )
    with target.open("wb" if overwrite else "xb") as stream:
        writer = Writer(stream)
        writer.start(profile="ros2", library=f"collision_monitor {VERSION} salvage")
        schema_ids = {i: writer.register_schema(s.name, s.encoding, s.data) for i, s in sorted(schemas.items())}
        channel_ids: dict[int, int] = {}
        for i, c in sorted(channels.items()):
            channel_ids[i] = writer.register_channel(
                c.topic, c.message_encoding, schema_ids.get(c.schema_id, 0), c.metadata
            )
        nameless = 0
        next_sequence: int | None = None
        for part in _parts(data, Salvaged()):
            if part.opcode == Opcode.METADATA:
                metadata = _read(Metadata, part.payload)
                if metadata is not None:
                    writer.add_metadata(metadata.name, metadata.metadata)
            if part.opcode != Opcode.MESSAGE or (part.trust is Trust.NONE and not unverified):
                continue
            channel, sequence, log_time, publish_time = _MESSAGE.unpack_from(part.payload)
            if channel not in channel_ids:
                nameless += 1
                continue
            if next_sequence is not None and 0 < sequence - next_sequence < 1 << 31:
                result.losses.append(f"messages {next_sequence} to {sequence - 1} are not there")
            next_sequence = sequence + 1
            writer.add_message(channel_ids[channel], log_time, part.payload[_MESSAGE.size :], publish_time, sequence)
            topic = channels[channel].topic
            result.messages += 1
            result.unverified += part.trust is not Trust.CHECKED
            result.topics[topic] = result.topics.get(topic, 0) + 1
        if nameless:
            result.losses.append(f"{nameless} messages whose topic is not known any more")
        for i, number in sorted(expected.items()):
            topic = channels[i].topic if i in channels else f"channel {i}"
            missing = number - result.topics.get(topic, 0)
            if missing > 0:
                result.losses.append(f"{missing} of the {number} messages of {topic}, as the file's summary has them")
        if result.losses:
            writer.add_metadata(SALVAGE, {"source": source.name, "losses": "\n".join(result.losses)})
        writer.finish()  # type: ignore[no-untyped-call]
    return result


def _declarations(
    data: mmap.mmap, result: Salvaged
) -> tuple[dict[int, Schema], dict[int, Channel], dict[int, int], int]:
    """Schemas and channels from wherever they are, the summary's counts of messages, and how many there are."""
    schemas: dict[int, Schema] = {}
    channels: dict[int, Channel] = {}
    trust: dict[tuple[int, int], Trust] = {}  # by opcode and id: the best copy counts
    expected: dict[int, int] = {}
    count = 0
    for part in _parts(data, result):
        match part.opcode:
            case Opcode.SCHEMA | Opcode.CHANNEL:
                record = _read(Schema if part.opcode == Opcode.SCHEMA else Channel, part.payload)
                key = (part.opcode, 0 if record is None else record.id)
                if record is None or part.trust <= trust.get(key, -1):
                    continue
                if isinstance(record, Schema) and record.name:
                    schemas[record.id] = record
                    trust[key] = part.trust
                elif isinstance(record, Channel) and record.topic and record.message_encoding:
                    channels[record.id] = record
                    trust[key] = part.trust
            case Opcode.STATISTICS:
                statistics = _read(Statistics, part.payload)
                if statistics is not None:
                    expected = statistics.channel_message_counts
            case Opcode.MESSAGE:
                count += 1
    return schemas, channels, expected, count


def _read(kind: Any, payload: bytes) -> Any:
    """The record of that kind, or None where the bytes are not one."""
    try:
        return kind.read(ReadDataStream(BytesIO(payload)))
    except Exception:  # whatever the library raises for bytes that are not as they should be
        return None


# -- the file, record by record


def _parts(data: mmap.mmap, result: Salvaged) -> Iterator[_Part]:
    """All records that are whole, those of chunks one by one; losses are noted in the result."""
    at = len(MAGIC)
    if data[:at] != MAGIC:
        result.losses.append(f"the file begins with {data[:at]!r}, not as an MCAP file does")
        at = 0
    closed = False
    while at < len(data):
        if closed and data[at:] == MAGIC:
            return
        record = _record(data, at)
        if record is None:
            following = _next_record(data, at + 1)
            if not closed:
                result.losses.append(f"{following - at} bytes from byte {at} on are damaged or incomplete")
            yield from _cut_chunk(data, at, following, result)
            at = following
            continue
        opcode, payload, end = record
        if opcode == Opcode.CHUNK:
            yield from _chunk(payload, at, result)
        elif opcode == Opcode.DATA_END:
            closed = True
        elif opcode in _DECLARING or (not closed and (opcode != Opcode.MESSAGE or len(payload) >= _MESSAGE.size)):
            yield _Part(opcode, payload, Trust.WHOLE)
        at = end
    if not closed:
        result.losses.append("the file was not closed: what came after its last byte is not known")


def _record(data: mmap.mmap, at: int) -> tuple[int, bytes, int] | None:
    """Opcode, payload and end of the record at a place, or None where there is none that is whole.

    A chunk's own lengths are believed before that of its record, if its checksum is right.
    """
    if at + _HEAD.size > len(data):
        return None
    opcode, length = _HEAD.unpack_from(data, at)
    begin = at + _HEAD.size
    if opcode == Opcode.CHUNK:
        end = _chunk_end(data, begin)
        if end is not None and end != begin + length and _unpacked(data[begin:end])[1]:
            return opcode, data[begin:end], end
    if not 1 <= opcode <= Opcode.DATA_END or length > len(data) - begin:
        return None
    return opcode, data[begin : begin + length], begin + length


def _chunk_end(data: mmap.mmap, begin: int) -> int | None:
    """Where the chunk ends by its own lengths, if that is in the file."""
    at = begin + _CHUNK.size
    if at + _LENGTH.size > len(data):
        return None
    (name,) = _LENGTH.unpack_from(data, at)
    at += _LENGTH.size + name
    if name > 8 or at + _LONG.size > len(data):
        return None
    (size,) = _LONG.unpack_from(data, at)
    at += _LONG.size
    return at + int(size) if size <= len(data) - at else None


def _next_record(data: mmap.mmap, at: int) -> int:
    """The next place where a record begins that another one, or the end, follows; the end where there is none."""
    for match in _CANDIDATE.finditer(data, at):
        record = _record(data, match.start())
        if record is None:
            continue
        opcode, payload, end = record
        if opcode == Opcode.CHUNK and _unpacked(payload)[1]:
            return match.start()
        if opcode != Opcode.CHUNK and _plausible(opcode, payload) and (end == len(data) or _record(data, end)):
            return match.start()
    return len(data)


def _plausible(opcode: int, payload: bytes) -> bool:
    """Whether a record found among other bytes is one: it reads as its kind does, to its last byte."""
    kinds: dict[int, Any] = {
        Opcode.SCHEMA: Schema,
        Opcode.CHANNEL: Channel,
        Opcode.METADATA: Metadata,
        Opcode.STATISTICS: Statistics,
    }
    if opcode in kinds:
        stream = ReadDataStream(BytesIO(payload))
        with suppress(Exception):
            kinds[opcode].read(stream)
            return stream.count == len(payload)
        return False
    if opcode == Opcode.MESSAGE:
        # years 2001 to 2100, or a simulation's time
        return len(payload) > _MESSAGE.size and _MESSAGE.unpack_from(payload)[2] < 1 << 62
    return opcode in (Opcode.MESSAGE_INDEX, Opcode.DATA_END) and len(payload) < 1 << 24


# -- chunks


def _chunk(payload: bytes, at: int, result: Salvaged) -> Iterator[_Part]:
    """The records of a chunk."""
    records, verified = _unpacked(payload)
    parts = list(_inner(records, Trust.CHECKED if verified else Trust.NONE))
    if not verified:
        messages = sum(part.opcode == Opcode.MESSAGE for part in parts)
        result.losses.append(
            f"the chunk of {len(payload)} bytes at byte {at} has a wrong checksum: {messages} messages in it are "
            "complete and cannot be trusted"
        )
    yield from parts


def _cut_chunk(data: mmap.mmap, at: int, end: int, result: Salvaged) -> Iterator[_Part]:
    """The complete records of a chunk that the end of the file cuts off."""
    begin = at + _HEAD.size
    if end < len(data) or begin + _CHUNK.size > len(data) or data[at] != Opcode.CHUNK:
        return
    parts = list(_inner(_unpacked(data[begin:end])[0], Trust.WHOLE))
    messages = sum(part.opcode == Opcode.MESSAGE for part in parts)
    if messages:
        result.losses.append(f"of the chunk that is cut off at byte {at}, {messages} messages are complete and kept")
    yield from parts


def _unpacked(payload: bytes) -> tuple[bytes, bool]:
    """A chunk's records, as far as they can be unpacked, and whether they are all there and as they were written."""
    try:
        _, _, size, checksum = _CHUNK.unpack_from(payload)
        (name,) = _LENGTH.unpack_from(payload, _CHUNK.size)
        at = _CHUNK.size + _LENGTH.size
        compression = payload[at : at + min(name, 8)]
        at += name + _LONG.size
    except struct.error:
        return b"", False
    if size > LARGEST or name > 8 or at > len(payload):
        return b"", False
    records = _decompressed(compression, payload[at:], size)
    whole = len(records) == size and (checksum == 0 or zlib.crc32(records) == checksum)
    return records, whole


def _decompressed(compression: bytes, packed: bytes, size: int) -> bytes:
    """As much as can be unpacked, at most `size` bytes."""
    if compression == b"":
        return packed[:size]
    if compression not in (b"zstd", b"lz4"):
        return b""
    unpacker: Any = (
        zstandard.ZstdDecompressor().decompressobj() if compression == b"zstd" else lz4.frame.LZ4FrameDecompressor()
    )
    out = bytearray()
    with suppress(zstandard.ZstdError, RuntimeError, EOFError):
        for begin in range(0, len(packed), _PIECE):
            out += unpacker.decompress(packed[begin : begin + _PIECE])
            if len(out) > size:
                break
    return bytes(out[:size])


def _inner(records: bytes, trust: Trust) -> Iterator[_Part]:
    """The complete records in the bytes of a chunk."""
    at = 0
    while at + _HEAD.size <= len(records):
        opcode, length = _HEAD.unpack_from(records, at)
        at += _HEAD.size
        if opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE) or length > len(records) - at:
            return
        if opcode != Opcode.MESSAGE or length >= _MESSAGE.size:
            yield _Part(opcode, records[at : at + length], trust)
        at += length

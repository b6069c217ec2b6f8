"""Walks an MCAP file that was cut off, overwritten or has flipped bits, from one whole record to the next.

The content of nearly every record also determines its length. The walk accepts a record if both lengths agree. It
accepts a chunk if its checksum is right, even if the head of its record is damaged. Everything else is damage, behind
which the walk searches for the next record. It examines each place a bounded number of times, and compares each length
with the size of the file before it uses it.
"""

from __future__ import annotations

import mmap
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import Final

from mcap.opcode import Opcode

from collision_monitor.session.mcap.chunk import ChunkLimitError, Unpacker, records
from collision_monitor.session.mcap.layout import CHUNK_HEAD, FIELDS, HEAD, MAGIC, MESSAGE, OPCODES

_EFFORT: Final = 8
"""Bound of the work on places that might be chunks and are none, as a multiple of the file's size."""

_CANDIDATE: Final = re.compile(rb"[\x01-\x0f](?=.{5}\x00\x00\x00)", re.DOTALL)
"""Start of a possible record: a known opcode, and a length below 2^40."""

_MISTAKABLE: Final = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA_INDEX)
"""Opcodes that a flipped bit turns into the opcode of a message."""

_IN_CHUNKS: Final = (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE)


class Trust(IntEnum):
    """How far a record can be trusted."""

    NONE = 0  # in a chunk with a wrong checksum
    WHOLE = 1  # complete, but without a checksum: outside of chunks, or in a chunk that is cut off or has none
    CHECKED = 2  # in a chunk with a right checksum


class Section(IntEnum):
    """The part of the file that holds a record."""

    DATA = 0  # outside of chunks
    CHUNK = 1
    SUMMARY = 2  # behind the end of the data


@dataclass(frozen=True, slots=True)
class RecoveredRecord:
    """A record that was found in the file."""

    opcode: int
    payload: bytes
    trust: Trust
    section: Section


@dataclass(frozen=True, slots=True)
class Damage:
    """A part of the file that is not as it was written. text: describes it, without its losses."""

    text: str


@dataclass(frozen=True, slots=True)
class _RecordSpan:
    opcode: int
    begin: int  # of the payload
    end: int


def walk(data: mmap.mmap) -> Iterator[RecoveredRecord | Damage]:
    """Yield all whole records in the order of the file, those of chunks one by one, and the damage between them."""
    at = len(MAGIC)
    if data[:at] != MAGIC:
        yield Damage(f"the file begins with {data[:at]!r}, not as an MCAP file does")
        at = 0
    closed = chunked = False
    effort = _EFFORT * len(data)
    unpacker = Unpacker(len(data))
    while at < len(data):
        if closed and _is_end(data, at):
            return
        record = _record(data, at)
        if record is None or record.opcode not in OPCODES:
            chunk, spent = _chunk_at(data, at, unpacker) if effort > 0 else (None, 0)
            effort -= spent
            record = chunk or record
        following = len(data) if record is None else record.end
        if record is None or (record.opcode == Opcode.MESSAGE and not _is_message(data, record, chunked)):
            cut = _is_cut_chunk(data, at)
            following = len(data) if cut else _next_record(data, at + 1)
            # a message before damage is kept, unless its length reaches beyond the begin of the next record
            if record is None or record.end > following or not _only_a_message(data, record, chunked):
                if not closed:
                    yield Damage(f"{following - at} bytes from byte {at} on are damaged or incomplete")
                    if cut:
                        yield from _cut_chunk(data, at, unpacker)
                at = following
                continue
            following = record.end
        if record.opcode == Opcode.CHUNK:
            chunked = True
            yield from _chunk(data[record.begin : record.end], at, unpacker)
        elif record.opcode not in OPCODES:
            yield Damage(f"a record of unknown kind {record.opcode}, {record.end - at} bytes at byte {at}, is left out")
        elif record.opcode in (Opcode.DATA_END, Opcode.FOOTER):
            closed = True
        elif record.opcode != Opcode.MESSAGE or not closed:
            section = Section.SUMMARY if closed else Section.DATA
            yield RecoveredRecord(record.opcode, data[record.begin : record.end], Trust.WHOLE, section)
        at = following
    if not closed:
        yield Damage("the file was not closed: what came after its last byte is not known")


# -- one record


def _record(data: mmap.mmap, at: int) -> _RecordSpan | None:
    """Return the record at an offset if it is whole and its content agrees with its length."""
    if at + HEAD.size > len(data):
        return None
    opcode, length = HEAD.unpack_from(data, at)
    if opcode in OPCODES:
        return _known(data, at)
    # a kind that only a newer or private writer knows: skip it if a known record follows
    end = at + HEAD.size + int(length)
    return _RecordSpan(opcode, at + HEAD.size, end) if opcode and end < len(data) and _known(data, end) else None


def _known(data: mmap.mmap, at: int) -> _RecordSpan | None:
    """Return the record at an offset if it is whole and of a known kind."""
    if at + HEAD.size > len(data):
        return None
    opcode, length = HEAD.unpack_from(data, at)
    begin = at + HEAD.size
    if length > len(data) - begin:
        return None
    whole = length >= MESSAGE.size if opcode == Opcode.MESSAGE else _own_length(data, opcode, begin) == length
    return _RecordSpan(opcode, begin, begin + length) if whole else None


def _own_length(data: mmap.mmap, opcode: int, begin: int) -> int | None:
    """Return the length of the record by its content (bytes); None if it exceeds the file."""
    at = begin
    for size in FIELDS.get(opcode, (len(data),)):
        if size < 0:
            length = int.from_bytes(data[at : at - size], "little")
            at += length - size
        else:
            at += size
        if at > len(data):
            return None
    return at - begin


def _is_message(data: mmap.mmap, record: _RecordSpan, chunked: bool) -> bool:
    """Return whether a record with the opcode of a message is one and another record follows it."""
    return _only_a_message(data, record, chunked) and _leads_on(data, record.end, 0)


def _only_a_message(data: mmap.mmap, record: _RecordSpan, chunked: bool) -> bool:
    """Return whether it cannot be another record whose opcode has a flipped bit."""
    others = (*_MISTAKABLE, Opcode.MESSAGE_INDEX) if chunked else _MISTAKABLE
    return all(_own_length(data, other, record.begin) != record.end - record.begin for other in others)


def _leads_on(data: mmap.mmap, at: int, steps: int) -> bool:
    """Return whether a record and `steps` more follow here, or the end of the file."""
    record = _known(data, at)
    if record is None:
        return at == len(data) or _is_end(data, at)
    return steps == 0 or _leads_on(data, record.end, steps - 1)


def _is_end(data: mmap.mmap, at: int) -> bool:
    return at == len(data) - len(MAGIC) and data[at:] == MAGIC


def _next_record(data: mmap.mmap, at: int) -> int:
    """Return the next offset of a record that others or the end follow; the size of the file if there is none."""
    for match in _CANDIDATE.finditer(data, at):
        record = _known(data, match.start())
        # the content of a message does not show its length, so two more records have to follow it
        if record is not None and _leads_on(data, record.end, int(record.opcode == Opcode.MESSAGE)):
            return match.start()
    return len(data)


# -- chunks


def _chunk_at(data: mmap.mmap, at: int, unpacker: Unpacker) -> tuple[_RecordSpan | None, int]:
    """Return the chunk here if its checksum is right, even if its opcode or a length is wrong; else the bytes spent."""
    begin = at + HEAD.size
    if begin + CHUNK_HEAD.size > len(data):
        return None, 0
    spent = 0
    for size in (_own_length(data, Opcode.CHUNK, begin), int(HEAD.unpack_from(data, at)[1])):
        if size is not None and size <= len(data) - begin:
            if _is_checked(data[begin : begin + size], unpacker):
                return _RecordSpan(Opcode.CHUNK, begin, begin + size), 0
            spent += size
    return None, spent


def _is_checked(payload: bytes, unpacker: Unpacker) -> bool:
    try:
        return _unpacked(payload, unpacker)[1] is Trust.CHECKED
    except ValueError:
        return False


def _chunk(payload: bytes, at: int, unpacker: Unpacker) -> Iterator[RecoveredRecord | Damage]:
    """Yield the records of a chunk."""
    what = f"the chunk of {len(payload)} bytes at byte {at}"
    try:
        data, trust = _unpacked(payload, unpacker)
        messages = _messages(data, len(payload))
    except ValueError as error:
        yield Damage(f"{what} is left out: {error}")
        return
    if trust is Trust.NONE:
        yield Damage(f"{what} is not as it was written: {messages} messages in it are complete and cannot be trusted")
    yield from _inner(data, trust, len(payload))


def _is_cut_chunk(data: mmap.mmap, at: int) -> bool:
    """Return whether a chunk begins here that, by both of its lengths, the end of the file cuts off."""
    sizes = at + HEAD.size + CHUNK_HEAD.size
    if sizes + 4 > len(data) or data[at] != Opcode.CHUNK:
        return False
    name = int.from_bytes(data[sizes : sizes + 4], "little")
    if name > 8 or sizes + 12 + name > len(data):
        return False
    size = int.from_bytes(data[sizes + 4 + name : sizes + 12 + name], "little")
    length = int(HEAD.unpack_from(data, at)[1])
    return length == CHUNK_HEAD.size + 12 + name + size and at + HEAD.size + length > len(data)


def _cut_chunk(data: mmap.mmap, at: int, unpacker: Unpacker) -> Iterator[RecoveredRecord | Damage]:
    """Yield the complete records of a cut chunk, because its remaining bytes are as they were written."""
    payload = data[at + HEAD.size :]
    try:
        found, _ = _unpacked(payload, unpacker)
        messages = _messages(found, len(payload))
    except ValueError as error:
        yield Damage(f"the chunk that is cut off at byte {at} is left out: {error}")
        return
    if messages:
        yield Damage(f"of the chunk that is cut off at byte {at}, {messages} messages are complete and kept")
    yield from _inner(found, Trust.WHOLE, len(payload))


def _unpacked(payload: bytes, unpacker: Unpacker) -> tuple[bytes, Trust]:
    """Return a chunk's records as far as they can be unpacked, and how far they can be trusted. Raises ValueError."""
    try:
        _, _, size, checksum = CHUNK_HEAD.unpack_from(payload)
        (name,) = struct.unpack_from("<I", payload, CHUNK_HEAD.size)
    except struct.error:
        return b"", Trust.NONE
    begin = CHUNK_HEAD.size + 4 + name + 8
    if name > 8 or begin > len(payload):
        return b"", Trust.NONE
    data, whole = unpacker.unpack(payload[begin:])
    if not whole:
        return data, Trust.NONE
    if checksum and zlib.crc32(data) == checksum:
        return data, Trust.CHECKED
    return data, Trust.WHOLE if checksum == 0 and len(data) == size else Trust.NONE


def _messages(data: bytes, packed: int) -> int:
    """Return the number of complete messages in the bytes of a chunk. Raises ChunkLimitError."""
    return sum(opcode == Opcode.MESSAGE for opcode, _, _ in _complete(data, packed))


def _inner(data: bytes, trust: Trust, packed: int) -> Iterator[RecoveredRecord]:
    """Yield the complete records in the bytes of a chunk."""
    for opcode, begin, end in _complete(data, packed):
        yield RecoveredRecord(opcode, data[begin:end], trust, Section.CHUNK)


def _complete(data: bytes, packed: int) -> Iterator[tuple[int, int, int]]:
    """Yield the complete records in the bytes of a chunk, up to the first that is none. Raises ChunkLimitError."""
    try:
        for opcode, begin, end in records(data, packed):
            if end > len(data):
                return
            if opcode in _IN_CHUNKS and (opcode != Opcode.MESSAGE or end - begin >= MESSAGE.size):
                yield opcode, begin, end
    except ChunkLimitError:
        raise
    except ValueError:
        return  # opcode 0

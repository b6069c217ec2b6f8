"""Writes MCAP: messages in zstd chunks with their indexes, and a summary at the end.

Source: the MCAP specification, version 0 (mcap.dev/spec). The library's mcap.writer is not used because it holds
Python's lock, which the recorder's thread shares with the monitor, for 5 µs for each message. Here NumPy does the work
of many messages at a time, and packing, checksums and writing need no lock.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, BinaryIO, Final

import numpy as np
import zstandard
from mcap.opcode import Opcode
from numpy.typing import NDArray

from collision_monitor.session.mcap.layout import (
    CHUNK_HEAD,
    FOOTER,
    HEAD,
    MAGIC,
    MESSAGE,
    MESSAGE_HEAD,
    SPAN,
    STATISTICS,
    SUMMARY_OFFSET,
    TIMES,
)

_CHUNK_BYTES: Final = 8 << 20
"""Bytes of a chunk before it is packed. rosbag2 uses 1 MiB, but each chunk takes Python's lock from the monitor several
times, independent of its size, and a recorder that flushes four times a second ends most chunks sooner."""

_COMPRESSION: Final = "zstd"
_LEVEL: Final = -1
"""Compression level: on sessions 1.7 to 2.2 times as fast as zstd's default, 3, for files 1 % larger."""

Numbers = NDArray[Any]
_NO_MESSAGES: Final = (np.empty(0, np.uint16), np.empty(0, np.uint64), np.empty(0, np.uint64))


@dataclass
class _Chunk:
    """A chunk being filled. index: channels, log times and offsets of its messages."""

    parts: list[bytes] = field(default_factory=list)
    size: int = 0
    index: list[tuple[Numbers, Numbers, Numbers]] = field(default_factory=list)


class McapWriter:
    """Writer of one MCAP file. Raises OSError if the stream fails.

    counts: messages of each channel; begin, end: first and last log time (ns). They cover the flushed messages only.
    """

    def __init__(self, stream: BinaryIO, *, profile: str, library: str) -> None:
        self._stream = stream
        self._at = 0
        self._chunk = _Chunk()
        self._pack = zstandard.ZstdCompressor(_LEVEL).compress
        self._schemas: list[bytes] = []
        self._channels: list[bytes] = []
        self._chunk_indexes: list[bytes] = []
        self._attachment_indexes: list[bytes] = []
        self._metadata_indexes: list[bytes] = []
        self.counts: dict[int, int] = {}
        self.begin = self.end = 0
        self._put(MAGIC)
        self._put(_record(Opcode.HEADER, _text(profile), _text(library)))

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Write a metadata record behind all messages so far."""
        self._close_chunk()
        record = _record(Opcode.METADATA, _text(name), _text_map(values))
        self._metadata_indexes.append(_record(Opcode.METADATA_INDEX, SPAN.pack(self._at, len(record)), _text(name)))
        self._put(record)

    def add_schema(self, name: str, encoding: str, data: bytes) -> int:
        """Add a schema and return its id."""
        number = len(self._schemas) + 1
        parts = (struct.pack("<H", number), _text(name), _text(encoding), struct.pack("<I", len(data)), data)
        self._schemas.append(_record(Opcode.SCHEMA, *parts))
        self._add(self._schemas[-1])
        return number

    def add_channel(self, topic: str, encoding: str, schema: int, metadata: Mapping[str, str]) -> int:
        """Add a channel and return its id."""
        number = len(self._channels)
        parts = (struct.pack("<HH", number, schema), _text(topic), _text(encoding), _text_map(metadata))
        self._channels.append(_record(Opcode.CHANNEL, *parts))
        self._add(self._channels[-1])
        self.counts[number] = 0
        return number

    def add_messages(
        self,
        channels: Sequence[int],
        data: Sequence[bytes],
        log_times: Sequence[int],
        publish_times: Sequence[int],
        sequences: Sequence[int],
    ) -> None:
        """Add messages; each sequence has one element for each. Times in ns; log times must not decrease."""
        if not data:
            return
        heads = np.empty(len(data), MESSAGE_HEAD)
        sizes = np.fromiter(map(len, data), np.int64, len(data))
        heads["opcode"], heads["length"] = Opcode.MESSAGE, sizes + MESSAGE.size
        heads["channel"] = channels
        for name, values in (("sequence", sequences), ("log_time", log_times), ("publish_time", publish_times)):
            heads[name] = np.fromiter(values, np.uint64, len(data))
        records = [b""] * (2 * len(data))  # head, data, head, data …
        records[0::2] = heads.view(f"V{MESSAGE_HEAD.itemsize}").tolist()
        records[1::2] = data
        ends = np.cumsum(sizes + MESSAGE_HEAD.itemsize)
        begins = np.concatenate([[0], ends[:-1]])
        done = 0
        while done < len(data):  # each pass takes as many messages as fill the chunk
            chunk, at = self._chunk, int(begins[done])
            stop = min(len(data), 1 + int(np.searchsorted(ends, at + _CHUNK_BYTES - chunk.size)))
            these = heads[done:stop]
            offsets = (begins[done:stop] + (chunk.size - at)).astype(np.uint64)
            chunk.index.append((these["channel"], these["log_time"], offsets))
            chunk.parts += records[2 * done : 2 * stop]
            chunk.size += int(ends[stop - 1]) - at
            if chunk.size >= _CHUNK_BYTES:
                self._close_chunk()
            done = stop

    def add_attachment(self, name: str, media_type: str, data: bytes, log_time: int) -> None:
        """Write an attachment, which is a file within the file, behind all messages so far."""
        self._close_chunk()
        times, size = TIMES.pack(log_time, 0), struct.pack("<Q", len(data))  # 0: the creation time is unknown
        names = _text(name) + _text(media_type)
        content = b"".join((times, names, size, data))
        record = _record(Opcode.ATTACHMENT, content, struct.pack("<I", zlib.crc32(content)))
        span = SPAN.pack(self._at, len(record))
        self._attachment_indexes.append(_record(Opcode.ATTACHMENT_INDEX, span, times, size, names))
        self._put(record)

    def flush(self) -> None:
        """Hand everything to the operating system."""
        self._close_chunk()
        self._stream.flush()

    def finish(self) -> None:
        """Write the summary."""
        self._close_chunk()
        self._put(_record(Opcode.DATA_END, bytes(4)))  # without a checksum: the chunks have theirs
        counts = [(number, count) for number, count in self.counts.items() if count]
        statistics = STATISTICS.pack(
            sum(self.counts.values()), len(self._schemas), len(self._channels),
            len(self._attachment_indexes), len(self._metadata_indexes), len(self._chunk_indexes), self.begin, self.end,
        )  # fmt: skip
        groups = {
            Opcode.SCHEMA: self._schemas,
            Opcode.CHANNEL: self._channels,
            Opcode.STATISTICS: [_record(Opcode.STATISTICS, statistics, _number_map(counts))],
            Opcode.CHUNK_INDEX: self._chunk_indexes,
            Opcode.ATTACHMENT_INDEX: self._attachment_indexes,
            Opcode.METADATA_INDEX: self._metadata_indexes,
        }
        summary, offsets = b"", b""
        for opcode, records in groups.items():
            if records:
                group = b"".join(records)
                offset = SUMMARY_OFFSET.pack(opcode, self._at + len(summary), len(group))
                offsets += _record(Opcode.SUMMARY_OFFSET, offset)
                summary += group
        footer = _record(Opcode.FOOTER, FOOTER.pack(self._at, self._at + len(summary), 0))
        checked = summary + offsets + footer[:-4]  # all but the checksum itself
        self._put(checked + struct.pack("<I", zlib.crc32(checked)) + MAGIC)
        self._stream.flush()

    def _put(self, data: bytes) -> None:
        self._stream.write(data)
        self._at += len(data)

    def _add(self, record: bytes) -> None:
        self._chunk.parts.append(record)
        self._chunk.size += len(record)

    def _close_chunk(self) -> None:
        chunk, self._chunk = self._chunk, _Chunk()
        if not chunk.size:
            return
        records = b"".join(chunk.parts)
        packed = self._pack(records)
        columns = zip(_NO_MESSAGES, *chunk.index, strict=True)
        channels, log_times, offsets = (np.concatenate(column) for column in columns)
        begin, end = (int(log_times[0]), int(log_times[-1])) if len(log_times) else (0, 0)
        head = CHUNK_HEAD.pack(begin, end, chunk.size, zlib.crc32(records))
        fields = b"".join((head, _text(_COMPRESSION), struct.pack("<Q", len(packed))))
        start = self._at
        self._put(HEAD.pack(Opcode.CHUNK, len(fields) + len(packed)) + fields)
        self._put(packed)  # written apart from the fields, because joining them would copy it
        after = self._at
        if len(channels):
            self.begin = self.begin if any(self.counts.values()) else begin
            self.end = end
        indexes = []
        for channel in np.flatnonzero(np.bincount(channels)).tolist():
            indexes.append((channel, self._at))
            its = channels == channel
            rows = np.stack([log_times[its], offsets[its]], axis=1, dtype="<u8").tobytes()
            self._put(_record(Opcode.MESSAGE_INDEX, struct.pack("<HI", channel, len(rows)), rows))
            self.counts[channel] += len(rows) // 16
        self._chunk_indexes.append(
            _record(
                Opcode.CHUNK_INDEX,
                TIMES.pack(begin, end),
                SPAN.pack(start, after - start),
                _number_map(indexes),
                struct.pack("<Q", self._at - after),
                _text(_COMPRESSION),
                struct.pack("<QQ", len(packed), chunk.size),
            )
        )


def _record(opcode: int, *parts: bytes) -> bytes:
    content = b"".join(parts)
    return HEAD.pack(opcode, len(content)) + content


def _text(text: str) -> bytes:
    raw = text.encode("utf-8")
    return struct.pack("<I", len(raw)) + raw


def _text_map(values: Mapping[str, str]) -> bytes:
    raw = b"".join(_text(key) + _text(value) for key, value in values.items())
    return struct.pack("<I", len(raw)) + raw


def _number_map(pairs: list[tuple[int, int]]) -> bytes:
    """Encode a map uint16 -> uint64."""
    raw = b"".join(struct.pack("<HQ", *pair) for pair in pairs)
    return struct.pack("<I", len(raw)) + raw

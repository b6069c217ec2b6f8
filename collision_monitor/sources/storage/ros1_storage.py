"""A bag of ROS 1, version 2.0, read from its records; its index is only compared with them.

Source: http://wiki.ros.org/Bags/Format/2.0. A record is a head of named fields, then data, each behind its length.
"""

from __future__ import annotations

import bz2
import os
import struct
from collections import Counter
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, BinaryIO, Final

import lz4.frame  # type: ignore[import-untyped]

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.chunk import CHUNK_BYTES, FILE_BYTES, LARGEST_CHUNK, RATIO
from collision_monitor.settings.regular_file import open_regular
from collision_monitor.sources.ros1_messages import ROS1, ros2_name
from collision_monitor.sources.storage.stored_channel import LATEST, StoredChannel, StoredMessage, damaged_bag
from collision_monitor.sources.storage.time_order import TimeOrder

ROS1_MAGIC: Final = b"#ROSBAG V2.0\n"

_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7

_LENGTH: Final = struct.Struct("<I")
_POSITION: Final = struct.Struct("<Q")
_TIME: Final = struct.Struct("<II")
_PAIR: Final = struct.Struct("<II")

_LARGEST_HEAD: Final = 1 << 20
"""Bytes of the fields of a record. The longest is the definition of a type, which has 50 KB."""

_LARGEST_DATA: Final = LARGEST_CHUNK

_MOST_FIELDS: Final = 100
_MOST_CONNECTIONS: Final = 100_000

_REINDEX: Final = "; `rosbag reindex` makes its index anew"

Fields = dict[bytes, bytes]


class Ros1Storage:
    """A file of ROS 1. Raises SessionError if it is damaged, or if its index states other numbers of messages."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._order = TimeOrder(path)
        self._channels: dict[int, StoredChannel] = {}
        self._stated: Counter[int] = Counter()
        with self._open() as file:
            self._size = os.fstat(file.fileno()).st_size
            self._left = max(FILE_BYTES, RATIO * self._size)
            try:
                self._scan(file)
            except (ValueError, KeyError, IndexError, struct.error, OSError, EOFError, RuntimeError) as error:
                raise SessionError(damaged_bag(path, _reason(error))) from None
        for key, channel in self._channels.items():
            channel.stated = self._stated[key]
        self.channels = list(self._channels.values())

    def messages(self, keys: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the messages of these connections in order of time, those of one time in that of the file."""
        with self._open() as file:

            def read(begin: int) -> Iterator[StoredMessage | None]:
                file.seek(begin)
                for fields, data in self._in_chunk(*_record(file, self._size - begin)):
                    if fields[b"op"][0] == _MESSAGE and (time := _nanoseconds(fields[b"time"])) <= LATEST:
                        key = _number(fields[b"conn"])
                        yield StoredMessage(key, time, data) if key in keys else None

            yield from self._order.merged(read)

    def close(self) -> None:
        """Do nothing: the file is open only while messages are read."""

    def _open(self) -> BinaryIO:
        return open_regular(self._path, "a bag", refused=SessionError)

    def _scan(self, file: BinaryIO) -> None:
        """Count the messages of each connection, note where they are, and read the index."""
        file.seek(len(ROS1_MAGIC))
        fields, _ = _record(file, self._size - len(ROS1_MAGIC))
        if fields[b"op"][0] != _BAG:
            raise ValueError("it does not begin with the head of a bag")
        if fields.get(b"encryptor"):
            raise ValueError("it is encrypted")
        if not _POSITION.unpack(fields[b"index_pos"])[0]:
            raise ValueError(f"the recording was not closed: it has no index{_REINDEX}")
        stated, chunks = _number(fields[b"chunk_count"]), 0
        while (begin := file.tell()) < self._size:
            fields, data = _record(file, self._size - begin)
            kind = fields[b"op"][0]
            if kind == _CHUNK:
                chunks += 1
                self._count(begin, fields, data)
            elif kind == _CONNECTION:
                self._define(fields, data)
            elif kind == _CHUNK_INFO:
                self._stated.update(dict(_PAIR.iter_unpack(data)))
            elif kind not in (_INDEX, _BAG):
                raise ValueError(f"a record of kind {kind} at byte {begin}")
        if chunks != stated:
            raise ValueError(f"its head states {stated} chunks, there are {chunks}{_REINDEX}")
        if unknown := self._stated.keys() - self._channels.keys():
            raise ValueError(f"its index has messages of {len(unknown)} connections that are not there{_REINDEX}")

    def _count(self, begin: int, fields: Fields, data: bytes) -> None:
        readable = []
        for inner, content in self._in_chunk(fields, data):
            if inner[b"op"][0] == _CONNECTION:
                self._define(inner, content)
            elif inner[b"op"][0] == _MESSAGE:
                key = _number(inner[b"conn"])
                channel = self._channels.get(key)
                if channel is None:
                    raise ValueError(f"a message of a connection that is not there, in the chunk at byte {begin}")
                time = _nanoseconds(inner[b"time"])
                channel.count += 1
                channel.readable += time <= LATEST
                if time <= LATEST:
                    readable.append((key, time))
        self._order.add(begin, readable)
        self._left -= _number(fields[b"size"])
        if self._left < 0:
            raise ValueError("its chunks unpack to more than its size justifies")

    def _define(self, fields: Fields, data: bytes) -> None:
        more = _fields(data)
        topic = fields[b"topic"].decode("utf-8", "replace")
        found = StoredChannel(
            _number(fields[b"conn"]),
            topic if topic.startswith("/") else f"/{topic}",
            ros2_name(more[b"type"].decode("utf-8", "replace")),
            ROS1,
            more[b"message_definition"].decode("utf-8", "replace"),
            "ros1msg",
        )
        if len(self._channels) >= _MOST_CONNECTIONS:
            raise ValueError(f"it has more than {_MOST_CONNECTIONS} connections")
        known = self._channels.setdefault(found.key, found)
        if (known.topic, known.type) != (found.topic, found.type):
            known.problem = f"the file defines its connection {found.key} a second time, as {found.topic}"

    def _in_chunk(self, fields: Fields, data: bytes) -> Iterator[tuple[Fields, bytes]]:
        """Yield the records of a chunk."""
        whole = self._unpacked(fields[b"compression"], data, _number(fields[b"size"]))
        at = 0
        while at < len(whole):
            head, at = _sized(whole, at)
            content, at = _sized(whole, at)
            yield _fields(head), content

    def _unpacked(self, compression: bytes, data: bytes, size: int) -> bytes:
        """Return the bytes of a chunk. Raises ValueError if they are not as many as it states, or beyond the limits."""
        limit = min(max(CHUNK_BYTES, RATIO * len(data)), LARGEST_CHUNK)
        if size > limit:
            raise ValueError(f"a chunk of {len(data)} bytes states {size} unpacked bytes, more than {limit}")
        unpacker: Any
        match compression:
            case b"none":
                out = data
            case b"bz2":
                unpacker = bz2.BZ2Decompressor()
                out = unpacker.decompress(data, max_length=size + 1)
            case b"lz4":
                unpacker = lz4.frame.LZ4FrameDecompressor()
                out = unpacker.decompress(data, max_length=size + 1)
            case _:
                raise ValueError(f"a chunk is packed by {compression[:40]!r}, and not by bz2 or lz4")
        if len(out) != size:
            raise ValueError(
                f"a chunk states {size} unpacked bytes, and has {len(out)}{' or more' * (len(out) > size)}"
            )
        return out


def _record(file: BinaryIO, left: int) -> tuple[Fields, bytes]:
    """Read a record. left: bytes of the file from here on. Raises ValueError if it is cut off."""
    head = _read(file, _LARGEST_HEAD, left)
    data = _read(file, _LARGEST_DATA, left - len(head) - _LENGTH.size)
    return _fields(head), data


def _read(file: BinaryIO, most: int, left: int) -> bytes:
    at = file.tell()
    head = file.read(_LENGTH.size)
    length = _LENGTH.unpack(head)[0] if len(head) == _LENGTH.size else left
    if length > min(most, left - _LENGTH.size):
        raise ValueError(f"a record at byte {at} is cut off, or no record{_REINDEX}")
    return file.read(length)


def _sized(data: bytes, at: int) -> tuple[bytes, int]:
    begin = at + _LENGTH.size
    end = begin + _LENGTH.unpack_from(data, at)[0]
    if end > len(data):
        raise ValueError("a record in a chunk is cut off")
    return data[begin:end], end


def _fields(head: bytes) -> Fields:
    found: Fields = {}
    at = 0
    while at < len(head):
        field, at = _sized(head, at)
        name, equals, value = field.partition(b"=")
        if not equals or len(found) >= _MOST_FIELDS:
            raise ValueError(f"a field {field[:40]!r} without a value, or too many of them")
        found[name] = value
    return found


def _number(value: bytes) -> int:
    return int(_LENGTH.unpack(value)[0])


def _nanoseconds(value: bytes) -> int:
    seconds, rest = _TIME.unpack(value)
    return int(seconds) * 1_000_000_000 + int(rest)


def _reason(error: Exception) -> str:
    if isinstance(error, KeyError):
        return f"a record has no field {error}"
    return str(error) or type(error).__name__

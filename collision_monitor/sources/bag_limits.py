"""Limits of a bag, compared before the library rosbags opens it, because rosbags unpacks whatever a bag claims."""

from __future__ import annotations

import re
import sqlite3
import struct
from collections.abc import Iterator
from contextlib import closing
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final

import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, ChunkIndex

from collision_monitor.errors import InputError, SessionError
from collision_monitor.session.mcap.chunk import CHUNK_BYTES, FILE_BYTES, LARGEST_CHUNK, RATIO, Unpacker, records
from collision_monitor.session.mcap.layout import CHUNK_HEAD, FOOTER, HEAD, MAGIC
from collision_monitor.settings.yaml_file import parse_yaml, read_yaml

_QUALITY: Final = "offered_qos_profiles"
"""Key of a channel's metadata whose text rosbags reads as YAML."""

_QUALITY_VALUES: Final = 2000
"""Values in such a text. One publisher has 15 and rosbags reads 5,000 in a second."""

_QUALITY_BYTES: Final = 1 << 20
"""Bytes of all such texts of a bag: those of 3,000 topics."""

_METADATA_VALUES: Final = 50_000
"""Values in metadata.yaml: those of 1,000 topics and 1,000 files."""

_NO_TABLE: Final = re.compile(r"(?i)\bas\b|\bvirtual\b|\bview\b|\btrigger\b")
"""What no table of rosbag2 is made with: they are views, or have columns that are computed."""


def check_bag(path: Path) -> None:
    """Compare a bag with the limits. Raises SessionError with what exceeds them."""
    try:
        if not path.is_dir():
            _check_file(path)
            return
        content = read_yaml(path / "metadata.yaml", aliases=True, nodes=_METADATA_VALUES)
        table = content.get("rosbag2_bagfile_information") if isinstance(content, dict) else None
        names = table.get("relative_file_paths") if isinstance(table, dict) else None
        for topic in (table or {}).get("topics_with_message_count") or ():
            text = topic["topic_metadata"].get(_QUALITY)
            if isinstance(text, str):
                parse_yaml(text, f"{path}: {_QUALITY}", aliases=True, nodes=_QUALITY_VALUES)
        for name in names if isinstance(names, list) else ():
            file = path / Path(str(name)).name
            if file.is_file():
                _check_file(file)
    except InputError as error:
        raise SessionError(f"{error}; expected a bag of rosbag2") from None
    except SessionError:
        raise
    except OSError as error:
        raise SessionError(f"{path}: expected a bag that can be read, got: {error.strerror or error}") from None
    except Exception as error:  # the libraries raise many kinds of errors for wrong bytes
        reason = str(error) or type(error).__name__
        raise SessionError(f"{path}: expected a bag of rosbag2, cannot be read: {reason}{salvage_hint(path)}") from None


def salvage_hint(path: Path) -> str:
    """Return what an error adds about a bag that cannot be read, if it begins like an MCAP: others hold nothing."""
    try:
        with path.open("rb") as file:
            begins = file.read(len(MAGIC)) == MAGIC
    except OSError:
        begins = False
    return "; `collision-monitor salvage` recovers its complete messages" if begins else ""


def unpack_message(data: bytes, topic: str) -> bytes:
    """Unpack a message that the bag compressed by itself. Raises SessionError beyond the limits."""
    size = zstandard.frame_content_size(data)
    limit = min(max(CHUNK_BYTES, RATIO * len(data)), LARGEST_CHUNK)
    if not 0 <= size <= limit:
        raise SessionError(f"{topic}: expected a message of at most {limit} unpacked bytes, got {size}")
    return zstandard.ZstdDecompressor().decompress(data)


def _check_file(path: Path) -> None:
    with path.open("rb") as file:
        if path.suffix == ".zstd":
            _check_packed(path, file)
        elif path.suffix == ".mcap" and file.read(len(MAGIC)) == MAGIC:
            _Mcap(path, file).check()
    if path.suffix == ".db3":
        with closing(sqlite3.connect(f"{path.resolve().as_uri()}?mode=ro", uri=True)) as connection:
            for kind, text in connection.execute("SELECT type, sql FROM sqlite_master LIMIT 1000"):
                if kind not in ("table", "index") or _NO_TABLE.search(str(text or "")):
                    raise ValueError(f"a {kind} that rosbag2 does not make: {str(text)[:80]!r}")


def _check_packed(path: Path, file: BinaryIO) -> None:
    limit = max(FILE_BYTES, RATIO * path.stat().st_size)
    unpacked = zstandard.ZstdDecompressor().stream_reader(file, read_across_frames=True)
    size = 0
    while piece := unpacked.read(1 << 20):
        size += len(piece)
        if size > limit:
            raise ValueError(f"it unpacks to more than {limit} bytes")


class _Mcap:
    """The parts of an MCAP file that rosbags unpacks: its chunks, as its records and its index show them."""

    def __init__(self, path: Path, file: BinaryIO) -> None:
        self._file = file
        self._size = path.stat().st_size
        self._path = path
        self._chunks: set[int] = set()
        self._unpacker = Unpacker(self._size)
        self._channels: set[bytes] = set()
        self._quality = 0  # bytes of all texts

    def check(self) -> None:
        """Raises ValueError, InputError."""
        for start, opcode, length in self._heads(len(MAGIC)):
            if opcode == Opcode.CHUNK:
                self._chunks.add(start)
                self._check_chunk(self._file.read(length))
            elif opcode == Opcode.CHANNEL:
                self._check_channel(self._file.read(length))
        self._file.seek(max(self._size - len(MAGIC) - FOOTER.size, 0))
        foot = self._file.read(FOOTER.size)
        summary = FOOTER.unpack(foot)[0] if len(foot) == FOOTER.size else 0
        for _, opcode, length in self._heads(summary) if summary else ():
            if opcode == Opcode.CHANNEL:
                self._check_channel(self._file.read(length))
            elif opcode == Opcode.CHUNK_INDEX:
                index = ChunkIndex.read(ReadDataStream(BytesIO(self._file.read(length))))
                if index.chunk_start_offset not in self._chunks:
                    raise ValueError(f"its index repeats or invents the chunk at byte {index.chunk_start_offset}")
                self._chunks.remove(index.chunk_start_offset)

    def _heads(self, at: int) -> Iterator[tuple[int, int, int]]:
        """Yield offset, opcode and length of each record from here to the end of the file."""
        while at + HEAD.size <= self._size - len(MAGIC):
            self._file.seek(at)
            opcode, length = HEAD.unpack(self._file.read(HEAD.size))
            if not opcode or length > self._size - at - HEAD.size:
                raise ValueError(f"no record at byte {at}")
            yield at, opcode, length
            if opcode == Opcode.FOOTER:
                return
            at += HEAD.size + length

    def _check_chunk(self, payload: bytes) -> None:
        at = CHUNK_HEAD.size
        (name,) = struct.unpack_from("<I", payload, at)
        (length,) = struct.unpack_from("<Q", payload, at + 4 + name)
        begin = at + 12 + name
        data, _ = self._unpacker.unpack(payload[begin : begin + length])
        for opcode, start, end in records(data, length):
            if opcode == Opcode.CHANNEL:
                self._check_channel(data[start:end])

    def _check_channel(self, payload: bytes) -> None:
        if payload in self._channels:
            return
        channel: Any = Channel.read(ReadDataStream(BytesIO(payload)))
        text = channel.metadata.get(_QUALITY, "")
        self._channels.add(payload)
        self._quality += len(text)
        if self._quality > _QUALITY_BYTES:
            raise ValueError(f"the quality of service of its topics takes more than {_QUALITY_BYTES} bytes")
        parse_yaml(text, f"{self._path}: {_QUALITY} of {channel.topic}", aliases=True, nodes=_QUALITY_VALUES)

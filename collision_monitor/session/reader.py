"""Reads a session in the order in which it was written, also one whose end is missing or that was damaged.

Only the order of the file is used, no index: a session that was cut off by a crash reads as far as it goes.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any, BinaryIO, Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from collision_monitor.errors import ProfileError, SessionError
from collision_monitor.profiles import Profile
from collision_monitor.session.recorder import METADATA
from collision_monitor.session.rosbag2 import TYPES, full_name

SALVAGE: Final = "collision_monitor_salvage"
"""Name of the metadata record that says what is missing in a file that was salvaged."""

_MAGIC: Final = b"\x89MCAP0\r\n"
_HEAD: Final = struct.Struct("<BQ")
_LARGEST_CHUNK: Final = 1 << 30
"""Bytes, unpacked. rosbag2 writes less than 1 MiB; what claims more than this is damaged."""

_NAMES: Final = {full_name(name): name for name in TYPES}


@dataclass(frozen=True, slots=True)
class Recorded:
    """One message: its topic, the name of its type such as `ContactArray`, and its bytes. Times in ns."""

    topic: str
    type: str
    data: bytes
    sequence: int
    log_time: int
    publish_time: int


class Session:
    """A recorded session.

    metadata, profile, frame_id: of the monitor that was recorded.
    damage: what is missing or broken, one sentence each; complete when all messages have been read.
    position, size: bytes of the file that were read, and all.
    Raises SessionError for what is no session, naming what it is.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.damage: list[str] = []
        self.position = 0
        self._file = _find(self.path)
        try:
            self.size = self._file.stat().st_size
            self.metadata = self._read_metadata()
        except OSError as error:
            raise SessionError(f"{self.path}: expected a file that can be read, got: {error.strerror}") from None
        self.profile = self._profile()
        self.frame_id = self.metadata.get("frame_id", "")

    def messages(self) -> Iterator[Recorded]:
        """All messages whose bytes are whole, in recorded order. Raises SessionError for a foreign encoding."""
        self.damage = []
        schemas: dict[int, str] = {}
        channels: dict[int, Channel] = {}
        with self._file.open("rb") as file:
            for record in self._parsed(file):
                if isinstance(record, Schema):
                    schemas[record.id] = record.name
                elif isinstance(record, Channel):
                    self._check_encoding(record, schemas)
                    channels[record.id] = record
                elif isinstance(record, Metadata) and record.name == SALVAGE:
                    losses = record.metadata.get("losses", "").splitlines()
                    self.damage += [f"lost before it was salvaged: {loss}" for loss in losses]
                elif isinstance(record, Message) and record.channel_id in channels:
                    channel = channels[record.channel_id]
                    name = schemas.get(channel.schema_id, "")
                    yield Recorded(
                        topic=channel.topic,
                        type=_NAMES.get(name, name),
                        data=record.data,
                        sequence=record.sequence,
                        log_time=record.log_time,
                        publish_time=record.publish_time,
                    )

    # -- opening

    def _read_metadata(self) -> dict[str, str]:
        """The record at the file's start. Raises SessionError."""
        topics: set[str] = set()
        with self._file.open("rb") as file:
            magic = file.read(len(_MAGIC))
            if magic != _MAGIC:
                what = f"it begins with {magic!r}" if magic else "the file is empty"
                raise SessionError(f"{self.path}: expected an MCAP file, but {what}")
            file.seek(0)
            for record in self._parsed(file):
                if isinstance(record, Metadata) and record.name == METADATA:
                    return dict(record.metadata)
                if isinstance(record, Channel):
                    topics.add(record.topic)
        found = f"topics {', '.join(sorted(topics))}" if topics else "no topics"
        if self.damage:
            found += f" and damage ({self.damage[0]})"
        raise SessionError(
            f"{self.path}: expected a session of collision_monitor, got an MCAP file without its metadata, "
            f"with {found}; record one with `collision-monitor run --record PATH`"
        )

    def _profile(self) -> Profile:
        try:
            values = json.loads(self.metadata["profile"])
            if not isinstance(values, dict):
                raise ProfileError(f"profile: expected an object, got {values!r}")
            return Profile.from_dict(values)
        except KeyError:
            raise SessionError(f"{self.path}: expected a profile in the session's metadata, got none") from None
        except (ValueError, TypeError) as error:
            raise SessionError(f"{self.path}: the profile in the session's metadata cannot be used: {error}") from None

    def _check_encoding(self, channel: Channel, schemas: dict[int, str]) -> None:
        if schemas.get(channel.schema_id) in _NAMES and channel.message_encoding != "cdr":
            raise SessionError(
                f"{self.path}: expected messages of {channel.topic} encoded as cdr, got {channel.message_encoding!r}"
            )

    # -- the file's records

    def _parsed(self, file: BinaryIO) -> Iterator[Any]:
        """Schemas, channels, messages and metadata, from chunks as well; what is damaged is noted and left out."""
        for start, opcode, payload in self._records(file):
            # Whatever the library raises for bytes that are not as they should be: that record is damaged.
            try:
                records = _unpack(opcode, payload)
            except Exception as error:
                reason = str(error) or repr(error)
                self.damage.append(f"{_name(opcode)} of {len(payload)} bytes at byte {start} is damaged: {reason}")
                continue
            yield from records

    def _records(self, file: BinaryIO) -> Iterator[tuple[int, int, bytes]]:
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
    if opcode == Opcode.METADATA:
        return [Metadata.read(stream)]
    if opcode == Opcode.SCHEMA:
        return [Schema.read(stream)]
    if opcode == Opcode.CHANNEL:
        return [Channel.read(stream)]
    return []


def _name(opcode: int) -> str:
    try:
        return f"the {Opcode(opcode).name.lower()}"
    except ValueError:
        return f"a record of unknown kind {opcode}"


def _find(path: Path) -> Path:
    """The file, also of a folder that holds one. Raises SessionError."""
    if path.is_dir():
        files = sorted(path.glob("*.mcap"))
        if len(files) != 1:
            raise SessionError(f"{path}: expected a folder with one .mcap file, got {len(files)}")
        return files[0]
    if not path.is_file():
        raise SessionError(
            f"{path}: expected a session file, got {'no regular file' if path.exists() else 'nothing there'}"
        )
    return path

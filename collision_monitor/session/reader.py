"""Reads a session in the order in which it was written, even if its end is missing or it is damaged.

The reader uses the order of the file and no index, so that it reads a session up to the place where a crash cut it off.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Header, Metadata, Schema

from collision_monitor.alerts.rules import Rules
from collision_monitor.codec import (
    ObjectDescriptionArray,
    ObjectStateArray,
    ObjectTrajectoryArray,
    decode_descriptions,
    decode_states,
    decode_trajectories,
)
from collision_monitor.codec.older_messages import lacks_data, with_data
from collision_monitor.errors import InputError, MessageError, ProfileError, SessionError
from collision_monitor.pipeline.settings_event import RULES
from collision_monitor.session.mcap.layout import (
    LIBRARY,
    LOG_TIME,
    METADATA,
    NUMBER,
    RECORDING,
    REPEATED,
    SALVAGE,
    SNAPSHOT,
    TIMES,
)
from collision_monitor.session.mcap.record_reader import McapReader, Message
from collision_monitor.session.mcap.rosbag2 import INPUT_TYPES, RECORDED_TYPES, full_name
from collision_monitor.settings.profile import Profile
from collision_monitor.settings.regular_file import FOLDER, found_instead
from collision_monitor.settings.yaml_file import read_yaml

_SHORT_NAMES: Final = {full_name(name): name for name in RECORDED_TYPES}
_Inputs = ObjectStateArray | ObjectDescriptionArray | ObjectTrajectoryArray
_INPUT_DECODERS: Final[dict[str, Callable[[bytes], _Inputs]]] = dict(
    zip(INPUT_TYPES, (decode_states, decode_descriptions, decode_trajectories), strict=True)
)
_SNAPSHOT: Final = re.compile(re.escape(SNAPSHOT) + r"(\d{1,10})\.npz")


class Recorded(NamedTuple):
    """One message: its topic, the short name of its type such as `ContactArray`, and its bytes. Times in ns.

    repeated: the message only repeats the descriptions of the objects at the start of a file.
    """

    topic: str
    type: str
    data: bytes
    sequence: int
    log_time: int
    publish_time: int
    repeated: bool = False


class RecordedSnapshot(NamedTuple):
    """The monitor's state before message `sequence`, from `Snapshot.encode`. log_time: of the message before (ns)."""

    data: bytes
    sequence: int
    log_time: int


class SnapshotLocation(NamedTuple):
    """Position of a snapshot: index of the session's file and byte offset; its sequence number and log time (ns)."""

    file: int
    at: int
    sequence: int
    log_time: int


@dataclass(frozen=True)
class SessionSpan:
    """Log times of the first and the last message (ns; 0 if there is none), and the snapshots in order."""

    begin: int
    end: int
    snapshots: tuple[SnapshotLocation, ...]


class Session:
    """A recorded session: a file, or the folder of all files of one recording.

    metadata, profile, rules, frame_id: those of the recorded monitor. foreign: another program recorded the monitor's
    topics; then there is no metadata, the profile is `balanced`, and the messages are numbered in the order of reading.
    damage: one sentence for each missing or broken part; complete when all messages have been read.
    position, size: bytes read, and bytes in total.
    Raises SessionError, with what was found, if the path holds no session.
    """

    def __init__(self, path: str | Path) -> None:
        self.path = Path(path)
        self.damage: list[str] = []
        self._files = _in_order(self.path, [_RecordedFile(file) for file in _find(self.path)])
        self.size = sum(file.records.size for file in self._files)
        self.foreign = self._files[0].foreign
        self.metadata = self._files[0].metadata
        self.profile = Profile.named("balanced") if self.foreign else self._profile()
        self.rules = self._rules()
        self.frame_id = self.metadata.get("frame_id", "")

    @property
    def position(self) -> int:
        """Bytes read so far."""
        return sum(file.records.position for file in self._files)

    def messages(self) -> Iterator[Recorded]:
        """Yield all undamaged messages in recorded order. Raises SessionError for an encoding other than CDR."""
        return (each for each in self.entries() if isinstance(each, Recorded))

    def entries(self, begin: SnapshotLocation | None = None) -> Iterator[Recorded | RecordedSnapshot]:
        """Yield the messages and the snapshots between them, from the snapshot at `begin` on. Raises SessionError."""
        self.damage = [f"{name} is not there" for name in _absent(self.path)]
        last: int | None = None
        count = 0
        for number, file in enumerate(self._files):
            if begin is not None and number < begin.file:
                continue
            for each in file.entries(begin.at if begin is not None and number == begin.file else 0):
                if isinstance(each, Recorded):
                    if each.repeated and each.sequence == last:
                        continue  # the previous file already described these objects
                    last = each.sequence
                    if self.foreign:
                        each = each._replace(sequence=count)
                        count += 1
                        if each.type == "ParameterEvent":  # of any node, and its place may not show its time
                            each = each._replace(type=full_name(each.type))
                yield each
            prefix = f"{file.records.path.name}: " if len(self._files) > 1 else ""
            self.damage += [prefix + text for text in file.damage]

    def timeline(self) -> SessionSpan:
        """Return begin, end and the positions of the snapshots, without unpacking any message."""
        times: list[int] = []  # of first and last messages; a chunk without any has 0 for both
        snapshots: list[SnapshotLocation] = []
        for number, file in enumerate(self._files):
            for at, opcode, data in file.records.glance():
                if opcode == Opcode.CHUNK and len(data) >= TIMES.size:
                    times += TIMES.unpack_from(data) if any(TIMES.unpack_from(data)) else ()
                elif opcode in (Opcode.MESSAGE, Opcode.MESSAGE_INDEX) and len(data) >= LOG_TIME + TIMES.size:
                    times += TIMES.unpack_from(data, LOG_TIME)[:1]
                elif opcode == Opcode.ATTACHMENT and (found := _SNAPSHOT.search(data.decode("latin-1"))):
                    snapshots.append(SnapshotLocation(number, at, int(found[1]), *TIMES.unpack_from(data)[:1]))
        begin, end = min(times, default=0), max(times, default=0)
        return SessionSpan(begin, end, tuple(snapshots))

    def _rules(self) -> Rules:
        try:
            return Rules.parse(self.metadata.get(RULES, ""))
        except InputError as error:
            raise SessionError(f"{self.path}: the rules in the session's metadata cannot be used: {error}") from None

    def _profile(self) -> Profile:
        try:
            values = json.loads(self.metadata["profile"])
            if not isinstance(values, dict):
                raise ProfileError(f"profile: expected an object, got {values!r}")
            return Profile.from_dict(values)
        except KeyError:
            raise SessionError(f"{self.path}: expected a profile in the session's metadata, got none") from None
        except (ValueError, TypeError, RecursionError) as error:
            raise SessionError(f"{self.path}: the profile in the session's metadata cannot be used: {error}") from None


class _RecordedFile:
    """One file of a session. Raises SessionError."""

    def __init__(self, path: Path) -> None:
        self.records = McapReader(path)
        self.damage: list[str] = []
        self.foreign = False
        self.metadata = self._read_metadata()
        self.repeated = _number(self.metadata.get(REPEATED))
        self.number = _number(self.metadata.get(NUMBER))

    def entries(self, begin: int) -> Iterator[Recorded | RecordedSnapshot]:
        """Yield what `Session.entries` yields. begin: byte offset of the snapshot."""
        self.damage = []
        schemas: dict[int, str] = {}
        channels: dict[int, tuple[str, str]] = {}  # topic and type
        old_schemas, older = set[int](), set[int]()  # and channels, whose messages lack a field of today
        inputs: dict[str, str] = {}
        repeated = 0 if begin else self.repeated  # repeated messages come before the first snapshot
        for record in self.records.read(begin):
            if isinstance(record, Message):
                if record.channel_id in channels:
                    number, sequence, log_time, publish_time, data = record
                    if number in older:
                        data = _renewed(data)
                    yield Recorded(*channels[number], data, sequence, log_time, publish_time, repeated > 0)
                    repeated -= 1
            elif isinstance(record, Schema):
                schemas[record.id] = record.name
                if _SHORT_NAMES.get(record.name) == "ObjectDescriptionArray" and lacks_data(record.data):
                    old_schemas.add(record.id)
            elif isinstance(record, Channel):
                if record.schema_id in old_schemas:
                    older.add(record.id)
                self._check(record, schemas, inputs)
                name = schemas.get(record.schema_id, "")
                channels[record.id] = record.topic, _SHORT_NAMES.get(name, name)
            elif isinstance(record, Metadata) and record.name == SALVAGE:
                losses = record.metadata.get("losses", "").splitlines()
                self.damage += [f"lost before it was salvaged: {loss}" for loss in losses]
            elif isinstance(record, Attachment) and (found := _SNAPSHOT.fullmatch(record.name)):
                yield RecordedSnapshot(record.data, int(found[1]), record.log_time)
        self.damage += self.records.damage

    def _read_metadata(self) -> dict[str, str]:
        """Return the metadata at the file's start; of a foreign file, the frame of its inputs. Raises SessionError."""
        topics: dict[int, str] = {}
        schemas: dict[int, str] = {}
        inputs: dict[int, str] = {}
        ours = False
        unnamed = 0
        for record in self.records:
            if isinstance(record, Metadata) and record.name == METADATA:
                return dict(record.metadata)
            if isinstance(record, Header):
                ours = record.library.startswith(LIBRARY)  # then missing metadata was lost
            elif isinstance(record, Schema):
                schemas[record.id] = record.name
            elif isinstance(record, Channel):
                topics[record.id] = record.topic
                unnamed += record.schema_id not in schemas
                inputs[record.id] = _SHORT_NAMES.get(schemas.get(record.schema_id, ""), "")
            elif isinstance(record, Message) and not ours and inputs.get(record.channel_id) in _INPUT_DECODERS:
                try:
                    frame_id = _INPUT_DECODERS[inputs[record.channel_id]](record.data).frame_id
                except MessageError:
                    continue
                self.foreign = True
                return {"frame_id": frame_id or "world"}
        found = f"topics {', '.join(sorted(topics.values()))}" if topics else "no topics"
        if unnamed:
            found += f", {unnamed} of them without the schema that says what type their messages are"
        if self.records.damage:
            found += f" and damage ({self.records.damage[0]})"
        raise SessionError(
            f"{self.records.path}: expected a session of collision_monitor, got an MCAP file without its metadata, "
            f"with {found}; record one with `collision-monitor run --record PATH`, or make one of odometry, poses, "
            "transforms or markers with `collision-monitor import`"
        )

    def _check(self, channel: Channel, schemas: dict[int, str], inputs: dict[str, str]) -> None:
        """Check a channel. Raises SessionError for another encoding, or another monitor's inputs in a foreign file."""
        name = _SHORT_NAMES.get(schemas.get(channel.schema_id, ""), "")
        if name and channel.message_encoding != "cdr":
            raise SessionError(
                f"{self.records.path}: expected messages of {channel.topic} encoded as cdr, "
                f"got {channel.message_encoding!r}"
            )
        if self.foreign and name in INPUT_TYPES and inputs.setdefault(name, channel.topic) != channel.topic:
            raise SessionError(
                f"{self.records.path}: expected the inputs of one monitor, got {inputs[name]} and {channel.topic}; "
                "take one out with `collision-monitor import --node NAME`"
            )


def _renewed(data: bytes) -> bytes:
    """Return a message of descriptions with the field that it lacks; one that cannot be read as it is."""
    with suppress(MessageError):
        return with_data(data)
    return data


def _number(text: str | None) -> int:
    """Parse a number of our own metadata. A damaged number counts as 0."""
    return int(text) if text and text.isdecimal() else 0


def _find(path: Path) -> list[Path]:
    """Return the file, or the files of a folder in the order of the numbers in their names. Raises SessionError."""
    found = found_instead(path)
    if found == FOLDER:
        files = [file for file in path.glob("*.mcap") if not found_instead(file)]
        if not files:
            raise SessionError(f"{path}: expected a folder with .mcap files, got none in it")
        return sorted(files, key=lambda file: [(len(digits), digits) for digits in re.findall(r"\d+|\D+", file.stem)])
    if found:
        raise SessionError(f"{path}: expected a session file, got {found}")
    return [path]


def _absent(path: Path) -> list[str]:
    """Return the files that the folder's metadata.yaml lists and that are missing."""
    try:
        content = read_yaml(path / "metadata.yaml", aliases=True)
        names = content["rosbag2_bagfile_information"]["relative_file_paths"]
        return [str(name) for name in names if not (path / str(name)).exists()]
    except (InputError, OSError, ValueError, TypeError, KeyError):  # the file is not needed to read the session
        return []


def _in_order(path: Path, files: list[_RecordedFile]) -> list[_RecordedFile]:
    """Return the files of one recording in order. Raises SessionError if they belong to several recordings."""
    recordings = {file.metadata.get(RECORDING, "") for file in files}
    kinds = {file.foreign for file in files}
    if len(files) > 1 and (len(recordings) > 1 or len(kinds) > 1 or (recordings == {""} and kinds == {False})):
        names = ", ".join(file.records.path.name for file in files)
        raise SessionError(f"{path}: expected the files of one recording, got those of several; name one of {names}")
    return sorted(files, key=lambda file: file.number)

"""A recording of any program: an MCAP or SQLite file, the folder that `ros2 bag record` makes, or a bag of ROS 1.

What a recording holds besides the topics that are used does not decide whether it can be read. Of those topics, every
message is read, or an error states how many are missing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import ExitStack, suppress
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from types import TracebackType
from typing import Any

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.layout import MAGIC
from collision_monitor.settings.regular_file import FOLDER, found_instead, open_regular
from collision_monitor.sources.ground.source import RawMessage
from collision_monitor.sources.ros1_messages import ROS1, Ros1Converter
from collision_monitor.sources.storage.bag_folder import BagFolder, read_bag_folder
from collision_monitor.sources.storage.mcap_storage import SALVAGE_HINT, McapStorage
from collision_monitor.sources.storage.packed import ZSTD_MAGIC, unpack_file, unpack_message
from collision_monitor.sources.storage.ros1_storage import ROS1_MAGIC, Ros1Storage
from collision_monitor.sources.storage.sqlite_storage import SQLITE_MAGIC, SqliteStorage
from collision_monitor.sources.storage.stored_channel import Storage, StoredChannel, damaged_bag

_FORMATS: tuple[tuple[bytes, Callable[[Path], Storage]], ...] = (
    (MAGIC, McapStorage),
    (SQLITE_MAGIC, SqliteStorage),
    (ROS1_MAGIC, Ros1Storage),
)
"""How a file begins, and what reads it."""


class Bag:
    """An open bag. topics: topic -> type, such as `nav_msgs/msg/Odometry`. Raises SessionError if there is no bag."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._open_files = ExitStack()
        found = found_instead(path)
        if found not in ("", FOLDER):
            raise SessionError(f"{path}: expected a bag, got {found}")
        folder = read_bag_folder(path) if found == FOLDER else BagFolder((path,))
        self._counts = folder.counts
        try:
            self._storages = [self._storage(file) for file in folder.files]
        except BaseException:
            self.close()
            raise
        channels = [channel for storage in self._storages for channel in storage.channels]
        used = [channel for channel in channels if channel.count]
        self.topics: dict[str, str] = {}
        for channel in [*used, *channels]:  # of two types, one with messages counts
            self.topics.setdefault(channel.topic, channel.type)

    def messages(self, topics: Iterable[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics by the time of receipt, those of a split bag file by file.

        In a file whose clock was set back, they come run by run (`time_order.Runs`).

        Raises SessionError if some of them cannot be read, or are not there.
        """
        wanted = set(topics)
        self._check(wanted)
        for storage in self._storages:
            used = {each.key: each for each in storage.channels if each.topic in wanted and each.count}
            converters = {key: _converter(each) for key, each in used.items()} if used else {}
            if not used:
                continue
            try:
                for key, time, data in storage.messages(used.keys()):
                    yield RawMessage(used[key].topic, used[key].type, converters[key](data), time)
            except SessionError:
                raise
            except Exception as error:  # a file that changes meanwhile
                raise SessionError(damaged_bag(self.path, str(error) or type(error).__name__)) from None

    def definitions(self, topics: Iterable[str]) -> dict[str, Any]:
        """The definitions that the bag holds of the types of these topics, for `Decoder`.

        Raises SessionError if it holds different ones of a type.
        """
        from rosbags.typesys import get_types_from_idl, get_types_from_msg

        found: dict[str, Any] = {}
        wanted = set(topics)
        for channel in (each for storage in self._storages for each in storage.channels if each.topic in wanted):
            types: dict[str, Any] = {}
            with suppress(Exception):  # a definition that cannot be read; the types needed here are standard ones
                if not channel.definition.strip():
                    continue
                if channel.form == "ros2msg":
                    types = get_types_from_msg(channel.definition, channel.type)
                elif channel.form in ("ros2idl", "omgidl"):
                    types = get_types_from_idl(channel.definition)
            for name, (constants, fields) in types.items():
                if name in found and found[name][1] != fields:
                    raise SessionError(
                        f"{self.path}: expected one definition of {name}, got two, also by {channel.topic}"
                    )
                found[name] = constants, fields
        return found

    def close(self) -> None:
        """Close the files of the bag."""
        self._open_files.close()

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _storage(self, file: Path) -> Storage:
        """Open a file of the bag by its first bytes, and not by its name."""
        begin = _first_bytes(file)
        if begin.startswith(ZSTD_MAGIC):
            return self._unpacked(file)
        make = next((make for magic, make in _FORMATS if begin.startswith(magic)), None)
        if make is None:
            what = f"it begins with {begin!r}" if begin else "it is empty"
            raise SessionError(damaged_bag(file, f"expected MCAP, SQLite or ROS 1 (#ROSBAG V2.0), but {what}"))
        storage = make(file)
        self._open_files.callback(storage.close)
        return storage

    def _unpacked(self, file: Path) -> Storage:
        """Open a file that is packed as a whole."""
        try:
            copy = Path(self._open_files.enter_context(TemporaryDirectory())) / file.stem
            with copy.open("wb") as target:
                unpack_file(file, target)
            if _first_bytes(copy).startswith(ZSTD_MAGIC):
                raise SessionError(damaged_bag(file, "it is packed twice"))
            return self._storage(copy)
        except OSError as error:
            raise SessionError(f"{file}: expected room to unpack it, got: {error.strerror or error}") from None
        except SessionError as error:
            raise SessionError(str(error).replace(str(copy), str(file))) from None

    def _check(self, topics: set[str]) -> None:
        """Compare what the channels of topics hold with what can be read and what is stated. Raises SessionError."""
        for topic in sorted(topics):
            channels = [each for storage in self._storages for each in storage.channels if each.topic == topic]
            used = [each for each in channels if each.count]
            types = sorted({each.type for each in used})
            if len(types) > 1:
                raise SessionError(f"{self.path}: topic {topic} has messages of {' and '.join(types)}")
            for each in used:
                if each.problem:
                    raise SessionError(f"{self.path}: topic {topic} cannot be read: {each.problem}")
            there = sum(each.count for each in channels)
            readable = sum(each.readable for each in channels)
            if readable != there:
                raise SessionError(
                    f"{self.path}: expected {there} messages of {topic}, as there are, got {readable} that can be "
                    "read; the others have no time of receipt or no bytes"
                )
            for each in channels:
                if each.stated not in (None, each.count):
                    raise SessionError(
                        f"{self.path}: expected {each.stated} messages of {topic}, as the file's {each.stated_by} "
                        f"states, got {each.count}{_hint(self._storages)}"
                    )
            stated = self._counts.get(topic, there)
            if stated != there:
                raise SessionError(
                    f"{self.path}: expected {stated} messages of {topic}, as metadata.yaml states, got {there}; if the "
                    "files are right, `ros2 bag reindex` makes it anew"
                )


def _first_bytes(file: Path) -> bytes:
    with open_regular(file, "a bag", refused=SessionError) as stream:
        return stream.read(max(len(magic) for magic, _ in _FORMATS)) or b""


def _hint(storages: list[Storage]) -> str:
    """Return what an error adds about files of MCAP: those of other formats hold no more than what was read."""
    return SALVAGE_HINT if any(isinstance(each, McapStorage) for each in storages) else ""


def _converter(channel: StoredChannel) -> Callable[[bytes], bytes]:
    """Return what makes CDR of the messages of a channel."""
    if channel.encoding == ROS1:
        return Ros1Converter(channel.type, channel.definition)
    return partial(unpack_message, topic=channel.topic)

"""A rosbag2 recording of any program: an MCAP or SQLite file, or the folder that `ros2 bag record` makes.

The library rosbags reads it: it supports every storage, compression and version of the format.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from types import TracebackType
from typing import Any

from collision_monitor.errors import SessionError
from collision_monitor.sources.bag_limits import check_bag, salvage_hint, unpack_message
from collision_monitor.sources.ground.source import RawMessage


class Bag:
    """An open bag. topics: topic -> type, such as `nav_msgs/msg/Odometry`. Raises SessionError if there is no bag."""

    def __init__(self, path: Path) -> None:
        try:
            from rosbags.rosbag2 import Reader
        except ImportError:
            raise SessionError("reading other programs' bags needs rosbags, got none: pip install rosbags") from None
        self.path = path
        if not path.exists():
            raise SessionError(f"{path}: expected a bag, got nothing there")
        if path.is_dir() and not (path / "metadata.yaml").exists():
            raise SessionError(
                f"{path}: expected the folder of a bag, got one without metadata.yaml; "
                "name the .mcap file in it, or make it with `ros2 bag reindex`"
            )
        check_bag(path)
        try:
            self._reader = Reader(path)
            self._reader.open()
        except Exception as error:  # the library raises one for each kind of damage, and lets others through
            raise self._broken(error) from None
        self.topics: dict[str, str] = {}
        for connection in self._reader.connections:
            other = self.topics.setdefault(connection.topic, connection.msgtype)
            if other != connection.msgtype:
                self.close()
                raise SessionError(f"{path}: topic {connection.topic} has messages of {other} and {connection.msgtype}")
        self._packed = self._reader.compression_mode == "message"
        if self._packed:  # rosbags would unpack them without a limit
            storage = self._reader.storage
            storage.metadata = storage.metadata._replace(compression_mode=None)

    def messages(self, topics: Iterable[str]) -> Iterator[RawMessage]:
        """Yield the messages of these topics by the time of receipt. Raises SessionError if the bag is damaged."""
        wanted = set(topics)
        connections = [c for c in self._reader.connections if c.topic in wanted]
        if not connections:  # rosbags takes an empty list for all of them
            return
        try:
            for connection, log_time, data in self._reader.messages(connections):
                plain = unpack_message(data, connection.topic) if self._packed else data
                yield RawMessage(connection.topic, connection.msgtype, bytes(plain), log_time)
        except GeneratorExit:
            raise
        except SessionError:
            raise
        except Exception as error:
            raise self._broken(error) from None

    @property
    def definitions(self) -> dict[str, Any]:
        """The definitions that the bag holds, for `Decoder`."""
        from rosbags.interfaces import MessageDefinitionFormat
        from rosbags.typesys import get_types_from_idl, get_types_from_msg

        found: dict[str, Any] = {}
        for connection in self._reader.connections:
            definition = connection.msgdef
            with suppress(Exception):  # a bag may hold unreadable types; those needed here are standard ones
                if definition.format == MessageDefinitionFormat.MSG:
                    found |= get_types_from_msg(definition.data, connection.msgtype)
                elif definition.format == MessageDefinitionFormat.IDL:
                    found |= get_types_from_idl(definition.data)
        return found

    def close(self) -> None:
        """Close the files of the bag."""
        with suppress(Exception):
            self._reader.close()

    def __enter__(self) -> Bag:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _broken(self, error: Exception) -> SessionError:
        reason = str(error) or type(error).__name__
        hint = salvage_hint(self.path)
        return SessionError(f"{self.path}: expected a bag of rosbag2, cannot be read: {reason}{hint}")

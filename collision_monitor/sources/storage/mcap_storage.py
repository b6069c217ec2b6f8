"""A bag in an MCAP file, read from its records and not by its indexes, which may lack messages or invent them."""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.record_reader import McapReader, Message
from collision_monitor.sources.ros1_messages import ROS1, ros2_name
from collision_monitor.sources.storage.stored_channel import LATEST, StoredChannel, StoredMessage, damaged_bag
from collision_monitor.sources.storage.time_order import TimeOrder

SALVAGE_HINT: Final = "; `collision-monitor salvage` recovers its complete messages"


class McapStorage:
    """An MCAP file. Raises SessionError if it is damaged, or if its summary states other numbers of messages."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._reader = McapReader(path)
        self._order = TimeOrder(path)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, StoredChannel] = {}
        self._scan()
        if self._reader.damage:
            raise SessionError(damaged_bag(path, f"{self._reader.damage[0]}{SALVAGE_HINT}"))
        self._compare(self._read_summary())
        self.channels = list(self._channels.values())

    def messages(self, keys: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the messages of these channels in order of time, those of one time in that of the file."""
        with self._reader.opened() as file:

            def read(begin: int) -> Iterator[StoredMessage]:
                for each in self._reader.record_at(file, begin):
                    if isinstance(each, Message) and each.channel_id in keys and each.log_time <= LATEST:
                        yield StoredMessage(each.channel_id, each.log_time, each.data)

            yield from self._order.merged(read)

    def close(self) -> None:
        """Do nothing: the file is open only while messages are read."""

    def _scan(self) -> None:
        """Count the messages of each channel, and note where they are."""
        unknown = 0
        for begin, records in self._reader.sections():
            first = LATEST + 1
            for each in records:
                if isinstance(each, Message):
                    channel = self._channels.get(each.channel_id)
                    unknown += channel is None
                    if channel is not None:
                        channel.count += 1
                        channel.readable += each.log_time <= LATEST
                    first = min(first, each.log_time)
                elif isinstance(each, Schema):
                    self._schemas[each.id] = each
                elif isinstance(each, Channel):
                    self._define(each)
            if first <= LATEST:
                self._order.add(begin, first)
        if unknown:
            raise SessionError(
                damaged_bag(self._path, f"{unknown} messages are of channels that it does not define{SALVAGE_HINT}")
            )

    def _define(self, channel: Channel) -> None:
        schema = self._schemas.get(channel.schema_id)
        kind, form = (ros2_name(schema.name), schema.encoding) if schema is not None else ("", "")
        found = StoredChannel(channel.id, channel.topic, kind, channel.message_encoding, form=form)
        found.definition = schema.data.decode("utf-8", "replace") if schema is not None else ""
        if channel.message_encoding not in ("cdr", ROS1):
            found.problem = f"its messages are encoded as {channel.message_encoding!r:.40}, and not as cdr"
        elif not kind:
            found.problem = "the file does not say what type its messages have"
        known = self._channels.setdefault(channel.id, found)
        if (known.topic, known.type, known.encoding) != (found.topic, found.type, found.encoding):
            known.problem = f"the file defines its channel {channel.id} a second time, as {found.topic} ({found.type})"

    def _read_summary(self) -> Statistics | None:
        """Define the channels without messages, and return the statistics; None if there is no summary.

        Raises SessionError for a file that is cut off.
        """
        statistics: Statistics | None = None
        try:
            for opcode, content in self._reader.summary():
                stream = ReadDataStream(BytesIO(content))
                if opcode == Opcode.STATISTICS:
                    statistics = Statistics.read(stream)
                elif opcode == Opcode.SCHEMA:
                    schema = Schema.read(stream)
                    self._schemas.setdefault(schema.id, schema)
                elif (channel := Channel.read(stream)).id not in self._channels:
                    self._define(channel)
        except Exception as error:  # the library raises many kinds of errors for wrong bytes
            reason = str(error) or repr(error)
            raise SessionError(damaged_bag(self._path, f"{reason:.200}{SALVAGE_HINT}")) from None
        return statistics

    def _compare(self, statistics: Statistics | None) -> None:
        """Note what the statistics say of each channel, or compare the total if they do not name the channels."""
        if statistics is None:
            return
        stated = Counter(statistics.channel_message_counts)
        there = sum(channel.count for channel in self._channels.values())
        if stated.total() == statistics.message_count:
            for key, channel in self._channels.items():
                channel.stated = stated[key]
        elif statistics.message_count != there:
            raise SessionError(
                damaged_bag(
                    self._path,
                    f"its summary states {statistics.message_count} messages, there are {there}{SALVAGE_HINT}",
                )
            )

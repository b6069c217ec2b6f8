"""A bag in an MCAP file, read from its records and not by its indexes, which may lack messages or invent them.

What was read is compared with the statistics of the file. A file without them may have indexes of its chunks, which say
at least how many messages there were; and no chunk of it, or message outside of chunks, may be there twice.
"""

from __future__ import annotations

import hashlib
import struct
from array import array
from collections import Counter
from collections.abc import Collection, Iterator
from io import BytesIO
from pathlib import Path
from typing import Final

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Schema, Statistics
from numpy.typing import NDArray

from collision_monitor.errors import SessionError
from collision_monitor.session.mcap.record_reader import McapReader, Message
from collision_monitor.sources.ros1_messages import ROS1, ros2_name
from collision_monitor.sources.storage.stored_channel import LATEST, StoredChannel, StoredMessage, damaged_bag
from collision_monitor.sources.storage.time_order import TimeOrder

SALVAGE_HINT: Final = "; `collision-monitor salvage` recovers its complete messages"


_INDEX: Final = struct.Struct("<HI")
"""How the index of a chunk's messages of one channel begins: the channel, and the bytes of the entries behind."""

_ENTRY: Final = 16
"""Bytes of an entry: a time and an offset."""


class McapStorage:
    """An MCAP file. Raises SessionError if it is damaged, or if its summary states other numbers of messages."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._reader = McapReader(path)
        self._order = TimeOrder(path)
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, StoredChannel] = {}
        self._chunks: dict[int, Counter[int]] = {}  # by their offsets: messages of each channel
        self._indexed = 0  # chunks in the summary's index
        self._scan()
        if self._reader.damage:
            raise self._damaged(self._reader.damage[0])
        if (statistics := self._read_summary()) is not None:
            self._compare(statistics)
        else:
            self._compare_indexes()
        self._chunks.clear()
        self.channels = list(self._channels.values())

    def messages(self, keys: Collection[int]) -> Iterator[StoredMessage]:
        """Yield the messages of these channels in order of time, those of one time in that of the file."""
        with self._reader.opened() as file:

            def read(begin: int) -> Iterator[StoredMessage | None]:
                for each in self._reader.record_at(file, begin):
                    if isinstance(each, Message) and each.log_time <= LATEST:
                        wanted = each.channel_id in keys
                        yield StoredMessage(each.channel_id, each.log_time, each.data) if wanted else None

            yield from self._order.merged(read)

    def close(self) -> None:
        """Do nothing: the file is open only while messages are read."""

    def _scan(self) -> None:
        """Count the messages of each channel, and note where they are."""
        unknown = 0
        for begin, opcode, records in self._reader.sections():
            readable = []
            there: Counter[int] = Counter()
            for each in records:
                if isinstance(each, Message):
                    channel = self._channels.get(each.channel_id)
                    there[each.channel_id] += 1
                    unknown += channel is None
                    if channel is not None:
                        channel.count += 1
                        channel.readable += each.log_time <= LATEST
                    if each.log_time <= LATEST:
                        readable.append((each.channel_id, each.log_time))
                elif isinstance(each, Schema):
                    self._schemas[each.id] = each
                elif isinstance(each, Channel):
                    self._define(each)
            self._order.add(begin, readable)
            if opcode == Opcode.CHUNK:
                self._chunks[begin] = there
        if unknown:
            raise self._damaged(f"{unknown} messages are of channels that it does not define")

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
                if opcode == Opcode.CHUNK_INDEX:
                    self._indexed += 1
                elif opcode == Opcode.STATISTICS:
                    statistics = Statistics.read(stream)
                elif opcode == Opcode.SCHEMA:
                    schema = Schema.read(stream)
                    self._schemas.setdefault(schema.id, schema)
                elif (channel := Channel.read(stream)).id not in self._channels:
                    self._define(channel)
        except Exception as error:  # the library raises many kinds of errors for wrong bytes
            reason = str(error) or repr(error)
            raise self._damaged(f"{reason:.200}") from None
        return statistics

    def _compare(self, statistics: Statistics) -> None:
        """Note what the statistics say of each channel, or compare the total if they do not name the channels."""
        stated = Counter(statistics.channel_message_counts)
        there = sum(channel.count for channel in self._channels.values())
        if stated.total() == statistics.message_count:
            self._state(stated, "summary")
        elif statistics.message_count != there:
            raise self._damaged(f"its summary states {statistics.message_count} messages, there are {there}")

    def _compare_indexes(self) -> None:
        """Compare the indexes of chunks with the chunks: of each chunk, the index of its messages follows it."""
        if self._indexed > len(self._chunks):
            raise self._damaged(f"its summary states {self._indexed} chunks, there are {len(self._chunks)}")
        stated = Counter({key: channel.count for key, channel in self._channels.items()})
        left: Counter[int] = Counter()  # messages of the last chunk that no index has named
        first: dict[bytes, int] = {}  # chunk with these first bytes
        heads, places = array("q"), array("q")  # hashes of the first bytes of messages, and where they are
        for at, opcode, content in self._reader.glance():
            if opcode == Opcode.CHUNK:
                left = self._chunks.get(at, Counter())
                before = first.setdefault(content, at) if left else at
                if before != at and self._are_equal(before, at):
                    raise self._damaged(f"its chunk at byte {at} is the one at byte {before} once more", hint="")
            elif opcode == Opcode.MESSAGE:
                heads.append(hash(content))
                places.append(at)
            elif opcode == Opcode.MESSAGE_INDEX and len(content) >= _INDEX.size:
                key, size = _INDEX.unpack_from(content)
                left[key] -= size // _ENTRY
                if left[key] < 0:
                    stated[key] -= left[key]
                    left[key] = 0
        self._check_single(np.array(heads, np.int64), np.array(places, np.int64))
        if self._chunks:
            self._state(stated, "index")

    def _check_single(self, heads: NDArray[np.int64], places: NDArray[np.int64]) -> None:
        """Compare the messages with equal hashes of their first bytes. Raises SessionError if two are equal."""
        _, groups, counts = np.unique(heads, return_inverse=True, return_counts=True)
        seen: dict[bytes, int] = {}
        with self._reader.opened() as file:
            for at in places[counts[groups] > 1].tolist():
                (message,) = self._reader.record_at(file, at)
                digest = hashlib.blake2b(repr(message).encode(), digest_size=16).digest()
                if (before := seen.setdefault(digest, at)) != at:
                    raise self._damaged(f"its message at byte {at} is the one at byte {before} once more", hint="")

    def _state(self, stated: Counter[int], where: str) -> None:
        """Note how many messages of each channel the file states. Raises SessionError for some of unknown channels."""
        for key, channel in self._channels.items():
            channel.stated, channel.stated_by = stated[key], where
        if lost := sum(count for key, count in stated.items() if key not in self._channels):
            raise self._damaged(f"its {where} states {lost} messages of channels that are not there")

    def _are_equal(self, a: int, b: int) -> bool:
        """Whether two chunks hold the same messages."""
        with self._reader.opened() as file:
            one, other = (
                [each for each in self._reader.record_at(file, begin) if isinstance(each, Message)] for begin in (a, b)
            )
        return one == other

    def _damaged(self, reason: str, hint: str = SALVAGE_HINT) -> SessionError:
        return SessionError(damaged_bag(self._path, f"{reason}{hint}"))

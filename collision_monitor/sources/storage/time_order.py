"""The messages of a file in order of time. A file holds them in chunks, which may overlap in time."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterable, Iterator
from heapq import heappop, heappush
from pathlib import Path
from typing import Final

import numpy as np

from collision_monitor.errors import SessionError
from collision_monitor.sources.storage.stored_channel import StoredMessage

MOST_WAITING: Final = 1 << 30
"""Bytes of messages that wait for earlier ones in the chunks behind theirs. Recorders write about in order of time."""


class TimeOrder:
    """The chunks of a file, by their offsets and the time of the first message in each (ns)."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._begins = array("q")
        self._times = array("q")

    def add(self, begin: int, first: int) -> None:
        """Note a chunk that holds messages, the earliest of them at `first`."""
        self._begins.append(begin)
        self._times.append(first)

    def merged(self, read: Callable[[int], Iterable[StoredMessage]]) -> Iterator[StoredMessage]:
        """Yield the messages in order of time, those of one time in that of the file. read: those of a chunk.

        Raises SessionError if more than MOST_WAITING bytes wait for earlier messages.
        """
        waiting: list[tuple[int, int, int, StoredMessage]] = []
        size = 0
        for row in np.argsort(np.array(self._times, np.int64), kind="stable").tolist():
            begin = self._begins[row]
            while waiting and waiting[0][0] < self._times[row]:
                message = heappop(waiting)[-1]
                size -= len(message.data)
                yield message
            for place, message in enumerate(read(begin)):
                heappush(waiting, (message.time, begin, place, message))
                size += len(message.data)
            if size > MOST_WAITING:
                raise SessionError(
                    f"{self._path}: expected messages about in order of time, got {size} bytes of them before earlier "
                    "ones; sort the file first, an MCAP file by `mcap sort`"
                )
        while waiting:
            yield heappop(waiting)[-1]

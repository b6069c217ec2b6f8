"""The messages of a file in order of time. A file holds them in chunks, which may overlap in time.

A simulation that is reset sets the clock of receipt back while it is recorded, as always in ROS 1. By time alone, what
came before and after would be mixed. So the file is cut where a channel goes back, and its runs keep their order.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Hashable, Iterable, Iterator
from heapq import heappop, heappush
from itertools import islice
from pathlib import Path
from typing import Final

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import SessionError
from collision_monitor.sources.storage.stored_channel import StoredMessage

MOST_WAITING: Final = 1 << 30
"""Bytes of messages that wait for earlier ones in the chunks behind theirs. Recorders write about in order of time."""


BACK: Final = 1_000_000_000
"""ns by which the time of receipt of a channel falls when the clock was set back. Threads of a recorder differ less."""

MOST_RUNS: Final = 1000
"""Runs of a file. With more, its messages are in no order, and that of time alone is the best."""


class Runs:
    """The runs of a file: up to the message at which the clock of receipt was set back, and from it on."""

    def __init__(self) -> None:
        self._first, self._last = array("q"), array("q")
        self._latest: dict[Hashable, int] = {}  # by channel

    def __len__(self) -> int:
        """Return the number of runs so far."""
        return len(self._first)

    def begins(self, channel: Hashable, time: int) -> bool:
        """Take a message in the order of the file. Return whether a run begins with it."""
        latest = self._latest.get(channel, time)
        if self._first and time >= latest - BACK:
            self._latest[channel] = max(latest, time)
            self._first[-1], self._last[-1] = min(self._first[-1], time), max(self._last[-1], time)
            return False
        self._latest = {channel: time}
        self._first.append(time)
        self._last.append(time)
        return True

    def numbers(self) -> NDArray[np.int64]:
        """Return the number of each run; 0 for all, if order of time separates them as well, or if they are none."""
        first, last = np.array(self._first, np.int64), np.array(self._last, np.int64)
        order = np.argsort(first, kind="stable")
        overlap = first[order][1:] < np.maximum.accumulate(last[order])[:-1] - BACK
        return np.arange(len(self)) if overlap.any() and len(self) <= MOST_RUNS else np.zeros(len(self), np.int64)


class TimeOrder:
    """The chunks of a file, by their offsets and the time of the first message in each (ns), cut where a run begins."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._runs = Runs()
        self._begins, self._times, self._run = array("q"), array("q"), array("q")
        self._from, self._to = array("q"), array("q")  # the places of the messages in a chunk

    def add(self, begin: int, messages: Iterable[tuple[int, int]]) -> None:
        """Note a chunk. messages: channel and time of each that can be read, in the order of the file."""
        start = -1
        for place, (channel, time) in enumerate(messages):
            if self._runs.begins(channel, time) or start < 0:
                start = place
                self._begins.append(begin)
                self._times.append(time)
                self._run.append(len(self._runs) - 1)
                self._from.append(place)
                self._to.append(place)
            self._times[-1] = min(self._times[-1], time)
            self._to[-1] = place + 1

    def merged(self, read: Callable[[int], Iterable[StoredMessage | None]]) -> Iterator[StoredMessage]:
        """Yield the messages in order of time, those of one time in that of the file, run by run.

        read: those of a chunk that can be read, None for one that is not asked for. Raises SessionError if more than
        MOST_WAITING bytes wait for earlier messages.
        """
        waiting: list[tuple[int, int, int, int, StoredMessage]] = []
        size = 0
        times, runs = np.array(self._times, np.int64), self._runs.numbers()[np.array(self._run, np.int64)]
        for row in np.lexsort((times, runs)).tolist():
            begin, run = self._begins[row], int(runs[row])
            while waiting and waiting[0][:2] < (run, self._times[row]):
                message = heappop(waiting)[-1]
                size -= len(message.data)
                yield message
            for place, each in enumerate(islice(read(begin), self._from[row], self._to[row]), self._from[row]):
                if each is not None:
                    heappush(waiting, (run, each.time, begin, place, each))
                    size += len(each.data)
            if size > MOST_WAITING:
                raise SessionError(
                    f"{self._path}: expected messages about in order of time, got {size} bytes of them before earlier "
                    "ones; sort the file first, an MCAP file by `mcap sort`"
                )
        while waiting:
            yield heappop(waiting)[-1]

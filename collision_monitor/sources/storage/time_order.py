"""The messages of a file in order of time. A file holds them in chunks, which may overlap in time.

A simulation that is reset sets the clock of receipt back while it is recorded, as always in ROS 1. By time alone, what
came before and after would be mixed. So the file is cut where a channel goes back, and its runs keep their order.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Hashable, Iterable, Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from collision_monitor.errors import SessionError
from collision_monitor.sources.storage.stored_channel import StoredMessage

MOST_WAITING: Final = 1 << 30
"""Bytes of messages that wait for earlier ones in the chunks behind theirs. Recorders write about in order of time."""

BACK: Final = 1_000_000_000
"""ns by which the time of receipt of a channel falls only when the clock was set back."""

LATE: Final = 10_000_000
"""ns by which a message is behind the one before it because threads of a recorder wrote both. If it is further behind,
the next message of its channel tells whether it was late, or the clock was set back."""

MOST_RUNS: Final = 1000
"""Runs of a file. With more, its messages are in no order, and that of time alone is the best."""


@dataclass
class _Fall:
    """A message that is behind its channel, and what came since. place: of it. end: the latest time before it, ns."""

    place: int
    end: int
    first: int
    last: int
    latest: dict[Hashable, int]  # by channel

    def add(self, channel: Hashable, time: int) -> None:
        """Take one more message."""
        self.first, self.last = min(self.first, time), max(self.last, time)
        self.latest[channel] = max(self.latest.get(channel, time), time)


class Runs:
    """The runs of a file: up to the message at which the clock of receipt was set back, and from it on.

    The clock was set back where a channel falls by more than BACK; or by more than LATE, if its next message is behind
    what it fell from as well, and no channel has gone on from there in the meantime.
    """

    def __init__(self) -> None:
        self._first, self._last = array("q"), array("q")
        self._latest: dict[Hashable, int] = {}  # by channel
        self._fall: _Fall | None = None

    def take(self, channel: Hashable, time: int, place: int) -> int | None:
        """Take a message in the order of the file. Return the place at which a run began, once that is known."""
        if len(self._first) > MOST_RUNS:
            return None
        if not self._first:
            return self._begin(_Fall(place, time, time, time, {channel: time}))
        before = self._latest.get(channel, time)
        if time < before - BACK:
            return self._begin(_Fall(place, time, time, time, {channel: time}))
        if self._fall is not None and self._is_back(self._fall, channel, time, before):
            self._fall.add(channel, time)
            return self._begin(self._fall)
        if self._fall is None and time < before - LATE:
            self._fall = _Fall(place, self._last[-1], time, time, {channel: time})
        elif self._fall is not None:
            self._fall.add(channel, time)
        else:
            self._latest[channel] = max(before, time)
            self._first[-1], self._last[-1] = min(self._first[-1], time), max(self._last[-1], time)
        return None

    def _is_back(self, fall: _Fall, channel: Hashable, time: int, before: int) -> bool:
        """Whether a message shows that the clock was set back. Forget the fall if it shows that a message was late."""
        since = fall.latest.get(channel)
        if since is not None and since < time < before:
            return True
        if time > fall.end or (since is not None and since < before <= time):
            for key, each in fall.latest.items():
                self._latest[key] = max(self._latest.get(key, each), each)
            self._first[-1], self._last[-1] = min(self._first[-1], fall.first), max(self._last[-1], fall.last)
            self._fall = None
        return False

    def _begin(self, fall: _Fall) -> int:
        self._latest, self._fall = fall.latest, None
        self._first.append(fall.first)
        self._last.append(fall.last)
        return fall.place

    def numbers(self) -> NDArray[np.int64]:
        """Return the number of each run; 0 for all, if order of time separates them as well, or if they are none."""
        first, last = np.array(self._first, np.int64), np.array(self._last, np.int64)
        order = np.argsort(first, kind="stable")
        overlap = first[order][1:] < np.maximum.accumulate(last[order])[:-1]
        return np.arange(len(first)) if overlap.any() and len(first) <= MOST_RUNS else np.zeros(len(first), np.int64)


class _Piece(NamedTuple):
    """Messages of one run in one chunk. begin: offset of the chunk. Those from the place `start` to before `end`."""

    run: int
    time: int
    begin: int
    start: int
    end: int


class TimeOrder:
    """The chunks of a file: their offsets, the time of the first message in each (ns), and how many messages it has."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._runs = Runs()
        self._begins, self._times, self._ends = array("q"), array("q"), array("q")
        self._count = 0
        self._cuts = array("q")  # the number of the first message of each run

    def add(self, begin: int, messages: Iterable[tuple[int, int]]) -> None:
        """Note a chunk. messages: channel and time of each that can be read, in the order of the file."""
        earliest = None
        for channel, time in messages:
            cut = self._runs.take(channel, time, self._count)
            if cut is not None:
                self._cuts.append(cut)
            self._count += 1
            earliest = time if earliest is None else min(earliest, time)
        if earliest is not None:
            self._begins.append(begin)
            self._times.append(earliest)
            self._ends.append(self._count)

    def merged(self, read: Callable[[int], Iterable[StoredMessage | None]]) -> Iterator[StoredMessage]:
        """Yield the messages in order of time, those of one time in that of the file, run by run.

        read: those of a chunk that can be read, None for one that is not asked for. Raises SessionError if more than
        MOST_WAITING bytes wait for earlier messages.
        """
        waiting: list[tuple[int, int, int, int, StoredMessage]] = []
        size = 0
        source: Iterator[StoredMessage | None] = iter(())
        at = -1, 0  # which chunk the source reads, and at which place
        pieces = self._pieces()
        for k in np.lexsort((pieces[:, 1], pieces[:, 0])):
            piece = _Piece(*pieces[k].tolist())
            while waiting and waiting[0][:2] < (piece.run, piece.time):
                message = heappop(waiting)[-1]
                size -= len(message.data)
                yield message
            if at != (piece.begin, piece.start):
                source = islice(read(piece.begin), piece.start, None)
            at = piece.begin, piece.end
            for place, each in enumerate(islice(source, piece.end - piece.start), piece.start):
                if each is not None:
                    heappush(waiting, (piece.run, each.time, piece.begin, place, each))
                    size += len(each.data)
            if size > MOST_WAITING:
                raise SessionError(
                    f"{self._path}: expected messages about in order of time, got {size} bytes of them before earlier "
                    "ones; sort the file first, an MCAP file by `mcap sort`"
                )
        while waiting:
            yield heappop(waiting)[-1]

    def _pieces(self) -> NDArray[np.int64]:
        """Return the pieces (P, 5) of the chunks, cut where runs begin, each with the first time of its whole chunk."""
        found = array("q")
        numbers = self._runs.numbers()
        cuts = self._cuts if numbers.any() else self._cuts[:1]
        run = start = 0
        for begin, time, end in zip(self._begins, self._times, self._ends, strict=True):
            first = start
            while run < len(cuts) and cuts[run] < end:
                if cuts[run] > start:
                    found.extend((run - 1, time, begin, start - first, cuts[run] - first))
                start = cuts[run]
                run += 1
            found.extend((run - 1, time, begin, start - first, end - first))
            start = end
        return np.array(found, np.int64).reshape(-1, len(_Piece._fields))

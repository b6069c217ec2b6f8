"""Selects the messages that a recording around events keeps."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator

from collision_monitor.session.recording.queue_entry import QueueEntry


class EventWindow:
    """Holds back the latest entries and keeps them if an event follows.

    before, after: s that are kept around each event. limit: bytes that are held back at most; beyond it the oldest
    entries are dropped. from_snapshots: what is kept begins with the last snapshot before those `before` seconds, or
    with the start of the recording, so that it can be replayed.
    """

    def __init__(self, before: float, after: float, limit: int, *, from_snapshots: bool = False) -> None:
        self._before = round(before * 1e9)
        self._after = round(after * 1e9)
        self._limit = limit
        self._from_snapshots = from_snapshots
        self._held: deque[QueueEntry] = deque()
        self._snapshots: deque[QueueEntry] = deque()  # the snapshots in `_held`
        self._bytes = 0
        self._until = -1

    def take(self, entry: QueueEntry) -> Iterator[tuple[QueueEntry, bool]]:
        """Add an entry. Yield each entry once, in order, with whether it is kept. Times never decrease."""
        if entry.event:
            self._until = entry.log_time + self._after
        self._held.append(entry)
        self._bytes += entry.cost
        if entry.snapshot is not None:
            self._snapshots.append(entry)
        # All messages of a step have its log time, so a step is kept or dropped as a whole.
        while self._is_past(entry.log_time - self._before):
            yield self._pop(), False
        while self._held and entry.log_time <= self._until:
            yield self._pop(), True
        while self._bytes > self._limit:
            yield self._pop(), False

    def _is_past(self, oldest: int) -> bool:
        """Return whether the first entry held back is not needed for a window that begins at `oldest` (ns) or later."""
        first = self._held[0]
        if not self._from_snapshots:
            return first.log_time < oldest
        following = next((each for each in self._snapshots if each is not first), None)
        return following is not None and following.log_time < oldest

    def _pop(self) -> QueueEntry:
        entry = self._held.popleft()
        self._bytes -= entry.cost
        if entry.snapshot is not None:
            self._snapshots.popleft()
        return entry

"""A message, or a snapshot between two messages, on its way to the disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import itemgetter
from typing import Final, NamedTuple

from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription

_OVERHEAD: Final = 128
"""Bytes that a waiting message costs beside its data, so that the number of empty messages is bounded too."""


class QueueEntry(NamedTuple):
    """A message, or a snapshot, in the recorder's queue. Times in ns.

    event: a collision begins in it. objects: all objects described after it, if it changes them. settings: the
    metadata of the settings after it, if it changes them. snapshot: the monitor's state before message `sequence`, in
    place of a message.
    """

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int
    event: bool = False
    objects: Sequence[ObjectDescription] | None = None
    snapshot: Snapshot | None = None
    settings: Mapping[str, str] | None = None

    @property
    def cost(self) -> int:
        """Approximate memory (bytes)."""
        return len(self.data) + _OVERHEAD + (self.snapshot.nbytes if self.snapshot else 0)


_MARKS: Final = tuple(itemgetter(QueueEntry._fields.index(name)) for name in ("objects", "snapshot", "settings"))


def are_messages_alone(entries: Sequence[QueueEntry]) -> bool:
    """Return whether no entry changes objects or settings or is a snapshot. Takes 50 ns for each entry."""
    return all(list(map(get, entries)).count(None) == len(entries) for get in _MARKS)

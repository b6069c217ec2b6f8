"""A message, or a snapshot between two, on its way to the disk."""

from __future__ import annotations

from collections.abc import Sequence
from operator import itemgetter
from typing import Final, NamedTuple

from collision_monitor.monitor.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription

_OVERHEAD: Final = 128
"""Bytes that a waiting message costs beside its data, so that empty ones are bounded too."""


class QueueEntry(NamedTuple):
    """event: a collision begins in it. objects: all that are described once it was taken in, where it changed them.

    snapshot: then it is no message but the monitor as it is before message `sequence`. settings: the profile (JSON)
    once it was taken in, where it changed it.
    """

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int
    event: bool = False
    objects: Sequence[ObjectDescription] | None = None
    snapshot: Snapshot | None = None
    settings: str | None = None

    @property
    def cost(self) -> int:
        """Bytes of memory, about."""
        return len(self.data) + _OVERHEAD + (self.snapshot.nbytes if self.snapshot else 0)


_MARKS: Final = tuple(itemgetter(QueueEntry._fields.index(name)) for name in ("objects", "snapshot", "settings"))


def are_messages_alone(entries: Sequence[QueueEntry]) -> bool:
    """Whether none of them changes objects or settings, and none is a snapshot: 50 ns for each."""
    return all(list(map(get, entries)).count(None) == len(entries) for get in _MARKS)

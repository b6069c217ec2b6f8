"""A message on its way to the disk."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

from collision_monitor.description import ObjectDescription

_OVERHEAD: Final = 128
"""Bytes that a waiting message costs beside its data, so that empty ones are bounded too."""


class Entry(NamedTuple):
    """event: a collision begins in it. objects: all that are described once it was taken in, where it changed them."""

    topic: str
    data: bytes
    log_time: int
    publish_time: int
    sequence: int
    event: bool = False
    objects: Sequence[ObjectDescription] | None = None

    @property
    def cost(self) -> int:
        """Bytes of memory, about."""
        return len(self.data) + _OVERHEAD

"""Counts lost messages by the gaps between their sequence numbers."""

from __future__ import annotations

from typing import Any, Final

LARGEST_WRAP: Final = 1 << 16
"""A falling sequence number is the counter's wrap at 2^32 if at most this many messages are lost, else a restart."""

_LAST: Final = 0xFFFFFFFF
"""The sequence number before the wrap."""


class LostMessages:
    """Counts the lost messages of one publisher. count: so far; last: the last sequence number, None at first."""

    def __init__(self, count: int = 0, last: int | None = None) -> None:
        self.count = count
        self.last = last

    def receive(self, sequence: int) -> None:
        """Process the sequence number of the next message. A publisher that does not count always sends 0."""
        if sequence == 0 and self.last != _LAST:
            return
        last, self.last = self.last, sequence
        if last is None or sequence == last:
            return
        gap = (sequence - last) % (_LAST + 1) - 1
        if sequence > last or gap <= LARGEST_WRAP:
            self.count += gap

    def facts(self) -> dict[str, Any]:
        """Return the state, for a snapshot."""
        return {"messages_lost": self.count, "sequence": self.last}

"""How many messages were lost on their way, by the gaps between their sequence numbers."""

from __future__ import annotations

from typing import Any, Final

LARGEST_WRAP: Final = 1 << 16
"""A sequence number that falls is the counter's wrap at 2^32 if it lost at most this many messages, else a restart."""

_LAST: Final = 0xFFFFFFFF
"""The sequence number before the wrap."""


class LostMessages:
    """Counts lost messages of one publisher. count: so far; last: the sequence number that came last, None: none."""

    def __init__(self, count: int = 0, last: int | None = None) -> None:
        self.count = count
        self.last = last

    def receive(self, sequence: int) -> None:
        """Take in the sequence number of the next message; a publisher that does not count always sends 0."""
        if sequence == 0 and self.last != _LAST:
            return
        last, self.last = self.last, sequence
        if last is None or sequence == last:
            return
        gap = (sequence - last) % (_LAST + 1) - 1
        if sequence > last or gap <= LARGEST_WRAP:
            self.count += gap

    def facts(self) -> dict[str, Any]:
        """The state, for a snapshot."""
        return {"messages_lost": self.count, "sequence": self.last}

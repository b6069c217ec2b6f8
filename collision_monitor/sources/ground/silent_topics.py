"""Topics of the sources file that had messages and have none any more: their objects come and go, and may be gone.

An object of its own becomes stale when its topic falls silent. A group of tracks stays as it was, or is forgotten, and
nothing is left that could be stale.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from typing import Final, NamedTuple

from collision_monitor.monitor.state.timeline import NANOSECOND

LONGER: Final = 3.0
"""Factor on the longest time between two messages of a topic so far, after which it counts as silent."""

_LONGEST: Final = 10
"""A slow topic counts as silent after at most `LONGER` times this multiple of `max_age`."""


class SilentTopic(NamedTuple):
    """A line of the sources file whose topic fell silent. last_ns: receipt of its last message, ns."""

    line: str
    topic: str
    reason: str
    last_ns: int


class SilentTopics:
    """Notes when messages arrive. A topic counts as silent after `max_age` (s) of the file; a slow one, later.

    stale: lines whose objects become stale instead. latched: topics whose publishers keep their last message.
    """

    def __init__(self, max_age: float, stale: Collection[str] = ()) -> None:
        self.latched: set[str] = set()
        self._stale = frozenset(stale)
        self._least = round(max_age / NANOSECOND)
        self._last: dict[tuple[str, str], int] = {}  # ns, of the last message, by topic and line
        self._longest: dict[tuple[str, str], int] = {}  # ns between two messages

    def heard(self, topic: str, line: str, now_ns: int) -> None:
        """Note a message of a topic for a line."""
        if line in self._stale:
            return
        key = topic, line
        last = self._last.get(key)
        if last is not None and now_ns > last:
            self._longest[key] = max(self._longest.get(key, 0), now_ns - last)
        self._last[key] = now_ns

    def find(self, now_ns: int) -> Iterator[SilentTopic]:
        """Yield the lines whose topics are silent."""
        for key, last in self._last.items():
            topic, line = key
            if last > now_ns:  # the clock of receipt went back
                self._last[key] = now_ns
            limit = max(self._least, round(LONGER * min(self._longest.get(key, 0), _LONGEST * self._least)))
            if now_ns - last > limit and topic not in self.latched:
                text = f"no message on {topic} for more than {limit * NANOSECOND:g} s: what it held last stays"
                yield SilentTopic(line, topic, text, last)

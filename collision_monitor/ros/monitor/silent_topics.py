"""Topics of the sources file that had messages and have none any more: their objects come and go, and may be gone.

An object of its own becomes stale when its topic falls silent. A group of tracks is forgotten, and nothing is left that
could be stale.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.sources import Mapping, Unmonitored

LONGER: Final = 3.0
"""Factor on the longest time between two messages of a topic so far, after which it counts as silent."""


class SilentTopics:
    """Notes when messages arrive. A topic counts as silent after `max_age` of the file; a slow one, later."""

    def __init__(self, mapping: Mapping) -> None:
        self._lines = {
            topic: [entry.name for entry in entries if not (entry.static or entry.shapes)]
            for topic, entries in mapping.topics.items()
        }
        self._least = round(mapping.max_age / NANOSECOND)
        self._last: dict[str, int] = {}  # ns, of the last message
        self._longest: dict[str, int] = {}  # ns between two messages

    def heard(self, topic: str, now_ns: int) -> None:
        """Note a message of a topic."""
        if not self._lines.get(topic):
            return
        last = self._last.get(topic)
        if last is not None and now_ns > last:
            self._longest[topic] = max(self._longest.get(topic, 0), now_ns - last)
        self._last[topic] = now_ns

    def rows(self, now_ns: int, latched: Iterable[str] = ()) -> list[Unmonitored]:
        """Return a row for each line of a silent topic. latched: topics whose publishers keep their last message."""
        found = []
        for topic, last in self._last.items():
            if topic in latched:
                continue
            longest = min(self._longest.get(topic, 0), 10 * self._least)
            if now_ns - last > max(self._least, round(LONGER * longest)):
                text = f"no message on {topic} any more"
                found += [Unmonitored(line, topic, text, last) for line in self._lines[topic]]
        return found

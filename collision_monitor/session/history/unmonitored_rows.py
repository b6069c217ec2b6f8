"""What a session says was asked for and not monitored, as spans of time."""

from __future__ import annotations

from collision_monitor.codec import DiagnosticArray
from collision_monitor.codec.diagnostics import SINCE
from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.session.history.history import UnmonitoredSpan


class UnmonitoredRows:
    """Follows the messages of the topic: each has all that is not monitored at its stamp."""

    def __init__(self) -> None:
        self._open: dict[str, tuple[str, int]] = {}  # by name of the status: text, and since when (ns)
        self._ended: list[tuple[str, int, int]] = []  # text, begin, end (ns)

    def take(self, array: DiagnosticArray) -> None:
        """Take the next message; of what is still missing the last reason counts."""
        here = {each.name: each for each in array.statuses if SINCE in each.values}
        for name in [name for name in self._open if name not in here]:
            self._ended.append((*self._open.pop(name), array.stamp_ns))
        for name, each in here.items():
            since = each.values[SINCE]
            self._open[name] = each.message, int(since) if since.lstrip("-").isdecimal() else array.stamp_ns

    def spans(self, begin_ns: int) -> list[UnmonitoredSpan]:
        """Return the spans by their begin. begin_ns: of the session."""
        found: list[tuple[str, int, int | None]] = [*self._ended, *((*each, None) for each in self._open.values())]
        return [
            UnmonitoredSpan(
                text, (begin - begin_ns) * NANOSECOND, None if end is None else (end - begin_ns) * NANOSECOND
            )
            for text, begin, end in sorted(found, key=lambda each: (each[1], each[0]))
        ]

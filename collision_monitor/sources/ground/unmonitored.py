"""What a sources file asks for and the monitor does not have: one list, for the log, the topics and the report."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final, NamedTuple

from collision_monitor.codec import DiagnosticStatus, encode_diagnostics
from collision_monitor.codec.diagnostics import SINCE

MOST_ROWS: Final = 1000
"""Rows of the list. A line with many links or objects may fill it; then the last row says so."""

LONGEST_REASON: Final = 500
"""Characters of a reason, which may quote a message."""

_ERROR: Final = 2
"""Level of diagnostic_msgs/DiagnosticStatus."""


class Unmonitored(NamedTuple):
    """A row of the list.

    line: the key in the sources file. what: the object, link or topic that is missing: `arm/forearm`, `/odm`. reason:
    what was expected, and what was there. since_ns: when the row appeared, ns, by the clock that stamps the receipt of
    messages: the node's clock, or that of the bag.
    """

    line: str
    what: str
    reason: str
    since_ns: int

    @property
    def text(self) -> str:
        """The row without its time, for people."""
        if self.reason.startswith(f"{self.line}: "):
            return self.reason
        what = "" if self.what == self.line or self.what in self.reason else f"{self.what}: "
        return f"{self.line}: {what}{self.reason}"


def as_status(node: str, row: Unmonitored) -> DiagnosticStatus:
    """Return an ERROR for a row, with its line, its reason and since when (ns)."""
    name = f"{node}: not monitored: {row.what or row.line or 'others'}"
    values = {"line": row.line, "what": row.what, "reason": row.reason, SINCE: str(row.since_ns)}
    return DiagnosticStatus(_ERROR, name, row.text, values)


class UnmonitoredRecord:
    """Encodes the list for a recording, whenever it differs from the one before. node: its name."""

    def __init__(self, node: str) -> None:
        self._node = node
        self._last: tuple[Unmonitored, ...] = ()

    def changed(self, rows: Iterable[Unmonitored], now_ns: int) -> bytes | None:
        """Return a DiagnosticArray with an ERROR for each row, stamped now; None: they are as at the last call."""
        found = tuple(rows)
        if found == self._last:
            return None
        self._last = found
        return encode_diagnostics(now_ns, [as_status(self._node, row) for row in found])


class UnmonitoredList:
    """Rows by line and object. A further reason for the same object replaces the text and keeps the time."""

    def __init__(self) -> None:
        self._rows: dict[tuple[str, str], Unmonitored] = {}
        self._left_out = 0

    def lacks(self, line: str, what: str, reason: str, now_ns: int) -> None:
        """Note that something is not monitored."""
        key = line, what[:LONGEST_REASON]
        known = self._rows.get(key)
        if known is None and len(self._rows) >= MOST_ROWS:
            self._left_out += 1
            return
        since = now_ns if known is None else known.since_ns
        self._rows[key] = Unmonitored(*key, reason[:LONGEST_REASON], since)

    def explain(self, line: str, what: str, reason: str) -> None:
        """Give a row that is there another reason."""
        known = self._rows.get((line, what[:LONGEST_REASON]))
        if known is not None:
            self._rows[known.line, known.what] = known._replace(reason=reason[:LONGEST_REASON])

    def has(self, line: str, what: str) -> None:
        """Note that something is monitored; without a row this does nothing."""
        self._rows.pop((line, what[:LONGEST_REASON]), None)

    def drop(self, line: str, prefix: str = "") -> None:
        """Remove the rows of a line whose object begins with a prefix."""
        for key in [key for key in self._rows if key[0] == line and key[1].startswith(prefix)]:
            del self._rows[key]

    def rows(self) -> tuple[Unmonitored, ...]:
        """Return the rows, the oldest first."""
        found = tuple(self._rows.values())
        if self._left_out and 2 * len(found) >= MOST_ROWS:
            more = f"{self._left_out} further ones are not listed"
            return (*found, Unmonitored("", "", more, found[-1].since_ns))
        self._left_out = 0
        return found

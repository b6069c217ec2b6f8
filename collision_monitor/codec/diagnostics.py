"""diagnostic_msgs/DiagnosticArray: what a program says of its health. Sessions hold what is not monitored in it."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from collision_monitor.codec.cdr import Buffer, Reader, Writer, write_header

_LEAST_STATUS, _LEAST_VALUE = 20, 8
"""Bytes of the shortest status, and of the shortest value."""

NO_HARDWARE: Final = "none"

SINCE: Final = "since [ns]"
"""Key of the value that says since when something is not monitored."""


@dataclass(frozen=True)
class DiagnosticStatus:
    """A status: its level (0 OK, 1 WARN, 2 ERROR, 3 STALE), name, text, hardware and values by key."""

    level: int
    name: str
    message: str
    values: dict[str, str] = field(default_factory=dict)
    hardware_id: str = NO_HARDWARE


@dataclass(frozen=True)
class DiagnosticArray:
    """The fields of the message, but for the frame, which has no meaning."""

    stamp_ns: int
    statuses: tuple[DiagnosticStatus, ...]


def encode_diagnostics(stamp_ns: int, statuses: Iterable[DiagnosticStatus]) -> bytes:
    """Encode a DiagnosticArray. Raises MessageError."""
    writer, found = Writer("DiagnosticArray"), list(statuses)
    write_header(writer, stamp_ns, "")
    writer.scalar("u4", len(found), "length")
    for each in found:
        writer.scalar("u1", each.level, "level")
        writer.string(each.name, "name")
        writer.string(each.message, "message")
        writer.string(each.hardware_id, "hardware_id")
        writer.scalar("u4", len(each.values), "length")
        for key, value in each.values.items():
            writer.string(key, "key")
            writer.string(value, "value")
    return writer.finish()


def decode_diagnostics(data: Buffer) -> DiagnosticArray:
    """Decode a DiagnosticArray; of values with the same key the last one counts. Raises MessageError."""
    reader = Reader(data, "DiagnosticArray")
    stamp_ns, _ = reader.stamp_ns(), reader.string("header.frame_id")
    found = [_read_status(reader) for _ in range(reader.count(_LEAST_STATUS, "status"))]
    reader.finish()
    return DiagnosticArray(stamp_ns, tuple(found))


def _read_status(reader: Reader) -> DiagnosticStatus:
    level, name = int(reader.scalar("u1", "level")), reader.string("name")
    message, hardware_id = reader.string("message"), reader.string("hardware_id")
    count = reader.count(_LEAST_VALUE, "values")
    values = {reader.string("key"): reader.string("value") for _ in range(count)}
    return DiagnosticStatus(level, name, message, values, hardware_id)

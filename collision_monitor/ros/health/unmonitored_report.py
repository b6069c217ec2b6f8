"""What a sources file asks for and is not monitored, as statuses of `~/sources`."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.sources import Unmonitored, as_status


def unmonitored_statuses(node: str, rows: Iterable[Unmonitored], now_ns: int) -> list[DiagnosticStatus]:
    """Return an ERROR for each row, with its line, its reason, and since when (ns, and for how long in s)."""
    found = []
    for row in rows:
        given = as_status(node, row)
        values = {**given.values, "for [s]": f"{(now_ns - row.since_ns) * NANOSECOND:.1f}"}
        found.append(
            DiagnosticStatus(
                level=bytes([given.level]),
                name=given.name,
                message=given.message,
                hardware_id=given.hardware_id,
                values=[KeyValue(key=key, value=value) for key, value in values.items()],
            )
        )
    return found

"""What a sources file asks for and is not monitored, as statuses of `~/sources`."""

from __future__ import annotations

from collections.abc import Iterable

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

from collision_monitor.monitor.state.timeline import NANOSECOND
from collision_monitor.ros.health.line_report import DiagnosticLevel
from collision_monitor.sources import Unmonitored


def unmonitored_statuses(node: str, rows: Iterable[Unmonitored], now_ns: int) -> list[DiagnosticStatus]:
    """Return an ERROR for each row, with its line, its reason, and since when (ns, and for how long in s)."""
    return [
        DiagnosticStatus(
            level=bytes([DiagnosticLevel.ERROR]),
            name=f"{node}: not monitored: {row.what or row.line or 'others'}",
            message=row.text,
            hardware_id="none",
            values=[
                KeyValue(key="line", value=row.line),
                KeyValue(key="what", value=row.what),
                KeyValue(key="reason", value=row.reason),
                KeyValue(key="since [ns]", value=str(row.since_ns)),
                KeyValue(key="for [s]", value=f"{(now_ns - row.since_ns) * NANOSECOND:.1f}"),
            ],
        )
        for row in rows
    ]

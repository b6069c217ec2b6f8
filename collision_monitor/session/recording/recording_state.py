"""State of a recording, a field of the monitor's status."""

from __future__ import annotations

from enum import IntEnum


class Recording(IntEnum):
    """Values of `MonitorStatus.recording`."""

    OFF = 0
    ON = 1
    FAILED = 2

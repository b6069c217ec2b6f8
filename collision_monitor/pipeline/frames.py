"""Check of the frame of a message. All objects of a monitor are in one frame."""

from __future__ import annotations

from collision_monitor.errors import Refusal
from collision_monitor.monitor.monitor import Monitor


def is_in_frame(monitor: Monitor, expected: str, frame_id: str, message: str) -> bool:
    """Return whether the frame of a message is the expected one, else refuse it. An empty frame counts as that one."""
    if frame_id in ("", expected):
        return True
    monitor.refuse(Refusal.FRAME, f"{message}: expected frame_id {expected!r}, got {frame_id!r}")
    return False

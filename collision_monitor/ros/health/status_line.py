"""A status as one line for the log."""

from __future__ import annotations

import math

from collision_monitor.codec import MonitorStatus
from collision_monitor.errors import Refusal
from collision_monitor.session import Recording


def status_line(status: MonitorStatus) -> str:
    """Return the number of objects, their contacts and predictions, and the problems."""
    latency = "unknown" if math.isnan(status.latency) else f"{status.latency * 1e3:.1f} ms"
    line = (
        f"{status.objects} objects at {status.rate:.0f} Hz: {status.contacts} touching, "
        f"{status.predictions} predicted, latency {latency}"
    )
    refused = sum(getattr(status, f"refused_{reason.value}") for reason in Refusal)
    if refused:
        line += f", {refused} refused (last: {status.last_refusal})"
    if status.recording == Recording.FAILED:
        line += f", recording failed: {status.recording_error}"
    return line

"""Sessions: the monitor's inputs and answers, recorded, read and replayed. Does not need ROS.

Each name is imported at its first use, so that a node that records nothing does without the packages for MCAP.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

_HOME = {
    "ONE_FILE": "recording.splitting",
    "Recorded": "reader",
    "Recorder": "recording.recorder",
    "Recording": "recording.recording_state",
    "Session": "reader",
    "Splitting": "recording.splitting",
}
__all__ = list(_HOME)

if TYPE_CHECKING:
    from collision_monitor.session.reader import Recorded as Recorded
    from collision_monitor.session.reader import Session as Session
    from collision_monitor.session.recording.recorder import Recorder as Recorder
    from collision_monitor.session.recording.recording_state import Recording as Recording
    from collision_monitor.session.recording.splitting import ONE_FILE as ONE_FILE
    from collision_monitor.session.recording.splitting import Splitting as Splitting


def __getattr__(name: str) -> Any:
    """Import the name at its first use."""
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOME[name]}"), name)
    globals()[name] = value
    return value

"""Sessions: what the monitor saw and said, recorded, read again and replayed. Without ROS."""

from collision_monitor.session.reader import Recorded, Session
from collision_monitor.session.recorder import Recorder, Recording

__all__ = ["Recorded", "Recorder", "Recording", "Session"]

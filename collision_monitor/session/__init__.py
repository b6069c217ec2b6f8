"""Sessions: the monitor's inputs and answers, recorded, read and replayed. Does not need ROS."""

from collision_monitor.session.reader import Recorded, Session
from collision_monitor.session.recording.recorder import Recorder, Recording
from collision_monitor.session.recording.splitting import ONE_FILE, Splitting

__all__ = ["ONE_FILE", "Recorded", "Recorder", "Recording", "Session", "Splitting"]

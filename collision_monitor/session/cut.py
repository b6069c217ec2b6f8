"""The least of a session that still shows a difference: all that was put in until then, and what was answered."""

from __future__ import annotations

from itertools import islice
from pathlib import Path

from collision_monitor.errors import SessionError
from collision_monitor.session.reader import Session
from collision_monitor.session.recorder import Recorder, Recording


def cut(session: Session, messages: int, target: Path, *, overwrite: bool = False) -> int:
    """Copy the first `messages` of a session into a new one; returns how many there were.

    Raises SessionError where the target cannot be written or is the session itself, or where there are no settings.
    """
    if session.foreign:
        raise SessionError(f"{session.path}: expected a session with its settings in it, got another program's")
    if target.exists() and target.samefile(session.path):
        raise SessionError(f"{target}: expected another path than that of the session itself")
    found = list(islice(session.messages(), messages))
    types = {message.topic: message.type for message in found}
    recorder = Recorder(target, types, session.metadata, overwrite=overwrite, patient=True)
    with recorder:
        for message in found:
            recorder.write(message.topic, message.data, message.log_time, message.publish_time)
    told = recorder.status()
    if told["recording"] == Recording.FAILED:
        raise SessionError(str(told["recording_error"]))
    return len(found)

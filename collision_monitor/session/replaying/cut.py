"""Cuts out the part of a session that shows a difference, from the last snapshot before it, or from the start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from collision_monitor.codec import encode_descriptions
from collision_monitor.errors import SessionError
from collision_monitor.pipeline.pipeline import Pipeline
from collision_monitor.session.mcap.definitions import definition
from collision_monitor.session.mcap.layout import REPEATED
from collision_monitor.session.mcap.rosbag2 import RECORDED_TYPES, full_name
from collision_monitor.session.output_file import check_output
from collision_monitor.session.reader import Recorded, RecordedSnapshot, Session
from collision_monitor.session.recording.queue_entry import QueueEntry
from collision_monitor.session.recording.session_file import SessionFile
from collision_monitor.session.replaying.replay import replay


def cut(
    session: Session, sequence: int, target: Path, *, tolerance: float | None = None, overwrite: bool = False
) -> int:
    """Copy the part that shows the difference in message `sequence` into a new session. Return its number of messages.

    tolerance (m, s): that of the replay that found the difference.
    Raises SessionError if the target exists and `overwrite` is false, is the session itself or cannot be written, or if
    there are no settings.
    """
    if session.foreign:
        raise SessionError(f"{session.path}: expected a session with its settings in it, got another program's")
    check_output(target, overwrite=overwrite, inputs=[session.path])
    found = list(_until(session, sequence))
    snapshots = [k for k, each in enumerate(found) if isinstance(each, RecordedSnapshot)]
    for start in (*snapshots[-1:], 0):
        try:
            count = _write(session, found, start, target)
        except OSError as error:
            raise SessionError(f"{target}: expected to be able to write there, got: {error.strerror}") from None
        # If a replay from the snapshot does not show the difference, its cause is older.
        if start and replay(Session(target), tolerance=tolerance).first_message == sequence:
            break
    return count


def _until(session: Session, sequence: int) -> Iterator[Recorded | RecordedSnapshot]:
    """Yield the entries that a replay reads up to that message."""
    for k, each in enumerate(session.entries()):
        if isinstance(each, RecordedSnapshot) or not each.repeated or k == 0:
            yield each
        if isinstance(each, Recorded) and not each.repeated and each.sequence == sequence:
            return


def _write(session: Session, found: Sequence[Recorded | RecordedSnapshot], start: int, target: Path) -> int:
    """Write the entries from `start` on; if that is not 0, first a message that describes the objects at that time."""
    types = {each.topic: each.type for each in found if isinstance(each, Recorded) and each.type in RECORDED_TYPES}
    definitions = {name: definition(full_name(name)).encode() for name in types.values()}
    metadata = {**session.metadata, REPEATED: "1"} if start else session.metadata
    file = SessionFile(target, types, metadata, definitions, overwrite=True)
    count = 0
    try:
        if start:
            file.write([_objects(session, found[:start], types)])
        for each in found[start:]:
            if isinstance(each, RecordedSnapshot):
                file.write_snapshot(each.data, each.sequence, each.log_time)
            elif each.topic in types:
                file.write([QueueEntry(each.topic, each.data, each.log_time, each.publish_time, each.sequence)])
                count += not each.repeated
        file.finish()
    except BaseException:
        file.discard()
        raise
    return count


def _objects(session: Session, before: Sequence[Recorded | RecordedSnapshot], types: dict[str, str]) -> QueueEntry:
    """Return one message with all objects described so far. There are some, because a step differs."""
    pipeline = Pipeline(session.profile, session.frame_id)
    messages = [each for each in before if isinstance(each, Recorded)]
    for each in messages:
        if each.type == "ObjectDescriptionArray":
            pipeline.on_shapes(each.data)
    last = messages[-1]
    topic = next(topic for topic, name in types.items() if name == "ObjectDescriptionArray")
    objects = list(pipeline.catalogue.descriptions.values())
    data = encode_descriptions(last.log_time, session.frame_id, objects, snapshot=True)
    return QueueEntry(topic, data, last.log_time, last.log_time, last.sequence)

"""The files of a recording: one file, or a folder of several if it is split or made around events.

Each file can be read alone: its metadata holds its place in the recording and the profile in force, and its first
message repeats the descriptions of all objects described before. If there are snapshots, each file begins with one and
can also be replayed alone.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from collision_monitor.codec import encode_descriptions
from collision_monitor.errors import SessionError
from collision_monitor.monitor.state.snapshot import Snapshot
from collision_monitor.objects.description import ObjectDescription
from collision_monitor.session.mcap.definitions import definition
from collision_monitor.session.mcap.layout import NUMBER, RECORDING, REPEATED, SEQUENCE_MASK
from collision_monitor.session.mcap.rosbag2 import INPUT_TYPES, FileInformation, file_metadata, full_name
from collision_monitor.session.recording.event_window import EventWindow
from collision_monitor.session.recording.queue_entry import QueueEntry, are_messages_alone
from collision_monitor.session.recording.session_file import SessionFile
from collision_monitor.session.recording.splitting import Splitting

SNAPSHOT_PERIOD: Final = 10.0
"""Period of the snapshots in a file (s): a replay has to process 5 s on average to reach a given time."""

SNAPSHOT_SHARE: Final = 0.05
"""Largest share of the snapshots in a file. Quiet sessions have fewer snapshots."""

HELD_BYTES: Final = 256 << 20
"""Bytes that may wait for an event."""


class RecordingFiles:
    """The file being written, and the finished ones. Raises SessionError, and OSError if writing fails."""

    def __init__(
        self,
        path: Path,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        splitting: Splitting,
        *,
        overwrite: bool,
        snapshots: bool = False,
    ) -> None:
        self._path = path
        self._types = dict(types)
        self._metadata = dict(metadata)
        self._splitting = splitting
        self._splits = bool(splitting.size or splitting.duration)
        self._overwrite = overwrite
        self._snapshots = snapshots
        self._last_time = 0  # log time (ns) of the last message in a file
        self._next_snapshot = (0, 0)  # log time (ns) and file size from which on another one is written
        self._definitions = {name: definition(full_name(name)).encode() for name in self._types.values()}
        self._inputs = {topic for topic, name in self._types.items() if name in INPUT_TYPES}
        self._shapes = next((topic for topic, name in self._types.items() if name == "ObjectDescriptionArray"), None)
        self._objects: Sequence[ObjectDescription] = ()
        self._finished: dict[str, FileInformation] = {}
        self._finished_bytes = 0
        self._file: SessionFile | None = None
        self._window = (
            EventWindow(splitting.before, splitting.after, HELD_BYTES, from_snapshots=snapshots)
            if splitting.on_event
            else None
        )
        self._folder = None if path.suffix == ".mcap" else path
        if self._folder is None and splitting.makes_files:
            raise SessionError(
                f"{path}: splitting and recording on events make several files; expected a folder, a name without .mcap"
            )
        is_new = self._folder is not None and not self._folder.exists()
        if self._folder is not None:
            _make_folder(self._folder, overwrite)
            self._metadata[RECORDING] = uuid.uuid4().hex
        if self._window is None:
            try:
                self._open(None)
            except BaseException:
                if self._folder is not None and is_new:
                    with suppress(OSError):  # somebody else may have put a file there
                        self._folder.rmdir()
                raise

    @property
    def size(self) -> int:
        """Bytes of all files that the operating system has."""
        return self._finished_bytes + (self._file.size if self._file else 0)

    @property
    def is_full(self) -> bool:
        """Whether another file is to follow as soon as there is a snapshot to begin it with."""
        return self._splits and self._is_full(self._last_time)

    def write(self, entries: Sequence[QueueEntry]) -> int:
        """Process the next entries. Return the number of messages written, including earlier ones held back."""
        if self._window is None:
            return self._put(entries)
        written, kept = 0, list[QueueEntry]()
        for entry in entries:
            for each, is_kept in self._window.take(entry):
                if is_kept:
                    kept.append(each)
                    continue
                written += self._put(kept)
                kept = []
                self._finish()
                self._note(each)
        return written + self._put(kept)

    def flush(self) -> None:
        """Hand all messages that are kept to the operating system."""
        if self._file is not None:
            self._file.flush()

    def finish(self) -> None:
        """Write the summary of the last file, and rosbag2's metadata.yaml into a folder."""
        self._finish()
        if self._folder is not None and not self._finished:
            self._write_metadata()

    def close(self) -> None:
        """Close the open file as it is."""
        if self._file is not None:
            self._file.close()

    def _put(self, entries: Sequence[QueueEntry]) -> int:
        """Write entries with one call for each run without a new file or snapshot."""
        if self._file is not None and not self._splits and are_messages_alone(entries):
            return self._put_run(entries)
        run: list[QueueEntry] = []
        written = 0
        for entry in entries:
            if entry.snapshot is not None or (self._splits and not self._snapshots and entry.topic in self._inputs):
                written += self._put_run(run)
                run = []
                if self._file is not None and self._splits and self._is_full(entry.log_time):
                    self._finish()
                if entry.snapshot is not None:
                    self._put_snapshot(entry, entry.snapshot)
                    continue
            if self._file is None:
                self._open(entry)
            run.append(entry)
            self._note(entry)
        return written + self._put_run(run)

    def _put_run(self, run: Sequence[QueueEntry]) -> int:
        if run:
            assert self._file is not None
            self._file.write(run)
            self._last_time = run[-1].log_time
        return len(run)

    def _put_snapshot(self, entry: QueueEntry, snapshot: Snapshot) -> None:
        """Begin a file with the snapshot, or write it into the open file if one is due there."""
        if self._file is None:
            self._open(entry)
            return
        time, size = self._next_snapshot
        if entry.log_time >= time and self._file.size >= size:
            self._write_snapshot(self._file, entry, snapshot)

    def _note(self, entry: QueueEntry) -> None:
        """Store the objects and settings in force after the message, for the start of the next file."""
        if entry.objects is not None:
            self._objects = entry.objects
        if entry.settings is not None:
            self._metadata.update(entry.settings)

    def _write_snapshot(self, file: SessionFile, entry: QueueEntry, snapshot: Snapshot) -> None:
        data = snapshot.encode()
        file.write_snapshot(data, entry.sequence, entry.log_time)
        self._next_snapshot = (
            entry.log_time + round(SNAPSHOT_PERIOD * 1e9),
            file.size + round(len(data) / SNAPSHOT_SHARE),
        )

    def _is_full(self, now: int) -> bool:
        if self._file is None or self._file.begin is None:
            return False
        size, duration = self._splitting.size, self._splitting.duration
        return bool(size and self._file.size >= size) or bool(duration and now - self._file.begin >= duration * 1e9)

    def _open(self, first: QueueEntry | None) -> None:
        """Open the next file. first: the message or snapshot that it begins with; None for the first file of all."""
        if self._folder is None:
            self._file = SessionFile(
                self._path, self._types, self._metadata, self._definitions, overwrite=self._overwrite
            )
            return
        repeated = bool(first is not None and self._shapes and self._objects)
        number = len(self._finished)
        metadata = {**self._metadata, NUMBER: str(number), REPEATED: str(int(repeated))}
        path = self._folder / f"{self._folder.name}_{number}.mcap"
        self._file = SessionFile(path, self._types, metadata, self._definitions)
        self._next_snapshot = 0, 0
        if first is None:
            return
        if repeated:
            assert self._shapes is not None
            frame_id, at = self._metadata.get("frame_id", ""), first.log_time
            data = encode_descriptions(at, frame_id, self._objects, snapshot=True)
            self._file.write([QueueEntry(self._shapes, data, at, at, (first.sequence - 1) & SEQUENCE_MASK)])
        if first.snapshot is not None:
            self._write_snapshot(self._file, first, first.snapshot)

    def _finish(self) -> None:
        if self._file is None:
            return
        self._file.finish()
        self._finished_bytes += self._file.path.stat().st_size
        self._finished[self._file.path.name] = self._file.information
        self._file = None
        if self._folder is not None:  # after each, as rosbag2 does: the finished files are a bag if the rest is lost
            self._write_metadata()

    def _write_metadata(self) -> None:
        assert self._folder is not None
        text = file_metadata(self._finished, self._types)
        (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")


def _make_folder(folder: Path, overwrite: bool) -> None:
    """Make the folder, and remove the files of another recording with that name. Raises OSError."""
    folder.mkdir(exist_ok=overwrite)
    for path in [*folder.glob(f"{folder.name}_*.mcap"), folder / "metadata.yaml"]:
        path.unlink(missing_ok=True)

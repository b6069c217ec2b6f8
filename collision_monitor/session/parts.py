"""The files of a recording: one, or a folder with as many as splitting and events make of it.

Each file can be read alone: its metadata says where in the recording it stands, and the objects that were described
before are in its first message again.
"""

from __future__ import annotations

import uuid
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from collision_monitor.codec import encode_descriptions
from collision_monitor.description import ObjectDescription
from collision_monitor.errors import SessionError
from collision_monitor.session.definitions import definition
from collision_monitor.session.entry import Entry
from collision_monitor.session.event_window import EventWindow
from collision_monitor.session.rosbag2 import Extent, file_metadata, full_name
from collision_monitor.session.session_file import SessionFile

RECORDING, NUMBER, REPEATED = "recording", "file", "repeated"
"""Keys of a file's metadata: an id that the files of one recording share, its place among them from 0, and how many of
its first messages only repeat what was in force when it begins."""

HELD_BYTES: Final = 256 << 20
"""Most bytes that wait for an event."""

_INPUTS: Final = ("ObjectStateArray", "ObjectDescriptionArray")


@dataclass(frozen=True)
class Splitting:
    """When a recording goes on in another file, and whether it is made around events only.

    size: bytes from which on a file is followed by another; duration: the same in s; 0: never. on_event: only `before`
    seconds before each collision begins and `after` seconds after it are kept. Raises SessionError.
    """

    size: int = 0
    duration: float = 0.0
    on_event: bool = False
    before: float = 10.0
    after: float = 5.0

    def __post_init__(self) -> None:
        for name in ("size", "duration", "before", "after"):
            value = getattr(self, name)
            if not 0 <= value < float("inf"):
                raise SessionError(f"recording, {name}: expected a finite number, at least 0, got {value!r}")

    @property
    def makes_files(self) -> bool:
        """Whether there may be more than one."""
        return bool(self.size or self.duration or self.on_event)


ONE_FILE: Final = Splitting()


class Parts:
    """The file that is being written, and those before it. Raises SessionError, and OSError where the disk says no."""

    def __init__(
        self,
        path: Path,
        types: Mapping[str, str],
        metadata: Mapping[str, str],
        splitting: Splitting,
        *,
        overwrite: bool,
    ) -> None:
        self._path = path
        self._types = dict(types)
        self._metadata = dict(metadata)
        self._splitting = splitting
        self._splits = bool(splitting.size or splitting.duration)
        self._overwrite = overwrite
        self._definitions = {name: definition(full_name(name)).encode() for name in self._types.values()}
        self._inputs = {topic for topic, name in self._types.items() if name in _INPUTS}
        self._shapes = next((topic for topic, name in self._types.items() if name == "ObjectDescriptionArray"), None)
        self._objects: Sequence[ObjectDescription] = ()
        self._extents: dict[str, Extent] = {}
        self._finished_bytes = 0
        self._file: SessionFile | None = None
        self._window = EventWindow(splitting.before, splitting.after, HELD_BYTES) if splitting.on_event else None
        self._folder = None if path.suffix == ".mcap" else path
        if self._folder is None and splitting.makes_files:
            raise SessionError(
                f"{path}: splitting and recording on events make several files; expected a folder, a name without .mcap"
            )
        if self._folder is not None:
            _make_folder(self._folder, overwrite)
            self._metadata[RECORDING] = uuid.uuid4().hex
        if self._window is None:
            self._open(None)

    @property
    def size(self) -> int:
        """Bytes of all files that the operating system has."""
        return self._finished_bytes + (self._file.size if self._file else 0)

    def write(self, entries: Sequence[Entry]) -> int:
        """Take in the next messages; how many were written for them, of those that came before too."""
        if self._window is not None:
            return sum(map(self._select, entries))
        if self._splits:
            for entry in entries:
                self._put(entry)
        else:
            assert self._file is not None
            self._file.write(entries)
        return len(entries)

    def _select(self, entry: Entry) -> int:
        assert self._window is not None
        written = 0
        for each, kept in self._window.take(entry):
            if kept:
                self._put(each)
                written += 1
                continue
            self._finish()
            if each.objects is not None:
                self._objects = each.objects
        return written

    def flush(self) -> None:
        """Hand everything that is to be kept to the operating system."""
        if self._file is not None:
            self._file.flush()

    def finish(self) -> None:
        """Write the summary of the last file, and rosbag2's metadata.yaml into a folder."""
        self._finish()
        if self._folder is not None and not self._extents:
            self._write_metadata()

    def close(self) -> None:
        """Close what is open, as it is."""
        if self._file is not None:
            self._file.close()

    def _put(self, entry: Entry) -> None:
        if self._file is not None and entry.topic in self._inputs and self._is_full(entry):
            self._finish()
        if self._file is None:
            self._open(entry)
        assert self._file is not None
        self._file.write([entry])
        if entry.objects is not None:
            self._objects = entry.objects

    def _is_full(self, entry: Entry) -> bool:
        assert self._file is not None
        size, duration = self._splitting.size, self._splitting.duration
        begin = self._file.begin
        if begin is None:
            return False
        return bool(size and self._file.size >= size) or bool(duration and entry.log_time - begin >= duration * 1e9)

    def _open(self, first: Entry | None) -> None:
        """The next file; first: the message that it begins with, None for the first file of all."""
        if self._folder is None:
            self._file = SessionFile(
                self._path, self._types, self._metadata, self._definitions, overwrite=self._overwrite
            )
            return
        repeated = bool(first is not None and self._shapes and self._objects)
        number = len(self._extents)
        metadata = {**self._metadata, NUMBER: str(number), REPEATED: str(int(repeated))}
        path = self._folder / f"{self._folder.name}_{number}.mcap"
        self._file = SessionFile(path, self._types, metadata, self._definitions)
        if repeated:
            assert first is not None and self._shapes is not None
            frame_id, at = self._metadata.get("frame_id", ""), first.log_time
            data = encode_descriptions(at, frame_id, self._objects, snapshot=True)
            self._file.write([Entry(self._shapes, data, at, at, (first.sequence - 1) & 0xFFFFFFFF)])

    def _finish(self) -> None:
        if self._file is None:
            return
        self._file.finish()
        self._finished_bytes += self._file.path.stat().st_size
        self._extents[self._file.path.name] = self._file.extent
        self._file = None
        if self._folder is not None:  # after each, as rosbag2: what is finished is a bag also if the rest is lost
            self._write_metadata()

    def _write_metadata(self) -> None:
        assert self._folder is not None
        text = file_metadata(self._extents, self._types)
        (self._folder / "metadata.yaml").write_text(text, encoding="utf-8")


def _make_folder(folder: Path, overwrite: bool) -> None:
    """Raises OSError. Files of another recording of that name do not stay."""
    folder.mkdir(exist_ok=overwrite)
    for path in [*folder.glob(f"{folder.name}_*.mcap"), folder / "metadata.yaml"]:
        path.unlink(missing_ok=True)
